"""Tests of coupling/methods/."""
