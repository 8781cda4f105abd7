"""Periodic orbits of the exact engine: the period map and its derivative, orbits, branches of them, bifurcations."""
