"""Questions and their answers: which runs, and what is computed from their rows."""
