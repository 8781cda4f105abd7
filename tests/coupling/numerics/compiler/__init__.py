"""Tests of coupling/numerics/compiler/."""
