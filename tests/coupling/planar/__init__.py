"""Tests of coupling/planar/."""
