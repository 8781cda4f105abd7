"""How long a command takes to begin."""

from benchmarks import running

ORDER = 15
SUMMARY = "how long commands take to begin: help, a first compilation, a small run and its parts"
run = running("benchmarks.start.measure")
