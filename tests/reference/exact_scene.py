"""A scene with its numbers in 40 digits, some of them changed: what FixedSequence reads of a Scene, computed anew."""

from __future__ import annotations

from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any

import mpmath as mp

from vanedamp.coupling.scene.contact_laws.compliant import damping_ratio
from vanedamp.coupling.scene.paths import assign
from vanedamp.coupling.scene.scene import Scene


class _Table(SimpleNamespace):
    """A table of a scene; what it does not hold is None."""

    def __getattr__(self, name: str) -> None:
        return None


def exact_scene(scene: Scene, changes: Mapping[str, mp.mpf]) -> SimpleNamespace:
    """Return a scene of sliders without rotation, with numbers at dotted paths changed by differences."""
    data = _exact(scene.to_dict())
    for path, change in changes.items():
        assign(data, path, _at(data, path) + change)
    found = _Table(**{
        name: [_Table(**each) for each in table] if isinstance(table, list) else _Table(**table)
        for name, table in data.items()
    })  # fmt: skip
    structure, gravity, excitation = found.structure, found.gravity, found.excitation
    if structure.damping_ratio is not None:
        structure.damping = 2 * structure.damping_ratio * mp.sqrt(structure.mass * structure.stiffness)
    structure.viscous = structure.damping
    angle = mp.radians(gravity.orientation_deg)
    across = mp.cos(angle) if abs(mp.cos(angle)) > 1e-15 else mp.mpf(0)  # upright is upright
    pull = (-mp.sin(angle) * gravity.acceleration, across * gravity.acceleration)
    gravity.components = lambda cavity: pull
    sines = {1: mp.mpc(1)} | {
        sine["order"]: sine["amplitude"] * mp.expj(mp.radians(sine["phase"])) for sine in excitation.harmonic
    }
    excitation.shares = {order: sines[order] for order in sorted(sines) if order == 1 or sines[order]}
    return found


def dashpots(scene: SimpleNamespace, rows: Mapping[str, tuple], mass: list) -> dict[str, mp.mpf]:
    """Return the dashpots of compliant contacts by their names: rows of FixedSequence, masses of its coordinates."""
    found = {}
    for name, (row, _, restitution) in rows.items():
        if restitution is None:
            continue
        reduced = 1 / sum(row[i] ** 2 / mass[i] for i in range(len(mass)))
        found[name] = 2 * _ratio(mp.mpf(restitution)) * mp.sqrt(scene.contact.stiffness * reduced)
    return found


def _ratio(restitution: mp.mpf) -> mp.mpf:
    """Return the damping ratio z of a contact that ends without force: restitution exp(-2 z acos(z)/sqrt(1 - z^2))."""
    if restitution == 1:
        return mp.mpf(0)

    def misses(z: mp.mpf) -> mp.mpf:
        return mp.re(2 * z * mp.acos(z) / mp.sqrt(mp.mpc(1 - z * z))) + mp.log(restitution)

    return mp.findroot(misses, damping_ratio(float(restitution)))


def _exact(node: Any) -> Any:
    if isinstance(node, dict):
        return {key: _exact(value) for key, value in node.items()}
    if isinstance(node, list):
        return [_exact(value) for value in node]
    return mp.mpf(node) if isinstance(node, float) else node


def _at(node: Any, path: str) -> mp.mpf:
    for step in path.split("."):
        if isinstance(node, list):
            named = [each for each in node if each.get("name") == step]
            node = named[0] if named else node[int(step)]
        else:
            node = node[step]
    return node
