"""The demonstration: scenes in units of the shipped structure, their sweeps as studies with pictures and claims."""
