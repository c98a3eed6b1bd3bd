"""The least delay that any controller could reach, and a controller that comes near it."""
