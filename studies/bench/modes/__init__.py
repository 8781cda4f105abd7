"""Eigensolvers."""
