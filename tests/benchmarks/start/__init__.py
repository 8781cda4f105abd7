"""Tests of benchmarks/start/."""
