"""Error against time of every method and of other programs."""

from benchmarks import running

NAME = "work-precision"
ORDER = 50
SUMMARY = "speed against accuracy of all methods"
run = running("benchmarks.methods.measure")
