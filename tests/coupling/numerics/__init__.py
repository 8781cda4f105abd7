"""Tests of coupling/numerics/."""
