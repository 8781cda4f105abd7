"""Load compiled functions from the disk, and compile none."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from numba.core import event


class NotCompiled(Exception):
    """The disk cache lacks a function."""


class _Refusal(event.Listener):
    """Stops a compilation before it begins."""

    def on_start(self, event: Any) -> None:
        """Refuse."""
        raise NotCompiled

    def on_end(self, event: Any) -> None:
        """Do nothing."""


@contextmanager
def loading_only() -> Iterator[None]:
    """Raise NotCompiled where a function would be compiled."""
    with event.install_listener("numba:compile", _Refusal()):
        yield
