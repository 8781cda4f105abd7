"""Tests of coupling/sensitivity."""
