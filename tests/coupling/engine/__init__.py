"""Tests of coupling/."""
