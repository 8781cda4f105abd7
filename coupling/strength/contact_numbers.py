"""Numbers of the contacts of a file, or of a scene: stiffness, yield, restitution versus the speed of approach."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from pydantic.dataclasses import dataclass

from vanedamp.coupling.contacts.numbers import ContactNumbers, contact_numbers
from vanedamp.coupling.contacts.pair import Pair
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.system.assembly import assemble
from vanedamp.coupling.system.system import SURFACES
from vanedamp.files.toml_input import STRICT, InputError, Positive, read_toml, validate


@dataclass(frozen=True, config=STRICT)
class ContactFile:
    """A pair on its own, for `vanedamp contact`."""

    pair: Pair
    """shapes and materials of what touches"""
    mass: Positive
    """reduced mass of the collision, 1/(1/m1 + 1/m2) [kg]"""
    speeds: tuple[Positive, Positive] | None = None
    """lowest and highest speed of approach (default: 0.1 to 300 times first yield's, else 0.01 to 10) [m/s]"""
    preload: Positive | None = None
    """force at which the tangent stiffness is wanted [N]"""

    def __post_init__(self) -> None:
        if self.speeds is not None and not self.speeds[0] < self.speeds[1]:
            raise ValueError(f"speeds: expected the lower one first, not [{self.speeds[0]:g}, {self.speeds[1]:g}]")


def contact(
    source: Scene | str | Path | Pair, mass: float | None = None, speeds: tuple[float, float] | None = None,
    preload: float | None = None,
) -> tuple[ContactNumbers, ...]:  # fmt: skip
    """Return the numbers of contacts: one for each body of a scene and wall that it meets, else one.

    source: a scene with [contact.pair], or its file, a file of a pair on its own ([pair] and mass), or a `Pair`.
    mass: kg, reduced, of a `Pair` only; speeds: lowest and highest speed of approach, m/s; preload: N.
    Raises InputError.
    """
    if isinstance(source, Pair):
        if mass is None:
            raise InputError("mass: give the reduced mass of the collision, kg")
        return (contact_numbers(source, mass, speeds, preload),)
    if not isinstance(source, Scene):
        data = read_toml(source)
        if "pair" in data:
            return _of_file(validate(ContactFile, data, str(source)), str(source), speeds, preload)
        scene, name = Scene.of(data, source), str(source)
    else:
        scene, name = source, "scene"
    return _of_scene(scene, name, speeds, preload)


def _of_file(
    file: ContactFile, name: str, speeds: tuple[float, float] | None, preload: float | None
) -> tuple[ContactNumbers, ...]:
    try:
        return (contact_numbers(file.pair, file.mass, speeds or file.speeds, preload or file.preload, Path(name).stem),)
    except InputError as error:
        raise InputError(f"{name}: {error}") from None


def _of_scene(
    scene: Scene, name: str, speeds: tuple[float, float] | None, preload: float | None
) -> tuple[ContactNumbers, ...]:
    """Return the numbers of a scene's contacts of bodies with walls, alike ones once."""
    pair = scene.contact.pair
    if pair is None:
        raise InputError(f"{name}: contact.pair: missing; give young and radius, or length and area, of what touches")
    by_pair: dict[tuple[float, float], ContactNumbers] = {}
    for label, reduced, stiffness in _walls(scene):
        if (reduced, stiffness) in by_pair:
            continue
        try:
            numbers = contact_numbers(pair, reduced, speeds, preload, label)
        except InputError as error:
            raise InputError(f"{name}: contact.{error}") from None
        if numbers.patch is not None and scene.contact.takes_residual_flexibility:
            wall = 1 / stiffness - scene.contact.flexibility(reduced)
            numbers.patch.update({"wall_flexibility": wall, "stiffness": stiffness})
        by_pair[reduced, stiffness] = numbers
    if not by_pair:
        raise InputError(f"{name}: damper: no body meets a wall; a contact is that of a body")
    return tuple(by_pair.values())


def _walls(scene: Scene) -> list[tuple[str, float, float]]:
    """Return name, reduced mass with the structure's first mode, kg, and stiffness, N/m, of contacts with walls."""
    system = assemble(scene)
    mobility: Any = system.J[: system.contacts] ** 2 / system.mass
    mobility[:, 1 : system.modes] = 0.0
    rows = np.flatnonzero(~system.without_body[: system.contacts] & (system.other[: system.contacts] < 0))
    return [
        (
            f"damper[{system.body[row]}] {SURFACES[system.surface[row]]}",
            float(1 / mobility[row].sum()),
            float(system.spring[row]),
        )
        for row in rows
    ]
