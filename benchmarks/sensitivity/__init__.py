"""What derivatives by numbers of a scene cost."""

from benchmarks import running

ORDER = 67
SUMMARY = "a passage with its derivatives by ten numbers of the scene against the passage without"
run = running("benchmarks.sensitivity.measure")
