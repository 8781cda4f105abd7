"""`vanedamp bench`: one of the benchmarks, in a checkout."""

from __future__ import annotations

from vanedamp.studies.checkout import CheckoutCommand

ORDER = 130
SUMMARY = "how fast and how exact the methods are, measured here"

add_arguments, run = CheckoutCommand("benchmarks").add_arguments, CheckoutCommand("benchmarks").run
