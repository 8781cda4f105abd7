"""Sweeps on several cores."""
