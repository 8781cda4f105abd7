"""Motion of a cavity's surfaces: walls, floor and ceiling, each as its best rigid motion in the plane.

A point at the height y above the floor moves along the cavity by u - theta y, u the floor's motion and theta the
cavity's rotation: the motion of a rotating cavity at a body depends on the height of its centre.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.shapes.shape import CEILING, FLOOR, SIDES
from vanedamp.coupling.system.cavities import surface_labels
from vanedamp.coupling.system.modal_basis import ModalBasis, interface_row
from vanedamp.coupling.tangents.dual import array, scalar, values, zeros
from vanedamp.files.toml_input import InputError
from vanedamp.rom.reduced import NORMAL, ROTATION


class Surface(NamedTuple):
    """Motion (n,) of a surface of a cavity, along and across at (x, y) of it, and its rotation.

    x, y: m, from the middle of the floor, along and across; None: the contact's, wherever the surface is.
    """

    along: np.ndarray
    across: np.ndarray
    turn: np.ndarray
    x: float | None = 0.0
    y: float | None = 0.0
    labels: tuple[str, str, str] = ("", "", "")  # interface coordinates of these three motions; "": none

    def motion(self, x: float, y: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the motion along and across, (n,) each, of the surface's point (x, y)."""
        along = self.along if self.y is None else self.along - self.turn * (y - self.y)
        return along, self.across if self.x is None else self.across + self.turn * (x - self.x)


def heights(scene: Scene) -> np.ndarray:
    """Return the height (b,) of each body's centre above its floor, m; 0 of sliders without one.

    Sliders in one cavity have the mean of their heights by mass: two that touch and are nowhere held move freely
    of the structure only if it moves them alike.
    """
    height = array([damper.half_extent[1] for damper in scene.damper])
    mass = array([damper.mass for damper in scene.damper])
    for cavity in scene.cavity:
        row = np.array([k for k in scene.bodies_in(cavity) if not scene.damper[k].form.planar], int)
        known = row[values(height)[row] > 0.0]
        if known.size:
            height[row] = (mass[known] @ height[known]) / mass[known].sum()
    return height


def surfaces_of(scene: Scene, basis: ModalBasis, index: int) -> tuple[Surface, ...]:
    """Return left wall, right wall, floor and ceiling of a cavity; a rigid structure's one mode moves them alike.

    A surface whose label has no coordinates across and of rotation moves as the floor's rigid motion has it. Raises
    InputError for unknown labels, and for a rotation that is given twice or whose position is unknown.
    """
    cavity, (left, right, below) = scene.cavity[index], surface_labels(scene, index)
    labels, key = (left, right, below, cavity.ceiling or below), f"cavity[{index}]"
    rows = [interface_row(basis, label, f"{key}.{SIDES[side]}") for side, label in enumerate(labels)]
    floor = rows[FLOOR]
    for suffix, name in ((NORMAL, "normal_motion"), (ROTATION, "rotation")):
        if below + suffix in basis.rows and getattr(cavity, name):
            raise InputError(f"{key}.{name}: the reduced model has '{below}{suffix}', which gives it; leave it out")
    none = zeros(len(basis.stiffness))
    across = basis.rows.get(below + NORMAL, cavity.normal_motion * floor) + none
    turn = basis.rows.get(below + ROTATION, cavity.rotation * floor) + none
    places = _places(basis, labels)
    x_floor = 0.0 if places is None else places[FLOOR][0]
    surfaces = []
    for side, label in enumerate(labels):
        x: float | None
        y: float | None
        x, y = (0.0, 0.0) if places is None else places[side]
        has_normal = label != below and label + NORMAL in basis.rows
        if label != below and label + ROTATION in basis.rows and (places is None or not has_normal):
            raise InputError(
                f"{key}.{SIDES[side]}: '{label}' has a rotation, but '{label}' or '{below}' lacks its place or its "
                'motion across; take kind = "patch" for both'
            )
        if not has_normal:
            x = x_floor
        elif side != CEILING:
            x = None  # a wall is touched on its plane, and a ceiling, wherever they are
        if side == CEILING and label != below:
            y = None
        moves_across = basis.rows[label + NORMAL] if has_normal else across
        names = (
            label,
            (label if has_normal else below) + NORMAL,
            (label if label + ROTATION in basis.rows else below) + ROTATION,
        )
        first, second, third = (name if name in basis.rows else "" for name in names)
        turns = basis.rows.get(label + ROTATION, turn)
        surfaces.append(Surface(rows[side], moves_across, turns, x, y, (first, second, third)))
    return tuple(surfaces)


def walls_and_floor(scene: Scene, basis: ModalBasis, index: int) -> tuple[Surface, ...]:
    """Return the surfaces of a cavity by their motion along it only, for bodies without a height."""
    left, right, below = surface_labels(scene, index)
    none = zeros(len(basis.stiffness))
    rows = [
        interface_row(basis, label, f"cavity[{index}].{side}")
        for label, side in zip((left, right, below), SIDES, strict=False)
    ]
    labels = (left, right, below, below)
    return tuple(
        Surface(row, none, none, labels=(label, "", "")) for row, label in zip([*rows, rows[2]], labels, strict=True)
    )


def _places(basis: ModalBasis, labels: tuple[str, ...]) -> list[tuple[float, float]] | None:
    """Return the positions (x, y) of a cavity's surfaces, m from the middle of the floor; None where these are unknown.

    labels: of left wall, right wall, floor and ceiling.
    """
    left, right, floor, _ = labels
    across, along, at = basis.across(floor), basis.directions[floor], basis.positions
    if across is None or not all(label in at for label in labels):
        return None
    middle = at[floor] if floor in (left, right) else 0.5 * (at[left] + at[right])
    return [(scalar((at[label] - middle) @ along), scalar((at[label] - at[floor]) @ across)) for label in labels]


def flexibility(basis: ModalBasis, surface: Surface, is_wall: bool, lever: float = 0.0) -> float:
    """Return the residual flexibility, m/N, of a surface against a force on it; lever: m, that turns it."""
    moves, turns = surface.labels[0 if is_wall else 1], surface.labels[2]
    shares = {moves: 1.0} | ({turns: lever} if turns else {})
    return basis.flexibility(shares) if moves else 0.0
