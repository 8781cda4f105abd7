"""Tests of benchmarks/reduction/."""
