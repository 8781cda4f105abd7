"""Scenes of a ring with everything written out by sector: cavities, bodies and dampers repeated, a wave as its forces.

A scene stays compact, so that a path such as "cavity.c.gap" names one number. It is unrolled where its open choices are
made and where its system is assembled. Cavity "c" becomes "c@0", "c@1", ..., its labels and bodies with it.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from vanedamp.coupling.scene.bodies import Cavity, Damper, FrictionDamper
from vanedamp.coupling.scene.excitation import Excitation, Harmonic
from vanedamp.coupling.scene.load_pattern import Load
from vanedamp.coupling.scene.repetition import Sectors
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.structures import Ring
from vanedamp.coupling.scene.wear import WearPair
from vanedamp.coupling.system.reduced_model_file import RingFacts, modes_of_ring, ring_in_file
from vanedamp.files.toml_input import InputError, nearest

#: keys of a cavity that name labels
_SURFACES = ("left", "right", "floor", "ceiling")


def unrolled(scene: Scene) -> Scene:
    """Return a scene of a ring with its tables repeated over their sectors; any other scene as it is.

    Ranges are left out: their numbers are the scene's. Raises InputError for a sector that the ring does not have, a
    label that no sector has, a gap that its scatter leaves none of, and elements that other code adds.
    """
    if not scene.repeats:
        return scene
    ring = ring_in_file(scene.structure)
    assert ring is not None
    _check_diameters(scene, ring)
    tables = scene.element_tables
    for table, entries in tables.items() if any(cavity.sectors is not None for cavity in scene.cavity) else ():
        if not all(entry.on_structure for entry in entries):
            raise InputError(
                f"{table}: may name bodies by number, which sectors change; write their cavities out by sector"
            )
    shown = str(scene.excitation.at).partition("@")[0]
    cavities, bodies = _cavities(scene, ring)

    def placed(damper: FrictionDamper, label: Callable[[str, str], str]) -> FrictionDamper:
        to = None if damper.to is None else label("to", damper.to)
        return replace(damper, at=label("at", damper.at or shown), to=to)

    dampers = _repeated(scene.friction_damper, "friction_damper", ring, placed)
    elements = {
        table: _repeated(entries, table, ring, lambda entry, label: entry.relabelled(label))
        for table, entries in tables.items()
    }
    copies = {"casing": _places(dampers), "": _places(bodies)}
    copies |= {table: _places(entries) for table, entries in elements.items()}
    written: dict[str, Any] = {table: tuple(entry for _, entry in entries) for table, entries in elements.items()}
    wear = scene.wear and replace(scene.wear, pair=tuple(_pairs(scene.wear.pair, copies)))
    return replace(
        scene, excitation=_excitation(scene.excitation, ring), cavity=cavities,
        damper=tuple(body for _, body in bodies), friction_damper=tuple(damper for _, damper in dampers),
        stop=written.pop("stop"), added=written or None, wear=wear, ranges={},
    )  # fmt: skip


def _check_diameters(scene: Scene, ring: RingFacts) -> None:
    """Raise InputError where a nodal diameter that the force excites is not among the modes that the scene keeps."""
    from vanedamp.modal.cyclic import aliased  # imports scipy

    structure, excitation = scene.structure, scene.excitation
    assert isinstance(structure, Ring)
    modes = modes_of_ring(structure)
    if modes is None or excitation.distributed or excitation.base_acceleration is not None:
        return
    count, diameters = modes
    wave, whose = excitation.travelling, "a force at one label excites"
    excited = set(range(ring.sectors // 2 + 1))
    if wave is not None:
        orders = {1} | {sine.order for sine in excitation.harmonic}
        whose = f"wave {wave} excites"
        if structure.mistuning is None:
            excited = {aliased(abs(order * wave), ring.sectors)[0] for order in orders}
        else:
            whose += " in a mistuned ring"
    missing = excited - set(diameters[:count].tolist())
    if missing:
        least = max(int(np.argmax(diameters == diameter)) for diameter in missing) + 1
        raise InputError(
            f"structure.modes: {structure.modes} modes are without the nodal diameter {min(missing)}, which {whose}; "
            f"give at least {least}"
        )


def sectors_of(given: Sectors, count: int, key: str) -> list[int]:
    """Return the numbers of the sectors that a table names of a ring with `count`. Raises InputError for others."""
    if isinstance(given, str):
        return list(range(0, count, 2 if given == "alternate" else 1))
    sectors = [given] if isinstance(given, int) else list(given)
    for index, sector in enumerate(sectors):
        if sector >= count:
            raise InputError(f"{key}: the ring has no sector {sector}; its {count} sectors are 0 to {count - 1}")
        if sector in sectors[:index]:
            raise InputError(f"{key}: sector {sector} is given twice")
    return sectors


def _label(label: str, sector: int, ring: RingFacts, key: str, repeated: bool = False) -> str:
    """Return a label in a sector: one that names its sector as it is, unless repeated; "shroud@+1" in the next one."""
    name, mark, where = label.partition("@")
    if name not in ring.labels:
        raise InputError(f"{key}: no sector of the ring has a label '{name}'; {nearest(name, list(ring.labels))}")
    if not mark:
        return f"{name}@{sector}"
    relative = where[:1] in ("+", "-")
    if not (where[1:] if relative else where).isdecimal():
        raise InputError(f"{key}: expected '{name}', '{name}@3' or '{name}@+1', not '{label}'")
    if relative:
        return f"{name}@{(sector + int(where)) % ring.sectors}"
    if repeated:
        raise InputError(
            f"{key}: '{label}' is the same place for all of several sectors; give '{name}', each sector's own, or "
            f"'{name}@+1' in the next one"
        )
    return label


def _cavities(scene: Scene, ring: RingFacts) -> tuple[tuple[Cavity, ...], list[tuple[int, Damper]]]:
    """Return the cavities, and the bodies from cavity to cavity, each with its number in the scene."""
    cavities: list[Cavity] = []
    bodies: list[tuple[int, Damper]] = []
    positions = scene.positions
    for index, cavity in enumerate(scene.cavity):
        row = [(number, scene.damper[number]) for number in scene.bodies_in(cavity)]
        if cavity.sectors is None:
            cavities.append(cavity)
            bodies += row
            continue
        draws = _Draws(cavity, index, len(row), ring.sectors)
        sectors = sectors_of(cavity.sectors, ring.sectors, f"cavity[{index}].sectors")
        for sector in sectors:
            labels: dict[str, Any] = {
                side: _label(label, sector, ring, f"cavity[{index}].{side}", len(sectors) > 1)
                for side in _SURFACES
                if (label := getattr(cavity, side)) is not None
            }
            name, gap = f"{cavity.name}@{sector}", draws.gap(sector)
            cavities.append(replace(cavity, name=name, gap=gap, sectors=None, scatter=None, **labels))
            places = draws.positions([positions[number] for number, _ in row], sector)
            bodies += [
                (number, replace(body, cavity=name, position=position))
                for (number, body), position in zip(row, places, strict=True)
            ]
    return tuple(cavities), bodies


class _Draws:
    """Draws of a cavity's scatter in all sectors: a gap for each, and a position for each of its bodies."""

    def __init__(self, cavity: Cavity, index: int, bodies: int, sectors: int) -> None:
        self.cavity, self.scatter = cavity, cavity.scatter
        random = np.random.default_rng((cavity.scatter.seed if cavity.scatter else 0, index))
        self._gap = random.standard_normal(sectors)
        self._position = random.uniform(-1.0, 1.0, (sectors, bodies))

    def gap(self, sector: int) -> float:
        """Return the gap in a sector, m."""
        factor = 1.0 + (self.scatter.gap if self.scatter else 0.0) * float(self._gap[sector])
        if factor <= 0.0:
            raise InputError(f"cavity.{self.cavity.name}.scatter.gap: leaves no gap in sector {sector}; lower it")
        return self.cavity.gap * factor

    def positions(self, written: Sequence[float], sector: int) -> list[float]:
        """Return the positions at time zero in a sector, m: in order, and within the free travel."""
        if self.scatter is None:
            return list(written)
        half = 0.5 * self.gap(sector)
        places = np.array(written) * (2.0 * half / self.cavity.gap)
        places = places + self.scatter.position * half * self._position[sector]
        positions: list[float] = np.sort(np.clip(places, -half, half)).tolist()
        return positions


def _repeated(
    entries: Sequence[Any], table: str, ring: RingFacts, relabelled: Callable[[Any, Callable[[str, str], str]], Any]
) -> list[tuple[int, Any]]:
    """Return the entries of a table of the structure, over their sectors, each with its number in the scene.

    relabelled: returns an entry with other labels, by key and label.
    """
    copies = []
    for number, entry in enumerate(entries):
        if entry.sectors is None:
            copies.append((number, entry))
            continue
        sectors = sectors_of(entry.sectors, ring.sectors, f"{table}[{number}].sectors")
        for sector in sectors:

            def there(key: str, label: str, sector: int = sector, number: int = number, of: list[int] = sectors) -> str:
                return _label(label, sector, ring, f"{table}[{number}].{key}", len(of) > 1)

            copies.append((number, relabelled(replace(entry, sectors=None), there)))
    return copies


def _excitation(excitation: Excitation, ring: RingFacts) -> Excitation:
    """Return the excitation with its response in one sector, and a wave as forces in all sectors."""
    at, wave = _label(str(excitation.at), 0, ring, "excitation.at"), excitation.travelling
    if wave is None:
        return replace(excitation, at=at)
    sines = {1: Harmonic(1, 1.0)} | {sine.order: sine for sine in excitation.harmonic}
    name, count = at.partition("@")[0], ring.sectors
    loads = tuple(
        # whole turns are left out, so that equal phases are equal to the last bit
        Load(
            f"{name}@{sector}", sine.amplitude, sine.phase - 360.0 * (sine.order * wave * sector % count) / count, order
        )
        for (order, sine), sector in itertools.product(sorted(sines.items()), range(count))
    )
    return replace(excitation, at=at, wave=None, force=None, harmonic=(), load=loads, load_factor=excitation.force)


def _places(entries: Sequence[tuple[int, Any]]) -> dict[int, list[int]]:
    """Return where each entry of a scene stands once it is repeated, by its number."""
    by_number: dict[int, list[int]] = {}
    for index, (number, _) in enumerate(entries):
        by_number.setdefault(number, []).append(index)
    return by_number


def _pairs(pairs: Sequence[WearPair], copies: Mapping[str, Mapping[int, list[int]]]) -> Iterator[WearPair]:
    """Yield the contacts with rates of their own, by the numbers of repeated tables."""
    for pair in pairs:
        of_side = copies.get(pair.side or "", copies[""])
        numbers = [None] if pair.damper is None else of_side.get(pair.damper, [pair.damper])
        yield from (replace(pair, damper=number) for number in numbers)
