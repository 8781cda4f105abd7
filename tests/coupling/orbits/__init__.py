"""Tests of coupling/orbits/."""
