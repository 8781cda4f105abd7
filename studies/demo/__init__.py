"""The demonstration: scenes in units of the shipped structure, and their sweeps with pictures and claims."""
