"""Speed of the exact engine."""

from benchmarks import running

ORDER = 10
SUMMARY = "the exact engine against a hand-written loop and solve_ivp"
run = running("benchmarks.engine.measure")
