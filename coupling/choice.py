"""What a scene leaves open about its reduced model, settled: how many modes it needs, and how stiff its contacts are.

`modes = "auto"` takes the fewest natural modes whose estimated error stays within the tolerance (rom.ladder): of the
receptance from the excitation to the response and the cavity's surfaces at the excitation frequencies, plus what a
collision's energy and duration lose, in the measure in which the bodies can change the response at all. The whole model
of the file is the measure.

A boundary without mass yields under its contact force by the flexibility G that the modes lack, u = Phi eta + G f,
while it touches and not otherwise. For one contact at a time this is a spring 1/G between body and modes, which is what
the engine runs. Left out are the boundary's motion under friction on the floor and under forces at other coordinates.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from coupling.inputs import InputError
from coupling.laws import Compliant, Massless, Newton
from coupling.scene import Rom, Scene
from rom.ladder import Choice, Collision, choose, grid, natural_ladder, rigid_errors
from rom.reduced import ReducedModel

_NEWTON = "; of the forced response alone: Newton's impacts have no limit as modes grow, compliant contacts have"


#: the choice of a number of modes by file, `modes` and tolerance
Choices = Mapping[tuple[Any, ...], Choice]


class Settled(NamedTuple):
    """A scene without open choices, and the estimate of the model chosen (None if there was no choice)."""

    scene: Scene
    estimate: dict[str, Any] | None


def settle(scene: Scene) -> Settled:
    """The scene with its number of modes and its contact stiffness. Raises InputError when there is no good choice."""
    return settle_all([scene])[0]


def settle_all(scenes: Sequence[Scene]) -> list[Settled]:
    """The same for the points of a sweep: those with one model and tolerance share the choice that suits them all."""
    choices = choices_of(scenes)
    return [settled(scene, choices) for scene in scenes]


def choices_of(scenes: Iterable[Scene]) -> Choices:
    """The number of modes that suits all scenes with one model and tolerance, for each of these."""
    groups: dict[tuple[Any, ...], list[Scene]] = {}
    for scene in scenes:
        if isinstance(scene.structure, Rom) and scene.structure.modes == "auto":
            groups.setdefault(_group(scene), []).append(scene)
    return {key: _choice(members) for key, members in groups.items()}


def kept(structure: Rom) -> int | None:
    """The number of modes of a structure that has been settled."""
    assert structure.modes != "auto"
    return structure.modes


def file_stamp(file: str) -> int:
    """Tells a file from a later one of that name."""
    path = Path(file)
    return path.stat().st_mtime_ns if path.is_file() else 0


@lru_cache(maxsize=8)
def restricted(file: str, _stamp: int, modes: int | None, natural: bool) -> ReducedModel:
    """The reduced model of a file with so many of its modes."""
    model = ReducedModel.load(file)
    if modes is None:
        return model
    return model.massless(modes) if natural else model.truncated(modes)


def is_open(scene: Scene) -> bool:
    """Whether a scene leaves something to settle."""
    return isinstance(scene.structure, Rom) and (scene.structure.modes == "auto" or _wants_residual(scene))


def _wants_residual(scene: Scene) -> bool:
    return isinstance(scene.contact, Massless) or (isinstance(scene.contact, Compliant) and scene.contact.residual)


def _group(scene: Scene) -> tuple[Any, ...]:
    structure = scene.structure
    return (structure.file, structure.modes, structure.tolerance) if isinstance(structure, Rom) else ()


def settled(scene: Scene, choices: Choices) -> Settled:
    """The scene with the choice that was made for it."""
    structure, choice = scene.structure, choices.get(_group(scene))
    if not isinstance(structure, Rom) or not is_open(scene):
        return Settled(scene, None)
    if choice is not None:
        structure = replace(structure, modes=choice.chosen.modes, natural=True)
    contact = scene.contact
    if _wants_residual(scene):
        model = restricted(structure.file, file_stamp(structure.file), kept(structure), structure.natural)
        contact = Compliant(_series(scene, model))
    estimate = None if choice is None else choice.to_json() | {"stiffness": getattr(contact, "stiffness", None)}
    return Settled(replace(scene, structure=structure, contact=contact), estimate)


def _choice(scenes: Sequence[Scene]) -> Choice:
    """The fewest natural modes for all of these scenes, which have one model."""
    first = scenes[0]
    structure, at = first.structure, first.excitation.at
    assert isinstance(structure, Rom) and at is not None
    model = restricted(structure.file, file_stamp(structure.file), None, False)
    labels = list(dict.fromkeys([at, *(label for scene in scenes for label in _surfaces(scene))]))
    for label in labels:
        if label not in model.interface:
            raise InputError(f"structure: no interface label '{label}'; it has {', '.join(model.interface)}")
    driven = [scene.excitation.frequency for scene in scenes]
    frequencies = grid(model, min(driven), max(driven))

    def collisions(smaller: ReducedModel) -> list[Collision]:
        made = {}
        for scene in scenes:
            if isinstance(scene.contact, Newton):
                continue
            stiffness = _series(scene, smaller)
            for damper in scene.damper:
                walls = tuple(_walls(scene, damper.cavity))
                made[walls, damper.mass, stiffness] = Collision(walls, damper.mass, stiffness, damper.restitution)
        return list(made.values())

    rungs = natural_ladder(model, frequencies, labels, [at], collisions, any(map(_wants_residual, scenes)))
    share = max(_influence(scene, model, frequencies) for scene in scenes)
    rungs = [replace(rung, collision=min(share, 1.0) * rung.collision) for rung in rungs]
    rigid = float(rigid_errors(model, frequencies, at, labels, [at]).max())
    choice = choose(rungs, structure.tolerance, rigid)
    if not choice.met:
        raise InputError(f"structure.modes: {choice.sentence}: raise structure.tolerance or reduce with more modes")
    if any(isinstance(scene.contact, Newton) for scene in scenes):
        choice = replace(choice, sentence=choice.sentence + _NEWTON)
    return choice


def _influence(scene: Scene, model: ReducedModel, frequencies: np.ndarray) -> float:
    """How much the bodies can change the response: between loose and glued to their floors, relative to the larger."""
    at = str(scene.excitation.at)
    floors = {cavity.name: cavity.labels()[2] for cavity in scene.cavity}
    mass = np.array(model.mass)
    for damper in scene.damper:
        row = model.row(str(floors[damper.cavity]))
        mass += damper.mass * np.outer(row, row)
    loose, glued = (item.frf(frequencies, at, at) for item in (model, replace(model, mass=mass)))
    return float((np.abs(glued - loose) / np.maximum(np.abs(loose), np.abs(glued))).max())


def _series(scene: Scene, model: ReducedModel) -> float:
    """Stiffness of the walls' mean residual flexibility in series with the law's own spring, N/m."""
    walls = list(dict.fromkeys(label for damper in scene.damper for label in _walls(scene, damper.cavity)))
    residual = model.residual_flexibility
    indices = [model.interface.index(label) for label in walls]
    lost = 0.0
    if residual is not None and walls and _wants_residual(scene):
        lost = float(np.mean(np.diag(residual)[indices]))
    own = scene.contact.stiffness if isinstance(scene.contact, Compliant) else None
    flexibility = lost + (0.0 if own is None else 1.0 / own)
    if flexibility <= 0.0:
        raise InputError(
            "contact: the reduced model lacks no flexibility at the walls; take structure.natural = true with modes, "
            "or a model of basis macneal or massless"
        )
    return 1.0 / flexibility


def _walls(scene: Scene, cavity: str) -> list[str]:
    found = next(item for item in scene.cavity if item.name == cavity)
    return [label for label in found.labels()[:2] if label is not None]


def _surfaces(scene: Scene) -> list[str]:
    return [label for cavity in scene.cavity for label in cavity.labels() if label is not None]
