"""Tests of benchmarks/sweep/."""
