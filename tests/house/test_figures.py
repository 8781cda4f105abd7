"""What a newcomer reads and what a command costs, against the figures in the file beside this one."""

from __future__ import annotations

import dataclasses
import sys
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import vanedamp as vd
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.sweep import alike
from vanedamp.coupling.system.assembly import assemble
from vanedamp.files.toml_input import validate

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


def _assemblies(command: Callable[[], Any]) -> int:
    """Return how often a command assembles a system."""
    found = 0

    def count(frame: Any, event: str, _: Any) -> None:
        nonlocal found
        found += event == "call" and frame.f_code is assemble.__code__

    before = sys.getprofile()
    sys.setprofile(count)
    try:
        command()
    finally:
        sys.setprofile(before)
    return found


def test_a_run_assembles_once(scene: Scene) -> None:
    assert _assemblies(lambda: vd.simulate(scene)) == FIGURES["assemblies"]["run"]


@pytest.mark.parametrize("points", [4, 400])
def test_a_sweep_assembles_once_a_kind_and_for_its_references(scene: Scene, points: int) -> None:
    alike._KEPT.kinds.clear()
    swept = dataclasses.replace(scene, sweep={"excitation.frequency": list(np.linspace(2300.0, 2360.0, points))})
    assert _assemblies(lambda: vd.sweep(swept)) == FIGURES["assemblies"][f"sweep_of_{points}"]


@pytest.mark.parametrize("count", [3, 10])
def test_a_derivative_assembles_the_scene_and_its_tangents(scene: Scene, count: int) -> None:
    short = scene.replace({"time.periods": 6, "time.transient": 2})
    found = _assemblies(lambda: vd.sensitivity(short, NUMBERS[:count]))
    assert found == FIGURES["assemblies"][f"derivative_by_{count}"]


def test_so_does_the_derivative_of_an_orbit(scene: Scene) -> None:
    orbit = vd.find_orbit(scene)
    found = _assemblies(lambda: vd.sensitivity(orbit, NUMBERS[:3]))
    assert found == FIGURES["assemblies"]["derivative_of_orbit"]


def test_a_ramp_assembles_as_often_as_is_said(scene: Scene) -> None:
    table = {"from": 2300.0, "to": 2302.0, "periods": 100}
    ramped = validate(Scene, scene.to_dict() | {"ramp": table}, "scene")
    assert _assemblies(lambda: vd.ramp(ramped)) == FIGURES["assemblies"]["ramp_of_100"]
