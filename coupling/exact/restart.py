"""Restart states from the engine's state, and back."""

from __future__ import annotations

from dataclasses import astuple

import numpy as np

from vanedamp.coupling.response.restart_state import Handover
from vanedamp.coupling.system.constraints import Rows, row_motion
from vanedamp.coupling.system.modal_structure import LinearStructure
from vanedamp.files.store import frozen
from vanedamp.files.toml_input import InputError


def taken(structure: LinearStructure, rows: Rows, slip: np.ndarray, speed: np.ndarray, y: np.ndarray) -> Handover:
    """The handover of a run: slips (r,) and their speeds of all rows, and y (2n,) = (p, p') of the structure."""
    b, n, scale = len(rows.mass), structure.modes, structure.physical
    return Handover(
        frozen(scale * y[:n]), frozen(scale * y[n:]), frozen(slip[:b]), frozen(speed[:b]),
        frozen(np.where(np.isfinite(rows.spring), slip, 0.0)[b : rows.friction_rows]), frozen(rows.gap),
    )  # fmt: skip


def given(structure: LinearStructure, rows: Rows, start: Handover) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(y, displacement, velocity): structure (2n,) and rows (r,) at the start of a run of another scene.

    Bodies that would stand in a wall or in each other, because the gap is smaller now, are moved to where they touch;
    springs of friction dampers are unloaded to what their sliders hold. Raises InputError for a scene of another size.
    """
    sizes = (structure.modes, structure.modes, len(rows.mass), len(rows.mass), _dampers(rows), len(rows.gap))
    found = tuple(len(array) for array in astuple(start))
    if found != sizes:
        raise InputError(
            f"continuation: a state of {found[0]} modes, {found[2]} bodies and {found[4]} friction dampers does not "
            f"fit a scene of {sizes[0]}, {sizes[2]} and {sizes[4]}"
        )
    p, rate = (array / structure.physical for array in (start.displacement, start.velocity))
    limit, spring = rows.limit[len(rows.mass) :], rows.spring[len(rows.mass) : rows.friction_rows]
    elongation = np.where(np.isfinite(spring), np.clip(start.elongation, -limit / spring, limit / spring), 0.0)
    slip = _inside(rows, start, p)
    return np.r_[p, rate], *row_motion(rows, slip, start.slip_velocity, p, rate, elongation)


def _dampers(rows: Rows) -> int:
    return rows.friction_rows - len(rows.mass)


def _inside(rows: Rows, start: Handover, p: np.ndarray) -> np.ndarray:
    """Slips (b,) of bodies inside their cavities: pushed in from the left walls, then from the right ones.

    A compliant wall stays pressed as it was if its gap is what it was.
    """
    slip, still, unloaded = np.array(start.slip), np.zeros(len(rows.mass)), np.zeros(_dampers(rows))
    pressed = np.isfinite(rows.spring[rows.friction_rows :]) & (rows.gap == start.gap)
    contacts = rows.friction_rows + np.flatnonzero(~pressed)
    for order, body, sign in ((contacts, rows.after, 1.0), (contacts[::-1], rows.before, -1.0)):
        for r in order:
            gap = row_motion(rows, slip, still, p, 0.0 * p, unloaded)[0][r]
            if gap < 0.0 and body[r] >= 0:
                slip[body[r]] -= sign * gap
    return slip
