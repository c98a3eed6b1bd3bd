"""Human drivers among DIM vehicles."""
