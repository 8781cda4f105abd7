"""Points of a sweep that differ in numbers only: run as one, in compiled code (engine.line.scenes)."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from vanedamp.coupling.engine.line.columns import Columns, columned, columns, pattern
from vanedamp.coupling.sweep.grid import Points
