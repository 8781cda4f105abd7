"""Sweeps: grids of scenes, workers, checkpoints, one record of results."""
