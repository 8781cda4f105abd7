"""Tests of benchmarks/doubling/."""
