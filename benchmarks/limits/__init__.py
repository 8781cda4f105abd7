"""What this machine can do at most."""

from benchmarks import running

ORDER = 90
SUMMARY = "exponentials, arithmetic, memory, files and starts of this machine: what the other figures are limited by"
run = running("benchmarks.limits.measure")
