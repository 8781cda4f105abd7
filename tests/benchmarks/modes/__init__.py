"""Tests of benchmarks/modes/."""
