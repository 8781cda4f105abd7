"""Tests of benchmarks/sectors/."""
