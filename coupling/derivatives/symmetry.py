"""Symmetries of a scene: maps of its coordinates under which every motion, some time later, is a motion of it again."""

from __future__ import annotations

import math
import re
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import block_diag

from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.system.system import SURFACES, System, on_structure

#: squared frequencies of modes that a shift of sectors may mix, and the tolerance of a shift, relative
_EQUAL, _SHIFTED = 1e-6, 1e-9
#: the sector in a name or a label, such as "tip@3"
_SECTOR = re.compile(r"@(\d+)")


class Symmetry(NamedTuple):
    """With every motion x(t) also image x(t + part of a period) is one.

    image: (N, N) of coordinates; times: parts in a period.
    """

    image: np.ndarray
    part: float
    times: int


def mirror_of(system: System) -> Symmetry | None:
    """Return the symmetry x(t) -> -x(t + T/2); None for a scene without it.

    The motions of the structure and of the bodies along their cavities change sign, bodies in reversed order.
    """
    image = -np.eye(len(system.mass))
    for index in set(system.cavity.tolist()):
        row = np.flatnonzero(system.cavity == index)
        for b, partner in zip(row, row[::-1], strict=True):
            x, y = system.along[b], system.along[partner]
            extended = system.tilt[b] >= 0
            if extended != (system.tilt[partner] >= 0):
                return None
            image[x : x + 1 + 2 * extended] = 0.0
            image[x, y] = -1.0
            if extended:
                image[x + 1, y + 1], image[x + 2, y + 2] = 1.0, -1.0
    return Symmetry(image, 0.5, 2) if _keeps(system, image, 0.5, -1.0, 1e-12) else None


def wave_of(scene: Scene, system: System) -> Symmetry | None:
    """Return the symmetry of a travelling wave: each sector repeats another, a part of a period later.

    Of a ring whose cavities and tables of the structure name labels such as "tip@sector" and are alike in M sectors, in
    equal steps, under loads that lag by 2 pi m/M from one to the next: with g the greatest common divisor of M and m,
    the part of the period is g/M, and the motion of sector j then was that of sector j - s, s m = g modulo M. None
    without that symmetry.
    """
    after = _next_sector(scene, system)
    if after is None:
        return None
    bodies, units, sectors = after
    for m in range(1, sectors):
        image = _shift(system, bodies, units, m / sectors)
        if _keeps(system, image, m / sectors, 1.0, _SHIFTED):
            g = math.gcd(m, sectors)
            steps = next(s for s in range(1, sectors) if s * m % sectors == g and math.gcd(s, sectors) == 1)
            return Symmetry(np.linalg.matrix_power(image, steps), g / sectors, sectors // g)
    return None


def _next_sector(scene: Scene, system: System) -> tuple[list[int], list[int], int] | None:
    """Return each body's (b,) and each unit's (u,) counterpart in the next sector with some, and their number.

    Tables have one that reads alike but for the sectors in its names and labels.
    """
    tables = {"cavity": scene.cavity, "casing": scene.friction_damper} | scene.element_tables
    read = {name: [repr(entry) for entry in entries] for name, entries in tables.items()}
    sectors = sorted({int(at) for texts in read.values() for text in texts for at in _SECTOR.findall(text)})
    count = len(sectors)
    if len(set(np.diff(sectors))) != 1:
        return None
    for step in (step for step in range(1, count) if count % step == 0):
        there = {str(at): f"@{sectors[(place + step) % count]}" for place, at in enumerate(sectors)}
        turned = {name: [_SECTOR.sub(partial(_turned, there), text) for text in texts] for name, texts in read.items()}
        if not all(set(texts) <= set(read[name]) for name, texts in turned.items()):
            continue
        after = {name: [read[name].index(text) for text in texts] for name, texts in turned.items()}
        bodies = _following(system.cavity.tolist(), [after["cavity"][index] for index in system.cavity])
        if bodies is None:
            return None
        kinds, alone = [SURFACES[code] for code in system.surface], system.without_body
        owners = list(zip(kinds, system.body.tolist(), strict=True))
        units = _following(owners, [(kind, (after[kind] if free and kind in after else bodies)[number])
                                    for (kind, number), free in zip(owners, alone, strict=True)])  # fmt: skip
        return None if units is None else (bodies, units, count // step)
    return None


def _turned(there: dict[str, str], at: re.Match[str]) -> str:
    return there[at[1]]


def _following(of: list[Any], after: list[Any]) -> list[int] | None:
    """Return for things of owners the places of those alike of other owners, in order; None where they lack some."""
    places: dict[Any, list[int]] = {}
    order = []
    for place, owner in enumerate(of):
        order.append(len(places.setdefault(owner, [])))
        places[owner].append(place)
    if any(len(places.get(there, ())) != len(places[owner]) for owner, there in zip(of, after, strict=True)):
        return None
    return [places[there][number] for there, number in zip(after, order, strict=True)]


def _shift(system: System, bodies: list[int], units: list[int], part: float) -> np.ndarray:
    """Return the orthogonal map (N, N) that shifts each sector to the one before, as far as possible.

    bodies, units: those in the next sector. Among modes of one frequency the rows of the units and the loads, which
    turn by a part of a period, decide (Procrustes).
    """
    n, load = system.modes, system.load[:, : system.modes]
    turned = load * np.exp(2j * np.pi * part * system.order)[:, None]
    size = np.abs(load).max() or 1.0
    rows = on_structure(system).J[:, :n].reshape(2, -1, n)
    later = rows[:, units].reshape(-1, n)
    rows = rows.reshape(-1, n)
    reach = np.abs(rows).max() / size
    now = np.vstack([rows, reach * load.real, reach * load.imag])
    then = np.vstack([later, reach * turned.real, reach * turned.imag])
    order = np.argsort(system.squares, kind="stable")
    squares, image = system.squares[order], np.zeros((len(system.mass), len(system.mass)))
    for group in np.split(order, np.flatnonzero(np.diff(squares) > _EQUAL * squares[1:]) + 1):
        u, _, v = np.linalg.svd(now[:, group].T @ then[:, group])
        image[np.ix_(group, group)] = u @ v
    for b, other in enumerate(bodies):
        for part_of_body in range(3 if system.tilt[b] >= 0 else 1):
            image[system.along[b] + part_of_body, system.along[other] + part_of_body] = 1.0
    first = len(image) - len(system.tangential)
    for unit in system.sprung:
        image[first + system.slider[unit], first + system.slider[units[unit]]] = 1.0
    return image


def _keeps(system: System, image: np.ndarray, part: float, sign: float, tolerance: float) -> bool:
    """Whether an orthogonal map takes the scene to itself, a part of a period later; sign: of a prescribed base."""

    def same(a: np.ndarray, b: np.ndarray) -> bool:  # numpy's takes longer than all else here
        least = 1e-2 * tolerance * np.abs(a).max(initial=0.0)
        return bool((np.abs(a - b) <= tolerance * np.abs(b) + least).all())

    phase = np.exp(2j * np.pi * part * system.order)
    if not (
        same(image.T @ np.diag(system.mass) @ image, np.diag(system.mass))
        and same(image.T @ system.stiffness @ image, system.stiffness)
        and same(image.T @ system.damping @ image, system.damping)
        # constant loads may cancel, but for round-off
        and same(
            np.vstack([system.load * phase[:, None], system.weight]) @ image.T, np.vstack([system.load, system.weight])
        )
        and same(sign * system.table * phase, system.table)
    ):
        return False
    u, spring = len(system.rest), np.zeros(len(system.rest))
    spring[system.sprung] = system.tangential
    kinds = np.column_stack(
        [system.friction, spring, np.nan_to_num(system.limit, posinf=-1.0), system.restitution, system.dashpot,
         np.nan_to_num(system.spring, posinf=-1.0), np.nan_to_num(system.rest)]
    )  # fmt: skip
    normal, slip = system.J[:u], np.hstack([system.J[u:], on_structure(system).J[u:]])
    image_of_slip = block_diag(image, image)
    return all(
        any(
            same(normal[r], normal[o] @ image.T) and same(kinds[r], kinds[o])
            and (same(slip[r], -slip[o] @ image_of_slip.T) or same(slip[r], slip[o] @ image_of_slip.T))
            for o in range(u)
        )
        for r in range(u)
    )  # fmt: skip
