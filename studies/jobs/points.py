"""The points of a sweep or an ensemble before they run: the number already done, and the first and last scene."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.sweep.checkpoint import SweepCheckpoint
from vanedamp.coupling.sweep.grid import Grid, Points

if TYPE_CHECKING:  # loads the ensembles, which a sweep does not use
    from vanedamp.coupling.ensembles.members import Members


def finished(checkpoint: Path | None, scene: Scene, count: int, provenance: Mapping[str, Any]) -> int:
    """Return how many of `count` points a checkpoint has. Raises InputError for that of another sweep."""
    return SweepCheckpoint(checkpoint, scene, count, provenance).finished.count


def ends_of(points: Grid | Members) -> list[Scene]:
    """Return the scenes of the first and the last point, without open choices."""
    scenes = Points(points.base, points.choices)
    return [scenes.scene(points.values(index)) for index in {0, points.size - 1}]
