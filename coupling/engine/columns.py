"""Many scenes that differ in numbers: their systems' differences, as columns over one.

Scenes that differ only in frequency, level, gaps, friction, restitution and starts have one structure, one set of
contact states and one length of run; the columns hold what differs, with the same digits as systems assembled one by
one.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import Annotated, Any, NamedTuple

import numpy as np

from vanedamp.coupling.numerics.compiler.record import record_with
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.scene.bodies import spread
from vanedamp.coupling.scene.contact_laws.law import ContactLaw
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.structures import Prescribed
from vanedamp.coupling.system.modal_basis import basis_of, forced_label, interface_row
from vanedamp.coupling.system.resonance import chosen_resonance, force_shapes
from vanedamp.coupling.system.system import System

#: columns of the start, as in response.restart_state.RestartState; and paths of the level
STARTS = (
    "displacement", "velocity", "slip", "slip_velocity", "elongation", "lift", "lift_velocity", "tilt", "tilt_rate",
)  # fmt: skip
LEVELS = ("excitation.force", "excitation.resonance_amplitude")

#: keys whose numbers change no more than their columns, of planar bodies, too
_KNOWN = ("frequency", "force", "resonance_amplitude", "displacement", "velocity", "position")
_PLACES = re.compile(
    r"(?P<table>excitation|initial|cavity|damper|friction_damper)(\.(?P<entry>[^.]+))?\."
    r"(?P<key>frequency|force|resonance_amplitude|displacement|velocity|gap|friction|restitution|position|normal_force)"
)
_KEYS = {
    "excitation": ("frequency", "force", "resonance_amplitude"), "initial": ("displacement", "velocity"),
    "cavity": ("gap",), "damper": ("friction", "restitution", "position", "velocity"),
    "friction_damper": ("normal_force", "friction"),
}  # fmt: skip


@record_with(free_axes=1)
class Columns(NamedTuple):
    """Differences of k scenes; r: rows of sliders (LineSystem), or units of planar bodies (System)."""

    omega: Annotated[np.ndarray, "k"]
    period: Annotated[np.ndarray, "k"]
    moment: Annotated[np.ndarray, "k"]
    speed: Annotated[np.ndarray, "k"]
    frequency: Annotated[np.ndarray, "k e"]
    load: Annotated[np.ndarray, "k e N", complex]
    rest: Annotated[np.ndarray, "k r"]
    play: Annotated[np.ndarray, "k r"]
    friction: Annotated[np.ndarray, "k r"]
    limit: Annotated[np.ndarray, "k r"]
    restitution: Annotated[np.ndarray, "k r"]
    holds: Annotated[np.ndarray, "k b"]
    neglected: Annotated[np.ndarray, "k b"]
    # STARTS, those across the cavity of planar bodies only
    displacement: Annotated[np.ndarray, "k n"]
    velocity: Annotated[np.ndarray, "k n"]
    slip: Annotated[np.ndarray, "k b"]
    slip_velocity: Annotated[np.ndarray, "k b"]
    elongation: Annotated[np.ndarray, "k d"]
    lift: Annotated[np.ndarray, "k b"]
    lift_velocity: Annotated[np.ndarray, "k b"]
    tilt: Annotated[np.ndarray, "k b"]
    tilt_rate: Annotated[np.ndarray, "k b"]


def entries_of(scene: Scene, path: str) -> tuple[str, list[int], str] | None:
    """Return table, numbers of its entries and key of a path to a number that has a column; None for others."""
    match = _PLACES.fullmatch(path)
    if match is None or match["key"] not in _KEYS[match["table"]] or _in_the_way(scene, match["table"], match["key"]):
        return None
    table, entry, key = match["table"], match["entry"], match["key"]
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
    if table == "friction_damper":  # more than once, of planar bodies
        return scene.planar
    if key == "restitution":
        return law.depends_on_speed or type(law).element is not ContactLaw.element
    return False


def _pulled(scene: Scene) -> bool:
    return bool(scene.speed) or scene.gravity.orientation_deg != 0.0 or scene.gravity.direction is not None


def tells(path: str) -> bool:
    """Return whether zero needs another subsystem than values above it: without friction linear modes differ."""
    return path.endswith(".friction")


def repeated(whole: System, system: Any, start: RestartState, size: int = 1) -> Columns:
    """Return the columns of as many equal scenes. system: that of the engine, in whose order rows are."""
    row = (
        whole.omega, whole.period, whole.moment, whole.speed, whole.frequency, system.load, system.rest,
        system.play, getattr(system, "friction", np.zeros(0)), system.limit, system.restitution,
        whole.holds, whole.neglected, *(getattr(start, name) for name in STARTS),
    )  # fmt: skip
    return Columns(*(np.repeat(np.asarray(value)[None], size, axis=0) for value in row))


def set_excitation(scene: Scene, whole: System, batch: Columns, values: Mapping[str, np.ndarray]) -> None:
    """Set frequency and level of scenes from those among some numbers, (k,) each by path."""
    for path, numbers in values.items():
        if path == "excitation.frequency":
            batch.omega[:] = 2 * np.pi * numbers
            batch.period[:] = 2 * np.pi / batch.omega
            batch.frequency[:] = batch.omega[:, None] * whole.order
        elif path in LEVELS:
            level = numbers if path.endswith("force") else numbers / chosen_resonance(scene).flexibility
            basis = basis_of(scene)
            shapes = force_shapes(scene, basis, interface_row(basis, forced_label(scene), "excitation.at"))
            batch.load[:, :, : shapes.shape[1]] = shapes * -1j * level[:, None, None]


def set_starts(scene: Scene, batch: Columns, values: Mapping[str, np.ndarray]) -> None:
    """Set with which motion scenes begin, and where bodies are, from those among some numbers, (k,) each by path."""
    gaps, places = dict[int, np.ndarray](), dict[int, np.ndarray]()
    for path, numbers in values.items():
        entry = entries_of(scene, path)
        assert entry is not None
        table, entries, key = entry
        if table == "initial":
            getattr(batch, key)[:] = numbers[:, None]
        elif key == "gap":
            gaps |= dict.fromkeys(entries, numbers)
        elif key == "position":
            places |= dict.fromkeys(entries, numbers)
        elif key == "velocity":
            batch.slip_velocity[:, entries] = numbers[:, None]
    for index, cavity in enumerate(scene.cavity):
        row = scene.bodies_in(cavity)
        if index in gaps or not places.keys().isdisjoint(row):
            given = [places.get(number, scene.damper[number].position) for number in row]
            for number, slip in zip(row, spread(given, gaps.get(index, cavity.gap)), strict=True):
                batch.slip[:, number] = slip


def system_in(whole: System, table: Columns, k: int, units: np.ndarray) -> System:
    """Return the system of scene k, with its columns of some units (c,), in a row."""
    rest, play, load = whole.rest.copy(), whole.play.copy(), whole.load.copy()
    behind = table.rest.shape[1] - len(units)
    rest[units], play[units] = table.rest[k, behind:], table.play[k, behind:]
    load[:, : table.load.shape[2]] = table.load[k]
    return whole._replace(
        omega=float(table.omega[k]), period=float(table.period[k]), moment=float(table.moment[k]),
        speed=float(table.speed[k]), frequency=table.frequency[k], rest=rest, play=play, load=load,
    )  # fmt: skip


def columned(scene: Scene, paths: Iterable[str]) -> list[str]:
    """Return the paths with columns in scenes like this one."""
    if scene.excitation.signal is not None:
        return []
    batched = [path for path in paths if entries_of(scene, path) is not None]
    # a number of a body or a cavity is one of each sector's, which may scatter about it
    return [path for path in batched if path.startswith("excitation.")] if scene.repeats else batched


def foreseen(scene: Scene, paths: Iterable[str]) -> list[str]:
    """Return the paths with columns known without the scenes' systems.

    Of planar bodies, gaps, friction and restitution enter more than once.
    """
    names = columned(scene, paths)
    return [path for path in names if path.rpartition(".")[2] in _KNOWN] if scene.planar else names
