"""Motions that are not steady: run-up and run-down, ring-down."""
