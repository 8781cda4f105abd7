"""Tests of benchmarks/bodies/."""
