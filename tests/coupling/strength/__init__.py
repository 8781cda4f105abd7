"""Tests of coupling/strength/."""
