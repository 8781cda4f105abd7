"""The study of a life: a scene with [wear], and a [life] table with hours, frequencies and the required reduction."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, NamedTuple

import numpy as np
from pydantic import Field
from pydantic.dataclasses import dataclass

from vanedamp.coupling.methods.registry import why_no_restart
from vanedamp.coupling.model_order.choices import leaves_open
from vanedamp.coupling.quantities.amplitude import amplitude_mean
from vanedamp.coupling.response.contact_work import contact_name
from vanedamp.coupling.response.wear import ALONG, body_shares, body_volumes, opening
from vanedamp.coupling.scene.paths import Range
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.structures import Prescribed
from vanedamp.coupling.strength.spots import spots_of
from vanedamp.coupling.sweep.grid import Points
from vanedamp.coupling.system.assembly import assemble
from vanedamp.files.key_tables import documented
from vanedamp.files.store import frozen
from vanedamp.files.toml_input import STRICT, InputError, NonNegative, Positive, Real, Whole, read_toml
from vanedamp.studies.band import Band, drive, file_in, placed, reference_amplitude, scene_in
from vanedamp.studies.measure import AMPLITUDES, Measure
from vanedamp.studies.worst_start import STARTS

#: approximate number of evaluations of the band
_EVALUATIONS = 20
#: number of times that the spacing of a band is halved around its worst point
HALVINGS = 3
_Ratio = Annotated[Real, Field(gt=0, lt=1)]


@dataclass(frozen=True, config=STRICT)
class Life(Band):
    """Hours of operation, the excitation over them, and what the damper must keep."""

    TABLE: ClassVar[str] = "life"
    hours: Positive = 10_000.0
    """hours of operation [h]"""
    dwell: Literal["uniform", "peak"] | tuple[NonNegative, ...] = "uniform"
    """time spent at the points of the band: "uniform"; "peak", all at the one with the largest amplitude; or a list of
    weights [-]"""
    threshold: _Ratio = 0.5
    """reduction of the amplitude without bodies below which the damper is lost; not with `limit` [-]"""
    measure: str = amplitude_mean.name
    """what counts of a run: "amplitude_mean", mean of the peaks of its periods, or "amplitude_max", largest, without
    static deflection; with `limit` any quantity of results, such as "stress_von_mises", of several the largest"""
    limit: Positive | None = None
    """value of the measure above which the damper is lost; reductions are relative to it [its unit in results]"""
    over_band: Literal["worst", "mean"] = "worst"
    """what counts of the band's amplitudes"""
    tolerance: _Ratio = 0.02
    """error of the depths of wear by the steps over the hours, relative to the gap [-]"""
    reach: _Ratio = 0.15
    """growth of a gap in a step at most, relative to it [-]"""
    steps: Annotated[Whole, Field(gt=0, le=10_000)] | None = None
    """number of equal steps (default: as many as tolerance and reach need)"""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.limit is None and self.measure not in AMPLITUDES:
            raise ValueError(f"limit: missing; {self.measure} needs one, {' and '.join(AMPLITUDES)} do not")
        if not isinstance(self.dwell, str):
            if len(self.dwell) != self.count:
                raise ValueError(f"dwell: {len(self.dwell)} weights for {self.count} points of the band; give as many")
            if not any(self.dwell):
                raise ValueError("dwell: all weights are 0; give at least one point of the band some time")


@documented
@dataclass(frozen=True, config=STRICT, repr=False)
class LifeFile(Scene):
    """A scene with [wear], and how long it is to damp."""

    life: Life = field(kw_only=True)
    """hours of operation and the reduction to keep"""


class WearContact(NamedTuple):
    """A contact that wears: body, side and corner as of an Event; patch, m^2 (nan: unknown); share of the cavity."""

    damper: int
    side: str
    corner: int
    area: float
    share: float

    @property
    def name(self) -> str:
        """Name for people."""
        return contact_name(self.damper, self.side, self.corner)


class LifeStudy(NamedTuple):
    """A scene, its [life] table, and the reference of its curves.

    frequencies: (f,) Hz of the band. reference: amplitude without bodies in the band, m, or the limit of what counts.
    spots: names of the hot spots whose damage counts, if all have a curve of stress and life.
    """

    scene: Scene
    table: Life
    frequencies: np.ndarray
    reference: float
    measure: Measure
    spots: tuple[str, ...] = ()

    @classmethod
    def load(cls, path: str | Path) -> LifeStudy:
        """Read the study in a TOML file. Raises InputError."""
        return cls.of(read_toml(path), path)

    @classmethod
    def of(cls, tables: Mapping[str, Any], path: str | Path = "study") -> LifeStudy:
        """Return the study in the tables of a TOML file; errors name its `path`. Raises InputError."""
        file = file_in(LifeFile, tables, "life", "give hours and a band in a [life] table (docs/wear.md)", path)
        try:
            scene, band = placed(scene_in(file), file.life)
            _check(scene)
            assemble(scene)
            reference = file.life.limit or reference_amplitude(scene, band, file.life.over_band)
            named = file.life.measure if file.life.limit else AMPLITUDES[file.life.measure]
            measure = Measure.of_runs(scene, named, "life.measure")
        except InputError as error:
            raise InputError(f"{path}: {error}") from None
        if reference == 0.0:
            raise InputError(f"{path}: excitation: name force or resonance_amplitude, the level that is to be damped")
        return cls(scene, file.life, frozen(band), reference, measure, _damaged(scene))

    @property
    def threshold(self) -> float:
        """Reduction below which the damper is lost."""
        return 0.0 if self.table.limit else self.table.threshold

    @property
    def starts(self) -> int:
        """Runs from other starts, of the damper as new and as worn."""
        return 2 * len(self.frequencies) * (1 if why_no_restart(self.scene) else len(STARTS))

    @property
    def refines(self) -> bool:
        """Whether the worst point is also sought between the points of the band: not if these are a list."""
        spaced = isinstance(getattr(self.table, self.table.key), Range) and len(self.frequencies) > 1
        return spaced and (self.table.over_band == "worst" or self.table.dwell == "peak")

    @property
    def each(self) -> int:
        """Runs over the band, at most."""
        return len(self.frequencies) + 2 * HALVINGS * self.refines

    @property
    def runs(self) -> int:
        """Approximate number of runs of a life."""
        return _EVALUATIONS * self.each + self.starts

    def wearing(self, contacts: Sequence[WearContact]) -> WearEffect:
        """Return the effect of wear at contacts on the scene.

        Raises InputError for a contact that opens a gap and has no known patch.
        """
        scene = self.scene
        gap, play = opening(scene, [(contact.damper, contact.side) for contact in contacts])
        area = np.array([contact.area for contact in contacts])
        for contact in np.flatnonzero(np.isnan(area) & np.any(gap + play > 0.0, axis=0)):
            damper, side, *_ = contacts[contact]
            extent = "height" if side in ALONG else "length"
            raise InputError(
                f"wear.width: the patch of damper {damper} at {side} is not known; give wear.width and the {extent} of "
                "the body (damper or wear), or wear.area, m^2"
            )
        area = np.where(np.isnan(area), 1.0, area)
        return WearEffect(scene, gap / area, play / area, body_shares(scene, contacts))

    def points(self, scene: Scene, frequencies: Sequence[float]) -> list[Scene]:
        """Return a scene at some frequencies (f,), Hz."""
        points = Points(scene)
        return [points.scene(drive(scene, float(frequency))) for frequency in frequencies]


class WearEffect(NamedTuple):
    """Effect of volumes of wear (c,), m^3, on a scene: gaps and plays grow by matrices (cavities, c), 1/m^2.

    shares: (bodies, c) fraction of each volume that a body loses.
    """

    scene: Scene
    gap: np.ndarray
    play: np.ndarray
    shares: np.ndarray

    def gaps(self, volume: np.ndarray) -> np.ndarray:
        """Return the free travel of the cavities, m."""
        return np.array([cavity.gap for cavity in self.scene.cavity]) + self.gap @ volume

    def plays(self, volume: np.ndarray) -> np.ndarray:
        """Return the play of the cavities, m; nan without."""
        return np.array([cavity.play or np.nan for cavity in self.scene.cavity]) + self.play @ volume

    @property
    def losses(self) -> np.ndarray:
        """Fractions (bodies, c) of each body lost per volume of wear, 1/m^3; nan if its size is unknown."""
        fractions: np.ndarray = self.shares / body_volumes(self.scene)[:, None]
        return fractions

    def lost(self, volume: np.ndarray) -> np.ndarray:
        """Return the worn fraction of each body; nan if its size is unknown."""
        fractions: np.ndarray = self.losses @ volume
        return fractions

    def worn(self, volume: np.ndarray) -> Scene:
        """Return the scene with its gaps, plays and masses after some wear."""
        changes: dict[str, Any] = {}
        for cavity, gap, play in zip(self.scene.cavity, self.gaps(volume), self.plays(volume), strict=True):
            changes[f"cavity.{cavity.name}.gap"] = float(gap)
            if cavity.play is not None:
                changes[f"cavity.{cavity.name}.play"] = float(play)
        for number, (damper, lost) in enumerate(zip(self.scene.damper, self.lost(volume), strict=True)):
            if np.isfinite(lost):
                changes[f"damper.{number}.mass"] = damper.mass * (1.0 - float(lost))
        return self.scene.replace(changes)


def _damaged(scene: Scene) -> tuple[str, ...]:
    """Return the hot spots of a scene's model; none where one of them has no curve of stress and life."""
    spots = spots_of(scene)
    return tuple(spots.facts) if spots is not None and spots.have_lives else ()


def _check(scene: Scene) -> None:
    if scene.wear is None:
        raise InputError("wear: missing; give rates of wear in a [wear] table (docs/wear.md)")
    rates = [scene.wear, *scene.wear.pair]
    if not any(rate.sliding_rate or rate.impact_rate for rate in rates):
        raise InputError(
            "wear: nothing wears; give rate (1/Pa), coefficient with hardness (Pa), or impact_rate (m^3/J^n)"
        )
    if isinstance(scene.structure, Prescribed):
        raise InputError('structure: a prescribed motion is not damped; take model = "rigid" or "rom"')
    if scene.sweep:
        raise InputError("sweep: a life runs at the points of its band only; leave the table out")
    if scene.ensemble is not None and not scene.ranges:
        raise InputError("ensemble: samples ranges, of which a life has none; leave the table out")
    for number in scene.ranges:
        raise InputError(f"{number}: a range is for `vanedamp run` and `vanedamp sweep`; give one number")
    if leaves_open(scene):
        raise InputError('structure.modes, damper.shape: "auto" may change with the wear; name a number and a shape')
    if not scene.damper:
        raise InputError("damper: missing; a life is that of loose bodies")
    if scene.solver.method != "exact":
        raise InputError('solver.method: wear is accumulated by the exact engine only; take method = "exact"')
