"""Tests of studies/optimisation/."""
