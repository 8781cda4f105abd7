"""Which cases of a parametrised test the fast tier runs; `make test-all` runs all."""

from collections.abc import Collection, Iterable
from typing import Any

import pytest


def cases(values: Iterable[Any], fast: Collection[Any]) -> list[Any]:
    """Parameters of a test, in tuples where they are several; those outside `fast` are slow."""
    every = list(values)
    assert all(value in every for value in fast)
    return [
        pytest.param(
            *(value if isinstance(value, tuple) else (value,)), marks=() if value in fast else pytest.mark.slow
        )
        for value in every
    ]


def seeds(count: int, fast: Collection[int]) -> list[Any]:
    """Seeds 0 to `count` - 1 of random scenes; those outside `fast` are slow."""
    return cases(range(count), fast)
