"""Tests of studies/explore/."""
