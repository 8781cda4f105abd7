"""Numbers of a contact from geometry and materials: stiffness, yield, restitution. Begin with `pair.Pair`."""
