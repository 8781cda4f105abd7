"""Tests of benchmarks/sensitivity/."""
