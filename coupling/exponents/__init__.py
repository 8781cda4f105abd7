"""Lyapunov exponents of motions."""
