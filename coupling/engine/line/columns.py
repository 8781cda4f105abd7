"""Many scenes of sliders that differ in numbers: their systems as columns over one of them.

Frequency, level, gaps, friction, restitution and starts enter the system of sliders in closed form
(system.line_system). Scenes that differ only in these have one structure, one set of contact configurations and one
length of run; the columns hold what differs, with the same digits as systems assembled one by one.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import Annotated, NamedTuple

import numpy as np

from vanedamp.coupling.numerics.compiler.record import record_with
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.scene.bodies import spread
from vanedamp.coupling.scene.contact_laws.law import ContactLaw
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.structures import Prescribed
from vanedamp.coupling.system.assembly import pressing
from vanedamp.coupling.system.line_system import LineSystem
from vanedamp.coupling.system.modal_basis import basis_of, forced_label, interface_row
from vanedamp.coupling.system.resonance import chosen_resonance, force_shapes
from vanedamp.coupling.system.system import BODY, LEFT, RIGHT, System
from vanedamp.coupling.system.units import coefficient

#: columns of the start, as in response.restart_state.RestartState; and paths of the level
STARTS = ("displacement", "velocity", "slip", "slip_velocity", "elongation")
LEVELS = ("excitation.force", "excitation.resonance_amplitude")

_PLACES = re.compile(
    r"(?P<table>excitation|initial|cavity|damper)(\.(?P<entry>[^.]+))?\."
    r"(?P<key>frequency|force|resonance_amplitude|displacement|velocity|gap|friction|restitution|position)"
)
_KEYS = {
    "excitation": ("frequency", "force", "resonance_amplitude"), "initial": ("displacement", "velocity"),
    "cavity": ("gap",), "damper": ("friction", "restitution", "position", "velocity"),
}  # fmt: skip


@record_with(free_axes=1)
class Columns(NamedTuple):
    """What differs between k scenes; other sizes as in LineSystem."""

    omega: Annotated[np.ndarray, "k"]
    period: Annotated[np.ndarray, "k"]
    frequency: Annotated[np.ndarray, "k e"]
    load: Annotated[np.ndarray, "k e N", complex]
    rest: Annotated[np.ndarray, "k r"]
    free_travel: Annotated[np.ndarray, "k r"]
    limit: Annotated[np.ndarray, "k r"]
    restitution: Annotated[np.ndarray, "k r"]
    # STARTS
    displacement: Annotated[np.ndarray, "k n"]
    velocity: Annotated[np.ndarray, "k n"]
    slip: Annotated[np.ndarray, "k b"]
    slip_velocity: Annotated[np.ndarray, "k b"]
    elongation: Annotated[np.ndarray, "k d"]


def entries_of(scene: Scene, path: str) -> tuple[str, list[int], str] | None:
    """Return table, numbers of its entries and key of a path to a number that has a column; None for others."""
    found = _PLACES.fullmatch(path)
    if found is None or found["key"] not in _KEYS[found["table"]] or _in_the_way(scene, found["table"], found["key"]):
        return None
    table, entry, key = found["table"], found["entry"], found["key"]
    if table in ("excitation", "initial"):
        return None if entry else (table, [], key)
    rows = getattr(scene, table)
    if entry is None:
        return table, list(range(len(rows))), key
    if entry.isdecimal():
        return (table, [int(entry)], key) if int(entry) < len(rows) else None
    named = [number for number, row in enumerate(rows) if getattr(row, "name", None) == entry]
    return (table, named, key) if named else None


def _in_the_way(scene: Scene, table: str, key: str) -> bool:
    """Return whether something in a scene makes more depend on a number than its column."""
    excitation, law = scene.excitation, scene.contact
    if key == "frequency":
        follows = excitation.resonance_amplitude is not None and excitation.resonance_near is None
        timed = excitation.engine_order is not None or excitation.waveform is not None
        return follows or timed or isinstance(scene.structure, Prescribed)
    if key in ("force", "resonance_amplitude"):
        # the level is compared with static loads, and the travel at stops is estimated from it
        return getattr(excitation, key) is None or excitation.distributed or any(scene.elements) or _pulled(scene)
    if table == "initial":
        return any(scene.elements) or not hasattr(scene.structure, "mass")
    if key == "restitution":
        return law.depends_on_speed or type(law).element is not ContactLaw.element
    return False


def _pulled(scene: Scene) -> bool:
    return bool(scene.speed) or scene.gravity.orientation_deg != 0.0 or scene.gravity.direction is not None


def tells(path: str) -> bool:
    """Return whether more than its column tells a number above zero from zero: friction has other linear modes."""
    return path.endswith(".friction")


def columns(
    scene: Scene, whole: System, system: LineSystem, start: RestartState, values: Mapping[str, np.ndarray]
) -> Columns:
    """Return the columns of scenes that differ from `scene` in some numbers, by paths: (k,) each.

    whole, system, start: of the scene itself.
    """
    found = repeated(system, start, len(next(iter(values.values()))))
    gaps: dict[int, np.ndarray] = {}
    places: dict[int, np.ndarray] = {}
    restitution = np.tile([damper.restitution for damper in scene.damper], (len(found.omega), 1))
    for path, numbers in values.items():
        place = entries_of(scene, path)
        assert place is not None
        table, entries, key = place
        if key == "frequency":
            found.omega[:] = 2 * np.pi * numbers
            found.period[:] = 2 * np.pi / found.omega
            found.frequency[:] = found.omega[:, None] * whole.order
        elif table == "excitation":
            _set_level(scene, found, numbers if key == "force" else numbers / chosen_resonance(scene).flexibility)
        elif table == "initial":
            getattr(found, key)[:] = numbers[:, None]
        elif key == "gap":
            rows = _rows(whole, system, np.isin(whole.cavity, entries))
            walls = rows[np.isin(whole.surface[rows - system.friction_rows], (LEFT, RIGHT))]
            found.free_travel[:, rows], found.rest[:, walls] = numbers[:, None], (numbers / 2)[:, None]
            gaps |= dict.fromkeys(entries, numbers)
        elif key == "friction":
            pressed = pressing(scene)
            for body in entries:
                found.limit[:, body] = [coefficient(number) * max(pressed[body], 0.0) for number in numbers]
        elif key == "restitution":
            restitution[:, entries] = numbers[:, None]
        elif key == "position":
            places |= dict.fromkeys(entries, numbers)
        else:
            found.slip_velocity[:, entries] = numbers[:, None]
    if any(path.endswith(".restitution") for path in values):
        _set_restitution(scene, whole, system, found, restitution)
    if gaps or places:
        _set_positions(scene, found, gaps, places)
    return found


def repeated(system: LineSystem, start: RestartState, size: int = 1) -> Columns:
    """Return the columns of as many equal scenes."""
    row = (
        system.omega, system.period, system.frequency, system.load, system.rest, system.free_travel, system.limit,
        system.restitution, start.displacement, start.velocity, start.slip, start.slip_velocity, start.elongation,
    )  # fmt: skip
    return Columns(*(np.repeat(np.asarray(value)[None], size, axis=0) for value in row))


def _rows(whole: System, system: LineSystem, bodies: np.ndarray) -> np.ndarray:
    """Return the contact rows of some bodies (b,) with walls and neighbours."""
    c = whole.contacts
    own = np.isin(whole.surface[:c], (LEFT, RIGHT, BODY)) & ~whole.without_body[:c]
    return system.friction_rows + np.flatnonzero(own & bodies[np.where(own, whole.body[:c], 0)])


def _set_level(scene: Scene, found: Columns, level: np.ndarray) -> None:
    """Set the loads of a force (k,), N."""
    basis = basis_of(scene)
    shapes = force_shapes(scene, basis, interface_row(basis, forced_label(scene), "excitation.at"))
    found.load[:, :, : shapes.shape[1]] = shapes * -1j * level[:, None, None]


def _set_restitution(scene: Scene, whole: System, system: LineSystem, found: Columns, restitution: np.ndarray) -> None:
    """Set the restitutions of the rows from those of the bodies (k, b)."""
    for row in _rows(whole, system, np.ones(whole.bodies, bool)):
        unit = row - system.friction_rows
        own, other = restitution[:, whole.body[unit]], whole.other[unit]
        if other >= 0:
            pairs = zip(own.tolist(), restitution[:, other].tolist(), strict=True)
            own = np.array([scene.contact.pair_restitution(*pair) for pair in pairs])
        found.restitution[:, row] = own


def _set_positions(
    scene: Scene, found: Columns, gaps: Mapping[int, np.ndarray], places: Mapping[int, np.ndarray]
) -> None:
    """Set where bodies begin: at positions (k,) m, by body, or spread in gaps (k,) m, by cavity."""
    for index, cavity in enumerate(scene.cavity):
        row = scene.bodies_in(cavity)
        if index in gaps or not places.keys().isdisjoint(row):
            given = [places.get(number, scene.damper[number].position) for number in row]
            for number, own in zip(row, spread(given, gaps.get(index, cavity.gap)), strict=True):
                found.slip[:, number] = own


def columned(scene: Scene, paths: Iterable[str]) -> list[str]:
    """Return those of some paths whose numbers have columns in scenes like this one."""
    if scene.planar or scene.excitation.signal is not None:
        return []
    own = [path for path in paths if entries_of(scene, path) is not None]
    # a number of a body or a cavity is one of each sector's, which may scatter about it
    return [path for path in own if path.startswith("excitation.")] if scene.repeats else own
