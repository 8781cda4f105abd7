"""What a newcomer reads and what a command costs, against the figures in the file beside this one."""

from __future__ import annotations

import dataclasses
import sys
import tomllib
from collections.abc import Callable
from pathlib import Path
from types import CodeType
from typing import Any

import numpy as np
import pytest

import vanedamp as vd
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.system.assembly import assemble

ROOT = Path(__file__).parents[2]
FIGURES = tomllib.loads(Path(__file__).with_name("figures.toml").read_text(encoding="utf-8"))
NUMBERS = (
    "damper.0.mass", "cavity.c1.gap", "excitation.frequency", "damper.0.friction", "damper.0.restitution",
    "damper.0.velocity", "excitation.resonance_amplitude", "structure.mass", "structure.stiffness",
    "structure.damping_ratio",
)  # fmt: skip


@pytest.mark.parametrize("folder", FIGURES["bytes"])
def test_a_folder_has_as_many_bytes_as_are_said(folder: str) -> None:
    size = sum(path.stat().st_size for path in (ROOT / folder).rglob("*.py"))
    most = FIGURES["bytes"][folder]
    assert 0.99 * most <= size <= most, f"{folder}: {size} bytes"


@pytest.fixture(scope="module")
def scene() -> Scene:
    """A scene that has been run before: what is compiled is."""
    given = Scene.load(ROOT / "docs/examples/orbits.toml").replace({"time.periods": 150, "time.transient": 100})
    found = dataclasses.replace(given, orbit=None)
    vd.simulate(found)
    return found


def _calls(command: Callable[[], Any]) -> dict[str, int]:
    """Return how often a command assembles a system and validates a scene."""
    wanted: dict[CodeType, str] = {assemble.__code__: "assemblies", Scene.__post_init__.__code__: "scenes"}
    counts = dict.fromkeys(wanted.values(), 0)

    def count(frame: Any, event: str, _: Any) -> None:
        if event == "call" and frame.f_code in wanted:
            counts[wanted[frame.f_code]] += 1

    before = sys.getprofile()
    sys.setprofile(count)
    try:
        command()
    finally:
        sys.setprofile(before)
    return counts


def test_a_run_assembles_once(scene: Scene) -> None:
    assert _calls(lambda: vd.simulate(scene)) == FIGURES["calls"]["run"]


@pytest.mark.parametrize("points", [4, 400])
def test_a_sweep_assembles_as_often_as_is_said(scene: Scene, points: int) -> None:
    swept = dataclasses.replace(scene, sweep={"excitation.frequency": list(np.linspace(2300.0, 2360.0, points))})
    assert _calls(lambda: vd.sweep(swept)) == FIGURES["calls"][f"sweep_of_{points}"]


@pytest.mark.parametrize("count", [3, 10])
def test_a_derivative_assembles_once_whatever_the_numbers(scene: Scene, count: int) -> None:
    short = scene.replace({"time.periods": 6, "time.transient": 2})
    found = _calls(lambda: vd.sensitivity(short, NUMBERS[:count]))
    assert found == FIGURES["calls"][f"derivative_by_{count}"]
