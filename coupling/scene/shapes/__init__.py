"""Shapes of bodies: the values of `damper.shape`. Each is one class in a file of its own (shape.Shape)."""
