"""The engine room: the arrays of a run, the compiled kernel that advances them, and collisions."""
