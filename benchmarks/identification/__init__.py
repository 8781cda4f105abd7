"""Numbers of a scene from measurements whose truth is known."""

from benchmarks import running

ORDER = 75
SUMMARY = "numbers from measurements whose truth is known: recovery, intervals, runs, wrong models"
run = running("benchmarks.identification.measure")
