"""Tests of studies/case/."""
