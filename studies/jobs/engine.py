"""The engine that scenes need, compiled before the clock of a progress starts."""

from __future__ import annotations

from collections.abc import Iterable
from concurrent.futures import BrokenExecutor, Executor
from contextlib import suppress

from vanedamp.coupling.model_order.choices import leaves_open
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.sweep.sweep import warm_up
from vanedamp.studies.terminal import stage


def compile_engine(scenes: Iterable[Scene], pool: Executor | None = None) -> None:
    """Compile the engine that scenes need, which a progress that begins afterwards does not count.

    Scenes with open choices are left out, since the choices decide what is compiled.
    """
    title = "load the engine; the first time it is compiled, which takes a minute or two"
    with stage(title), suppress(BrokenExecutor):  # a scene that ends its worker is reported when it runs
        for scene in scenes:
            if leaves_open(scene):
                continue
            if pool is None:
                warm_up(scene)
            else:
                pool.submit(warm_up, scene).result()
