"""`vanedamp paper`: the paper's figures as studies, in a checkout."""

from __future__ import annotations

from vanedamp.studies.checkout import CheckoutCommand

ORDER = 110
SUMMARY = "the paper's figures as studies, each claim with a verdict"

add_arguments, run = CheckoutCommand("paper").add_arguments, CheckoutCommand("paper").run
