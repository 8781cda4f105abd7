"""Numerical methods without physics, and the table of codes."""
