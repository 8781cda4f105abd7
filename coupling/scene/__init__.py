"""Scenes as validated records: the user's input."""
