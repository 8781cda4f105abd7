"""Parametric meshes and the one mesh that is shipped."""
