"""Where methods fail."""

from benchmarks import running

ORDER = 60
SUMMARY = "where methods fail"
run = running("benchmarks.stability.limits")
