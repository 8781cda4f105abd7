"""Reductions beside the modes of the same structure."""

from benchmarks import running

ORDER = 25
SUMMARY = "time of reduced models beside ten modes, with the factorisations and solves of each"
run = running("benchmarks.reduction.measure")
