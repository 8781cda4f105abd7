"""Progress bars on a terminal."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def progress(title: str) -> Iterator[Callable[[int, int], None]]:
    """Show a progress bar on standard error with rate and time left, on a terminal only."""
    from tqdm import tqdm

    with tqdm(desc=title, disable=None, leave=False) as bar:

        def show(done: int, total: int) -> None:
            if bar.total is None:
                bar.initial = bar.n = done  # what was done before says nothing of the rate
            bar.total = total
            bar.update(done - bar.n)

        yield show
