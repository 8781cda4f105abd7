"""What a ring with a body in every sector costs."""

from benchmarks import running

ORDER = 68
SUMMARY = "cost of an impact, and memory, of rings with a body in every sector, over the number of sectors"
run = running("benchmarks.sectors.measure")
