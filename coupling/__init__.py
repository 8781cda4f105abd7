"""Loose bodies in cavities coupled to a linear structure: scene, exact event engine, response."""
