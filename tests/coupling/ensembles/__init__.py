"""Tests of coupling/sweep/."""
