"""Reduced models: interface coordinates and Craig-Bampton reduction."""
