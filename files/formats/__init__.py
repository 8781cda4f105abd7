"""Formats of other programs: `meshes`, `matrices`, and datasets of universal files of test systems."""
