"""Search for the bodies that damp most."""
