"""Tests of coupling/derivatives/."""
