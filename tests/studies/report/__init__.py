"""Tests of studies/report/."""
