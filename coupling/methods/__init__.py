"""The values of `solver.method`, each a way to run a scene."""
