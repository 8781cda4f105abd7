"""Tests of coupling/transients/."""
