"""Sweeps on several cores."""

from benchmarks import running

ORDER = 30
SUMMARY = "efficiency and memory of sweeps of up to a million scenes, and what limits many workers"
run = running("benchmarks.sweep.measure")
