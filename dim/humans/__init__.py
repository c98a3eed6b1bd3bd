"""Human drivers among vehicles of DIM."""
