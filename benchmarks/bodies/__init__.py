"""Bodies: the block beside the slider, their responses and what they cost."""

from benchmarks import running

NAME = "bodies"
ORDER = 35
SUMMARY = "a block that tilts and lifts beside the slider: responses, tilts, cost; its error and cost by each method"
run = running("benchmarks.bodies.measure", "benchmarks.bodies.methods")
