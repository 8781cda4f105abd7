"""Model order: the ladder, and trials of the automatic choice."""

from benchmarks import running

NAME = "ladder"
ORDER = 40
SUMMARY = "contact laws and numbers of modes of reduced models, sliders and blocks, and their choice"
run = running("benchmarks.model_order.measure")
