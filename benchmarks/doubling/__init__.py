"""Where methods put a period doubling, and what motion they have before it."""

from benchmarks import running

ORDER = 65
SUMMARY = "where methods put a period doubling: its error against cost, and motions that they invent"
run = running("benchmarks.doubling.measure")
