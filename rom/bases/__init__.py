"""Reduction bases: `craig_bampton`, `free_interface` (Rubin, MacNeal), and `projection`, common to both."""
