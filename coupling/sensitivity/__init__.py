"""Derivatives of motions and of their figures by numbers of the scene: orbits, runs, ring-downs."""
