"""Reduced models of rings by sectors, shown like those by modes."""

from __future__ import annotations

from vanedamp.studies.kinds.ring_model.page import __file__ as TEMPLATE
from vanedamp.studies.kinds.ring_model.page import figure, shown

__all__ = ["ORDER", "TEMPLATE", "figure", "shown"]

ORDER = 32
