"""Symmetries of a scene: maps of its coordinates under which every motion, some time later, is a motion of it again."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag

from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.system.system import System

#: squared frequencies of modes that a shift of sectors may mix, and the tolerance of a shift, relative
_EQUAL, _SHIFTED = 1e-6, 1e-9


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

    Of a ring whose cavities "name@sector" are alike in M sectors, in equal steps, under loads that lag by 2 pi m/M from
    one to the next: with g the greatest common divisor of M and m, the part of the period is g/M, and the motion of
    sector j then was that of sector j - s, s m = g modulo M. None without that symmetry.
    """
    after = _next_sector(scene, system)
    if after is None or len(system.tangential):
        return None
    bodies, sectors = after
    for m in range(1, sectors):
        image = _shift(system, bodies, m / sectors)
        if _keeps(system, image, m / sectors, 1.0, _SHIFTED):
            g = math.gcd(m, sectors)
            steps = next(s for s in range(1, sectors) if s * m % sectors == g and math.gcd(s, sectors) == 1)
            return Symmetry(np.linalg.matrix_power(image, steps), g / sectors, sectors // g)
    return None


def _next_sector(scene: Scene, system: System) -> tuple[np.ndarray, int] | None:
    """Return each body's (b,) counterpart in the next sector with bodies, and the number of such sectors."""
    named = [scene.cavity[index].name.rpartition("@") for index in system.cavity]
    if not named or not all(at and sector.isdecimal() for _, at, sector in named):
        return None
    sectors = sorted({int(sector) for _, _, sector in named})
    if len(sectors) < 2 or len(set(np.diff(sectors))) > 1:
        return None
    places = {}
    for b, (name, _, sector) in enumerate(named):
        earlier = np.count_nonzero(system.cavity[:b] == system.cavity[b])
        places[name, int(earlier), sectors.index(int(sector))] = b
    following = {key: places.get((*key[:2], (key[2] + 1) % len(sectors))) for key in places}
    if None in following.values():
        return None
    after = np.zeros(len(named), int)
    for key, b in places.items():
        after[b] = following[key]
    return after, len(sectors)


def _shift(system: System, after: np.ndarray, part: float) -> np.ndarray:
    """Return the orthogonal map (N, N) that shifts each sector to the one before, as far as possible.

    Among modes of one frequency the floors and the loads, which turn by a part of a period, decide (Procrustes).
    """
    n, load = system.modes, system.load[:, : system.modes]
    turned = load * np.exp(2j * np.pi * part * system.order)[:, None]
    size = np.abs(load).max() or 1.0
    floors = np.vstack([system.floor, system.rise, system.turn])[:, :n]
    later = np.vstack([system.floor[after], system.rise[after], system.turn[after]])[:, :n]
    reach = np.abs(floors).max() / size
    now = np.vstack([floors, reach * load.real, reach * load.imag])
    then = np.vstack([later, reach * turned.real, reach * turned.imag])
    order = np.argsort(system.squares, kind="stable")
    squares, modal = system.squares[order], np.zeros((n, n))
    for group in np.split(order, np.flatnonzero(np.diff(squares) > _EQUAL * squares[1:]) + 1):
        u, _, v = np.linalg.svd(now[:, group].T @ then[:, group])
        modal[np.ix_(group, group)] = u @ v
    image = block_diag(modal, np.zeros((len(system.mass) - n, len(system.mass) - n)))
    for b, other in enumerate(after):
        for part_of_body in range(3 if system.tilt[b] >= 0 else 1):
            image[system.along[b] + part_of_body, system.along[other] + part_of_body] = 1.0
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
        and same(system.load * phase[:, None] @ image.T, system.load)
        and same(sign * system.table * phase, system.table)
        and same(system.weight @ image.T, system.weight)
    ):
        return False
    u = len(system.rest)
    kinds = np.column_stack(
        [system.friction, np.nan_to_num(system.limit, posinf=-1.0), system.restitution, system.dashpot,
         np.nan_to_num(system.spring, posinf=-1.0), np.nan_to_num(system.rest), np.nan_to_num(system.play, posinf=-1.0)]
    )  # fmt: skip
    normal, slip = system.J[:u], system.J[u:]
    return all(
        any(
            same(normal[r], normal[o] @ image.T) and same(kinds[r], kinds[o])
            and (same(slip[r], -slip[o] @ image.T) or same(slip[r], slip[o] @ image.T))
            for o in range(u)
        )
        for r in range(u)
    )  # fmt: skip
