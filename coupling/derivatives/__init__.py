"""Derivatives of motions by their start and by numbers of their scenes, from the equations of motion."""
