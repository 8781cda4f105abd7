"""Tests of coupling/exact/."""
