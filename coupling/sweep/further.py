"""What a sweep keeps of a point besides its measures: Poincare sections and Lyapunov exponents if its table asks for
them, stresses of a model with hot spots, wear, and the response of the sectors of a ring."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from vanedamp.coupling.derivatives.passage import PassageStatus
from vanedamp.coupling.exponents.lyapunov import Motion, lyapunov
from vanedamp.coupling.response.contact_work import ContactWear
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.response.sector_response import BY_SECTOR, OF_RING, SectorResponse
from vanedamp.coupling.response.spot_stress import LINEAR, SCALARS, SpotStress
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.system.reduced_model_file import hot_spots_in_file, ring_in_file
from vanedamp.coupling.system.sectors import unrolled
from vanedamp.files.store import frozen, read_only
from vanedamp.rom.recovery import COMPONENTS

#: measures of the exponents and their units, each an array over the grid; words, kept as their numbers
EXPONENTS = {
    "exponent": "1/s", "exponent_confidence": "1/s", "exponent_second": "1/s", "exponent_per_period": "1",
}  # fmt: skip
WORDS = {"motion": tuple(Motion), "exponent_status": tuple(PassageStatus)}
#: parts of a section and their units, each an array over the grid and the sections, those of bodies over these as well
SECTIONS = {
    "section_displacement": "m", "section_velocity": "m/s", "section_slip": "m", "section_slip_velocity": "m/s",
}  # fmt: skip
#: utilisation and damage at hot spots and their units (strength.assessment)
STRENGTHS = {"utilisation": "1", "utilisation_max": "1", "yield_utilisation": "1", "damage_per_hour": "1/h"}
#: stresses and strengths at hot spots and their units, each an array over the grid and the spots, and those with
#: components over these as well
STRESSES = {
    **{f"stress_{name}{of}": "Pa" for name in SCALARS for of in ("", "_max", *(f"_{curve}" for curve in LINEAR))},
    "stress_amplitude": "Pa", "stress_static": "Pa", **STRENGTHS,
}  # fmt: skip
#: wear of a scene with [wear] and its units, each an array over the grid: largest depth rate of a contact, volume and
#: work rate of all contacts
WEARS = {"wear_depth_rate": "m/h", "wear_volume_rate": "m^3/h", "wear_work_rate": "W"}
#: response of a ring and its units: of each sector, an array over the grid and the sectors, and of the ring
SECTORS = {f"sector_{name}": unit for name, unit in BY_SECTOR.items()} | OF_RING
_OF_COMPONENTS = ("stress_amplitude", "stress_static")
_WIDTH = len(STRESSES) + (len(COMPONENTS) - 1) * len(_OF_COMPONENTS)


def stress_width(base: Scene) -> int:
    """Return the number of columns of a point's stresses."""
    return _WIDTH * len(hot_spots_in_file(base.structure))


def put_stresses(row: np.ndarray, base: Scene, found: Sequence[SpotStress] | None) -> None:
    """Put the stresses of a run into a row, at the places of the base's hot spots."""
    known = {spot.name: spot for spot in found or ()}
    for place, name in enumerate(hot_spots_in_file(base.structure)):
        if (spot := known.get(name)) is not None:
            row[place * _WIDTH : (place + 1) * _WIDTH] = _columns(spot)


def _columns(spot: SpotStress) -> list[float]:
    columns = []
    for name in SCALARS:
        columns += [getattr(spot, name), getattr(spot, f"{name}_max")]
        columns += [(getattr(spot, curve) or {name: np.nan})[name] for curve in LINEAR]
    static = np.full(len(COMPONENTS), np.nan) if spot.static is None else spot.static
    return [*columns, *spot.amplitude.values(), *static, *(spot.strength.get(name, np.nan) for name in STRENGTHS)]


def sector_width(base: Scene) -> int:
    """Return the number of columns of a point's sectors."""
    ring = ring_in_file(base.structure)
    return 0 if ring is None else len(OF_RING) + len(BY_SECTOR) * ring.sectors


def put_sectors(row: np.ndarray, found: SectorResponse | None) -> None:
    """Put the response of the sectors of a run into a row."""
    if found is not None:
        row[:] = np.concatenate([
            np.array([getattr(found, name) for name in OF_RING], float), *(getattr(found, name) for name in BY_SECTOR)
        ])  # fmt: skip


def sectors_of(values: np.ndarray, shape: tuple[int, ...]) -> Iterator[tuple[str, np.ndarray]]:
    """Yield the response of the sectors over a grid from the columns (points, n) of its points."""
    if values.shape[1]:
        yield from ((name, frozen(values[:, place].reshape(shape))) for place, name in enumerate(OF_RING))
        sectors = (values.shape[1] - len(OF_RING)) // len(BY_SECTOR)
        by_sector = values[:, len(OF_RING) :].reshape(*shape, len(BY_SECTOR), sectors)
        yield from ((f"sector_{name}", frozen(by_sector[..., place, :])) for place, name in enumerate(BY_SECTOR))


def put_wear(row: np.ndarray, found: Sequence[ContactWear] | None) -> None:
    """Put the wear of a run into a row."""
    if found:
        depths = [contact.depth_rate for contact in found if contact.depth_rate is not None]
        row[:] = (
            max(depths, default=np.nan), sum(contact.volume_rate for contact in found),
            sum(contact.work_rate for contact in found),
        )  # fmt: skip


def wear_of(values: np.ndarray, shape: tuple[int, ...]) -> Iterator[tuple[str, np.ndarray]]:
    """Yield the wear of a grid from the columns (points, n) of its points."""
    if values.shape[1]:
        yield from ((name, frozen(column.reshape(shape))) for name, column in zip(WEARS, values.T, strict=True))


def stresses_of(values: np.ndarray, shape: tuple[int, ...]) -> Iterator[tuple[str, np.ndarray]]:
    """Yield the stresses of a grid from the columns (points, n) of its points."""
    if not values.shape[1]:
        return
    given, at = values.reshape(*shape, -1, _WIDTH), 0
    for name in STRESSES:
        wide = len(COMPONENTS) if name in _OF_COMPONENTS else 1
        part = given[..., at : at + wide]
        yield name, frozen(part if name in _OF_COMPONENTS else part[..., 0])
        at += wide


def exponent_width(base: Scene) -> int:
    """Return the number of columns of a point's exponents."""
    return len(EXPONENTS) + len(WORDS) if "exponents" in base.kept else 0


def bodies_of(base: Scene) -> int:
    """Return the number of bodies of a point, of a ring in all their sectors."""
    return len(unrolled(base).damper)


def section_width(base: Scene) -> int:
    """Return the number of columns of a point's sections."""
    return base.kept.get("sections", 0) * (2 + 2 * bodies_of(base))


def put_sections(row: np.ndarray, section: np.ndarray) -> None:
    """Put the last of the sections (p, s) of a run into a row; the first places stay free where there are fewer."""
    given = row.reshape(-1, section.shape[1])
    count = min(len(given), len(section))
    given[len(given) - count :] = section[len(section) - count :]


def put_exponents(row: np.ndarray, scene: Scene, periods: int, final: RestartState | None) -> None:
    """Put the exponents of the motion from the end of a run into a row; final: None of one that ended early."""
    words = Motion.UNDECIDED, PassageStatus.STOPPED
    if final is not None:
        found = lyapunov(scene, periods, final)
        second = found.exponents[1] if len(found.exponents) > 1 else np.nan
        row[: len(EXPONENTS)] = found.largest, found.error, second, found.per_period
        words = found.motion, found.status
    row[len(EXPONENTS) :] = [known.index(word) for known, word in zip(WORDS.values(), words, strict=True)]


def exponents_of(values: np.ndarray, shape: tuple[int, ...]) -> Iterator[tuple[str, np.ndarray]]:
    """Yield the exponents of a grid from the columns (points, n) of its points, words as text."""
    if not values.shape[1]:
        return
    for name, column in zip(EXPONENTS, values.T, strict=False):
        yield name, read_only(column.reshape(shape))
    for (name, known), column in zip(WORDS.items(), values.T[len(EXPONENTS) :], strict=True):
        texts = np.array([*(word.value for word in known), ""], object)  # without a number: a run that broke
        yield name, frozen(texts[np.nan_to_num(column, nan=-1.0).astype(int)].reshape(shape), object)


def sections_of(values: np.ndarray, shape: tuple[int, ...], bodies: int) -> Iterator[tuple[str, np.ndarray]]:
    """Yield the sections of a grid from the columns (points, n) of its points."""
    if not values.shape[1]:
        return
    given = values.reshape(*shape, -1, 2 + 2 * bodies)
    yield "section_displacement", frozen(given[..., 0])
    yield "section_velocity", frozen(given[..., 1])
    if bodies:
        yield "section_slip", frozen(given[..., 2 : 2 + bodies])
        yield "section_slip_velocity", frozen(given[..., 2 + bodies :])
