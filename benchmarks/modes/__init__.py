"""Eigensolvers."""

from benchmarks import running

NAME = "modal"
ORDER = 20
SUMMARY = "time and memory of ten modes beside scipy's solvers"
run = running("benchmarks.modes.measure")
