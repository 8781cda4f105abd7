"""Reduced models in files, as the scenes that name them take them."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from vanedamp.coupling.scene.mistuning import Mistuning
from vanedamp.coupling.scene.structures import Ring, Rom, Structure
from vanedamp.files.store import digest, file_stamp
from vanedamp.files.toml_input import InputError
from vanedamp.rom.checks import ReducedModelError
from vanedamp.rom.recovery import hot_spots
from vanedamp.rom.reduced import ReducedModel
from vanedamp.rom.truncation import massless, truncated, with_attachment_modes

if TYPE_CHECKING:
    from vanedamp.rom.ring.ring_model import RingModel
    from vanedamp.rom.ring.sector_ring import SectorRing


class Restricted(NamedTuple):
    """A reduced model at a speed with a scene's number of modes.

    in_file: (N, n) its coordinates in those q of the model's file, which are in_file @ its own; inertia: (N, n) the
    mass matrix of the file times in_file, kg. None for a model that does not rotate, whose coordinates never change.
    """

    model: ReducedModel
    in_file: np.ndarray | None = None
    inertia: np.ndarray | None = None


class RingFacts(NamedTuple):
    """Of a reduced ring: number of sectors, and the labels of one."""

    sectors: int
    labels: tuple[str, ...]


def ring_in_file(structure: Structure) -> RingFacts | None:
    """Return the facts of a structure that is a ring; None for any other."""
    if not isinstance(structure, Ring):
        return None
    ring = _ring(structure.file, file_stamp(structure.file))
    return RingFacts(ring.sectors, ring.interface)


def modes_of_ring(structure: Ring) -> tuple[int, np.ndarray] | None:
    """Return the number of modes that a scene keeps of a ring, and the nodal diameters of all, ascending in frequency.

    The number is that of `modes`, or the next one that parts no pair of waves of the tuned ring, which deviations
    mix but do not part. None: all modes.
    """
    count = structure.modes
    if not isinstance(count, int):
        return None
    ring, diameters = _ring_modes(structure.file, file_stamp(structure.file))
    paired = (diameters > 0) & (2 * diameters < ring.sectors)
    while count < len(diameters) and np.any(np.bincount(diameters[:count][paired[:count]]) % 2):
        count += 1
    return count, diameters


def reduced_model(structure: Rom, speed: float) -> ReducedModel:
    """Return the reduced model of a structure at a speed of rotation (rad/s), with its number of modes.

    Raises InputError for an open choice, and for a speed that the model does not have.
    """
    return restricted(structure, speed).model


def restricted(structure: Rom, speed: float) -> Restricted:
    """Return the same with its coordinates in terms of the file's."""
    if structure.modes == "auto":
        raise InputError('structure.modes: "auto" is still open; model_order.selection.select_model_order chooses')
    return _restricted(structure, speed, file_stamp(structure.file))


def greatest_speed(structure: Rom) -> float:
    """Return the speed of rotation, rad/s, up to which the model of a file holds; 0 for one that does not rotate."""
    return _whole(structure).greatest_speed


def hot_spots_in_file(structure: Structure) -> dict[str, dict[str, Any]]:
    """Return data of the hot spots of a structure by name (rom.recovery.hot_spots); empty without any."""
    if not isinstance(structure, Rom):
        return {}
    return hot_spots(_whole(structure))


def origin_in_file(structure: Structure) -> dict[str, Any]:
    """Return what a result records of the model in a file: its hash, and what it was made of; empty without a file."""
    if not isinstance(structure, Rom):
        return {}
    whole = _whole(structure)
    made_of = {"damping_ratio": whole.damping_ratio, "matrices": whole.provenance.get("matrices", {})}
    return {"model": digest(structure.file), "model_made_of": made_of}


def coordinates_in_file(structure: Rom) -> int:
    """Return the number of coordinates of the model of a file."""
    return _whole(structure).size


@lru_cache(maxsize=8)
def _restricted(structure: Rom, speed: float, _stamp: int) -> Restricted:
    whole = _whole(structure)
    try:
        model = whole.at_speed(speed)
    except ReducedModelError as error:
        raise InputError(f"rotation: {structure.file}: {error}") from None
    if whole.greatest_speed == 0.0:
        return Restricted(_cut(model, structure))
    # outputs are functionals of the coordinates, which follow these through every change: so do the coordinates
    names, rows = tuple(f"q{index}" for index in range(whole.size)), np.eye(whole.size)
    given = len(model.outputs)
    if model.output_rows is not None:
        rows = np.vstack([model.output_rows, rows])
    marked = _cut(replace(model, outputs=(*model.outputs, *names), output_rows=rows, output_residual=None), structure)
    assert marked.output_rows is not None
    in_file = marked.output_rows[given:]
    changes: dict[str, Any] = {
        "outputs": model.outputs,
        "output_rows": marked.output_rows[:given] if given else None,
        "output_residual": None if marked.output_residual is None or not given else marked.output_residual[:given],
    }
    return Restricted(replace(marked, **changes), in_file, whole.mass @ in_file)


def _cut(model: ReducedModel, structure: Rom) -> ReducedModel:
    """Return a model at its speed with the structure's number of modes."""
    modes = structure.modes
    if isinstance(structure, Ring) and (whole_pairs := modes_of_ring(structure)) is not None:
        modes = whole_pairs[0]
    if modes is None:
        return model
    assert isinstance(modes, int)
    if structure.attached:
        return with_attachment_modes(model, modes)
    return massless(model, modes) if structure.natural else truncated(model, modes)


def _whole(structure: Rom) -> ReducedModel:
    """Return the model of a file, of a ring with its mistuning."""
    stamp = file_stamp(structure.file)
    if not isinstance(structure, Ring):
        return _loaded(structure.file, stamp)
    mistuning = structure.mistuning
    stamps = tuple(file_stamp(file) for file in mistuning.files) if mistuning is not None else ()
    return _mistuned(structure.file, stamp, mistuning, stamps)


@lru_cache(maxsize=8)
def _loaded(file: str, _stamp: int) -> ReducedModel:
    return ReducedModel.load(file)


@lru_cache(maxsize=8)
def _ring(file: str, _stamp: int) -> RingModel | SectorRing:
    from vanedamp.rom.ring.sector_ring import load_ring  # for scenes of rings only

    return load_ring(file)


@lru_cache(maxsize=8)
def _ring_modes(file: str, stamp: int) -> tuple[RingModel | SectorRing, np.ndarray]:
    """Return a ring, and the nodal diameters of its natural modes by ascending frequency."""
    ring = _ring(file, stamp)
    return ring, ring.tuned_families().ascending[: ring.modes]


@lru_cache(maxsize=8)
def _mistuned(file: str, stamp: int, mistuning: Mistuning | None, _stamps: tuple[int, ...]) -> ReducedModel:
    """Return the model of a ring. _stamps: of the files of its deviations."""
    ring = _ring(file, stamp)
    return ring.model(None if mistuning is None else mistuning.deviations(ring.sectors))
