"""Finite elements: mesh to matrices, modes and the calibrated rigid model."""
