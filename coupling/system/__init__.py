"""The scene as matrices, once for every method."""
