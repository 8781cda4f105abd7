"""Sliders as they are drawn: the samples that a run of bodies with one coordinate has for a drawing in the plane."""

from __future__ import annotations

import numpy as np

from vanedamp.coupling.response.response import PlanarSamples
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.system.assembly import assemble

#: share of its free travel within which a body touches
_TOUCHES = 1e-9


def slider_samples(scene: Scene, displacement: np.ndarray, along: np.ndarray) -> PlanarSamples:
    """Return the samples of sliders between walls that keep their places on the floor.

    scene: without open choices; displacement: (n,) m at excitation.at; along: (n, b) m in the cavities. A floor that
    is another point of a reduced model moves as in the mode nearest to the excitation.
    """
    unknown = np.full(along.shape, np.nan)
    gaps, closed, contacts = [], [], []
    for cavity in scene.cavity:
        row = [k for k, damper in enumerate(scene.damper) if damper.cavity == cavity.name]
        if not row:
            continue
        places = np.column_stack(
            [np.full(len(along), -cavity.gap / 2), along[:, row], np.full(len(along), cavity.gap / 2)]
        )
        sides = [(row[0], "left", -1), *((k, "body", -1) for k in row[:-1]), (row[-1], "right", -1)]
        gaps.append(np.diff(places, axis=1))
        closed.append(gaps[-1] <= _TOUCHES * cavity.gap)
        contacts += sides
    return PlanarSamples(
        body_lift=unknown, body_tilt=unknown, floor_along=np.multiply.outer(displacement, _floor_shares(scene)),
        floor_across=unknown, floor_rotation=np.zeros(along.shape), contact_gap=np.hstack(gaps),
        contact_closed=np.hstack(closed), contacts=tuple(contacts),
    )  # fmt: skip


def _floor_shares(scene: Scene) -> np.ndarray:
    """Return by how much the floor under each body (b,) moves when the response moves by one."""
    system = assemble(scene)
    if not system.modes:  # the base moves, and all on it
        return np.ones(system.bodies)
    nearest = int(np.argmin(np.abs(np.sqrt(system.of_structure.stiffness) - system.omega)))
    at = system.of_structure.response[nearest]
    return np.asarray(system.floor[:, nearest]) / at if at else np.zeros(system.bodies)
