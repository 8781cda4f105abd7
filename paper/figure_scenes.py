"""Scenes of the paper's figures: bodies that are cut from a bar, and curves along an engine order.

A `[bar]` (density in kg/m^3, section in m^2) is a body that fills its cavity but for the gap: a curve that is `longer`
by a fraction of its tangential length is heavier by that fraction, and its gap is less by as much as the bar is longer.
The `frequencies` of a curve along an engine order are those of its speeds.
"""

from __future__ import annotations

from typing import Any

from pydantic.dataclasses import dataclass

from vanedamp.coupling.scene.rotation import speed_of
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.structures import Rigid
from vanedamp.files.toml_input import STRICT, InputError, Positive, validate
from vanedamp.studies.demo.figure_file import FigureScenes, Frequencies, frequency_grid, linear_peaks, rigid_peaks

#: axis of a curve along an engine order
SPEED = "rotation.speed"


@dataclass(frozen=True, config=STRICT)
class Bar:
    """A bar of given density (kg/m^3) and section (m^2) whose tangential length goes with its mass."""

    density: Positive
    section: Positive

    def length(self, mass: float) -> float:
        """Return the length along the cavity, m."""
        return mass / (self.density * self.section)


class PaperScenes(FigureScenes):
    """A figure of the paper."""

    @classmethod
    def scene(cls, tables: dict[str, Any], curve: str, data: dict[str, Any]) -> Scene:
        """Return the scene of a curve from its tables, with a bar as long as it says."""
        longer = tables.pop("longer", None)
        scene = super().scene(tables, curve, data)
        return scene if longer is None else with_length(scene, validate(Bar, data["bar"], "bar"), longer)

    @classmethod
    def swept(cls, scene: Scene, frequencies: Frequencies, points: int) -> Scene:
        """Return the scene with a last axis of frequencies, or of the speeds along its engine order that have them."""
        order = scene.excitation.engine_order
        if order is None:
            return super().swept(scene, frequencies, points)
        grid = frequency_grid(scene, frequencies, order_peaks(scene), points)
        speeds = [speed_of(order, frequency) for frequency in grid]
        return scene.replace({"sweep": {**scene.to_dict()["sweep"], SPEED: speeds}})


def order_peaks(scene: Scene) -> list[float]:
    """Return the first natural frequencies with all bodies fixed and without them, Hz.

    Of a rigid structure along an engine order those where the order meets them:
    m (2 pi f)^2 = c + c1 (2 pi f / order)^2.
    """
    order, structure = scene.excitation.engine_order, scene.structure
    if order is None or not isinstance(structure, Rigid):
        return linear_peaks(scene)
    return rigid_peaks(structure.mass - structure.centrifugal_stiffness / order**2, structure.stiffness, scene)


def with_length(scene: Scene, bar: Bar, longer: float) -> Scene:
    """Return the scene with a bar longer by a fraction of its length: heavier by that fraction, the gap less.

    Of a scene with one cavity and one body. Raises InputError if it does not fit.
    """
    (cavity,), (damper,) = scene.cavity, scene.damper
    change = longer * bar.length(damper.mass)
    gap = cavity.gap - change
    if gap <= 0:
        raise InputError(f"longer: by {change:g} m, which is more than the gap of {cavity.gap:g} m")
    # a body at a wall stays there
    values = {"cavity.0.gap": gap, "damper.0.mass": damper.mass * (1 + longer)}
    if damper.length is not None:
        values["damper.0.length"] = damper.length * (1 + longer)
    return scene.replace(values | {"damper.0.position": scene.positions[0] * gap / cavity.gap})
