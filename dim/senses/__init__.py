"""What vehicles misperceive, and what that does to a run."""
