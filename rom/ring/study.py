"""Amplification of a mistuned ring: one draw, and the statistics of many."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Annotated, Any, ClassVar, NamedTuple, Protocol, cast

import numpy as np

from vanedamp.files.record import Array, Record
from vanedamp.rom.ring.deviations import Deviations, RingError
from vanedamp.rom.ring.extremes import Weibull, quantile, weibull
from vanedamp.rom.ring.families import Families
from vanedamp.rom.ring.forced import Natural, OfModel, OrderResponse, natural_of, participation
from vanedamp.rom.ring.ring_model import RingModel
from vanedamp.rom.ring.sector_ring import SectorRing
from vanedamp.rom.ring.whitehead import whitehead_bound

#: probabilities of the quantiles of a study
PROBABILITIES = (0.5, 0.95, 0.99)
# relative margins of the band about the frequencies of a family
_MARGIN = 0.05


class Amplification(NamedTuple):
    """Largest amplitude over the sectors of a mistuned ring, and over the tuned ring's.

    factor        largest amplitude over the tuned ring's
    sector        of the largest amplitude
    frequency_hz  of the largest amplitude
    amplitude     m/N
    participation number of sectors that take part in the response there (rom.ring.forced.participation)
    """

    factor: float
    sector: int
    frequency_hz: float
    amplitude: float
    participation: float


class DeviationTable(Protocol):
    """Source of drawn deviations: a scene's or a case's table [mistuning], a dataclass."""

    @property
    def seed(self) -> int:
        """Seed of the draw."""

    def deviations(self, sectors: int) -> Deviations:
        """Return deviations of so many sectors."""


_OverOrders = ("order",)
_OverDraws = ("order", "seed")
_OfDraw = Annotated[np.ndarray, Array(("sector",))]


@dataclass(frozen=True, eq=False, repr=False)
class MistuningStudy(Record):
    """Amplification of a ring under engine orders, over draws of its deviations."""

    KIND: ClassVar[str] = "mistuning"
    IN_JSON = ("sectors", "label", "band_hz")
    sectors: int
    """N"""
    label: str
    """interface label where forces act and responses are taken"""
    orders: Annotated[np.ndarray, Array(_OverOrders, dtype=np.int64)]
    """engine orders"""
    seeds: Annotated[np.ndarray, Array(("seed",), dtype=np.int64)]
    """seeds of the draws"""
    band_hz: Annotated[np.ndarray, Array(("edge",), "Hz")]
    """band in which peaks count, over all draws"""
    tuned_amplitude: Annotated[np.ndarray, Array(_OverOrders, "m/N")]
    """largest amplitude of the tuned ring"""
    tuned_frequency_hz: Annotated[np.ndarray, Array(_OverOrders, "Hz")]
    """where it is"""
    amplification: Annotated[np.ndarray, Array(_OverDraws)]
    """largest amplitude of a sector over the tuned one"""
    peak_frequency_hz: Annotated[np.ndarray, Array(_OverDraws, "Hz")]
    """where it is"""
    worst_sector: Annotated[np.ndarray, Array(_OverDraws, dtype=np.int64)]
    """where it is"""
    participation: Annotated[np.ndarray, Array(_OverDraws)]
    """sectors that take part in the response there: 1 to N"""
    frequencies_hz: Annotated[np.ndarray, Array(("frequency",), "Hz")]
    """frequencies of the following responses"""
    amplitude: Annotated[np.ndarray, Array(("order", "frequency", "sector"), "m/N")]
    """amplitude of the first draw"""
    amplitude_tuned: Annotated[np.ndarray, Array(("order", "frequency"), "m/N")]
    """amplitude of the tuned ring"""
    stiffness: _OfDraw
    """deviations of the first draw"""
    mass: _OfDraw
    """mass deviations of the first draw"""
    damping: _OfDraw
    """the same of its damping"""
    provenance: Mapping[str, Any] = field(default_factory=dict)

    @property
    def bound(self) -> float:
        """Whitehead's bound of the amplification."""
        return whitehead_bound(self.sectors)

    def fit(self, order: int) -> Weibull | None:
        """Return Weibull's distribution of the amplification under the engine order of that index.

        None for fewer than ten draws, equal ones, or one beyond the bound, as several families of modes allow.
        """
        try:
            return weibull(self.amplification[order], self.bound)
        except RingError:
            return None

    def derived(self) -> dict[str, Any]:
        """Return the results by order: largest, mean, quantiles with intervals, and the fit."""
        rows = []
        for index, order in enumerate(self.orders.tolist()):
            factors, fit = self.amplification[index], self.fit(index)
            worst = int(np.argmax(factors))
            quantiles = [(probability, *quantile(factors, probability)) for probability in PROBABILITIES]
            rows.append({
                "order": order,
                "tuned_amplitude": float(self.tuned_amplitude[index]),
                "tuned_frequency_hz": float(self.tuned_frequency_hz[index]),
                "amplification": {"largest": float(factors[worst]), "mean": float(factors.mean())},
                "worst": {"seed": int(self.seeds[worst]), "sector": int(self.worst_sector[index, worst]),
                          "frequency_hz": float(self.peak_frequency_hz[index, worst]),
                          "participation": float(self.participation[index, worst])},
                "quantiles": [
                    {"probability": probability, "value": value, "low": low, "high": high,
                     "weibull": None if fit is None else fit.quantile(probability)}
                    for probability, value, low, high in quantiles
                ],
                "weibull": None if fit is None else asdict(fit),
            })  # fmt: skip
        return {"seeds": len(self.seeds), "whitehead_bound": self.bound, "orders": rows}


def amplification(
    ring: RingModel | SectorRing, deviations: Deviations, order: int, label: str,
    band_hz: Sequence[float] | None = None, speed: float = 0.0,
) -> Amplification:  # fmt: skip
    """Return the amplification of a ring with deviations under an engine order at an interface label.

    band_hz: two frequencies between which the peaks count (default: peaks of the first family, wherever deviations move
    its modes); speed: rad/s, of a ring that rotates. The response of a RingModel includes all of its waves. Raises
    RingError, also where the response is larger at an end of the band than at any peak in it.
    """
    _check_damped(ring)
    search = _search(ring, 0, band_hz, speed)
    tuned = _Peak.of(search, natural_of(ring, speed=speed), order, label)
    return _amplified(_Peak.of(search, natural_of(ring, deviations, speed), order, label), tuned)


def mistuning_study(
    ring: RingModel | SectorRing,
    table: DeviationTable,
    orders: Sequence[int],
    seeds: int | Sequence[int],
    label: str | None = None,
    family: int = 0,
    band_hz: Sequence[float] | None = None,
    speed: float = 0.0,
    points: int = 401,
    report: Callable[[int, int], None] | None = None,
) -> MistuningStudy:
    """Return the amplification under engine orders over draws of a table of deviations.

    table    draws them (`Mistuning`)
    seeds    of the draws, or their number, from the table's seed on
    label    interface label of force and response (default: the first)
    family   whose peaks count, wherever deviations move its modes; or band_hz, two frequencies between which they do
    points   of the frequencies of the first draw's responses
    report   called with the number of draws done, and of all

    A ring that rotates turns past a load at rest: forces come earlier from sector to sector, in other rings later.
    Raises RingError, and the table's errors.
    """
    label = ring.interface[0] if label is None else label
    numbers = list(range(table.seed, table.seed + seeds)) if isinstance(seeds, int) else [int(seed) for seed in seeds]
    if not numbers or not len(orders):
        raise RingError("seeds: expected at least one draw, and one engine order")
    _check_damped(ring)
    search = _search(ring, family, band_hz, speed)
    waves = [-order if speed else order for order in orders]
    natural = natural_of(ring, speed=speed)
    nominal = [_Peak.of(search, natural, wave, label) for wave in waves]
    bands, first, amplifications = [search.band(natural)], None, []
    for done, seed in enumerate(numbers):
        if report is not None:
            report(done, len(numbers))
        deviations = cast("DeviationTable", replace(cast("Any", table), seed=seed)).deviations(ring.sectors)
        natural = natural_of(ring, deviations, speed)
        try:
            peaks = [_Peak.of(search, natural, wave, label) for wave in waves]
        except RingError as error:
            raise RingError(f"{error} (seed {seed})") from error
        first = first or (deviations, peaks)
        bands.append(search.band(natural))
        amplifications.append([_amplified(peak, tuned) for peak, tuned in zip(peaks, nominal, strict=True)])
    assert first is not None
    drawn, peaks = first
    columns = np.array(amplifications, dtype=float).transpose(2, 1, 0)  # fields of Amplification, orders, draws
    band = np.array([min(low for low, _ in bands), max(high for _, high in bands)])
    frequencies = np.linspace(band[0], band[1], points)
    return MistuningStudy(
        sectors=ring.sectors, label=label, orders=np.array(orders), seeds=np.array(numbers),
        band_hz=band, tuned_amplitude=np.array([peak.amplitude for peak in nominal]),
        tuned_frequency_hz=np.array([peak.frequency_hz for peak in nominal]),
        amplification=columns[0], worst_sector=columns[1], peak_frequency_hz=columns[2], participation=columns[4],
        frequencies_hz=frequencies, amplitude=np.abs([peak.response.at(frequencies) for peak in peaks]),
        amplitude_tuned=np.abs([peak.response.at(frequencies)[:, 0] for peak in nominal]),
        **{name: drawn.of(name, ring.sectors) for name in ("stiffness", "mass", "damping")},
        provenance={"ring": dict(ring.provenance), "speed": speed},
    )  # fmt: skip


class _PeakScope(NamedTuple):
    """Where peaks count: at the modes of a family, wherever a draw has them, or in a given band, Hz."""

    families: Families
    family: int
    band_hz: tuple[float, float] | None

    def modes(self, natural: Natural | OfModel) -> np.ndarray | None:
        """Return the natural modes of the family; None: all."""
        if self.band_hz is not None:
            return None
        members = np.flatnonzero(self.families.of_modes(natural.shapes) == self.family)
        if not len(members):
            raise RingError(f"family: deviations leave no mode of family {self.family + 1}; give band_hz")
        return members

    def band(self, natural: Natural | OfModel) -> tuple[float, float]:
        """Return the edges of the band, Hz, given or about the modes of the family."""
        modes = self.modes(natural)
        if modes is None:
            assert self.band_hz is not None
            return self.band_hz
        frequencies = np.sqrt(natural.squares[modes]) / (2.0 * np.pi)
        return float((1.0 - _MARGIN) * frequencies.min()), float((1.0 + _MARGIN) * frequencies.max())


def _search(ring: RingModel | SectorRing, family: int, band_hz: Sequence[float] | None, speed: float) -> _PeakScope:
    """Return where peaks count. Raises RingError for a family that the ring does not have."""
    families, count = ring.tuned_families(speed), ring.modes // ring.sectors
    if band_hz is not None:
        return _PeakScope(families, 0, (float(band_hz[0]), float(band_hz[1])))
    if not 0 <= family < count:
        raise RingError(f"family: the ring has families 0 to {count - 1}, not {family}")
    return _PeakScope(families, family, None)


class _Peak(NamedTuple):
    """The largest peak of a ring's response to an engine order."""

    response: OrderResponse
    amplitude: float
    sector: int
    frequency_hz: float

    @classmethod
    def of(cls, search: _PeakScope, natural: Natural | OfModel, order: int, label: str) -> _Peak:
        """Return the largest peak where peaks count.

        Raises RingError where there is none, or where the response is larger at an end of the band.
        """
        response, band = natural.forced(order, label), search.band(natural)
        amplitudes, frequencies = response.peaks(*band, search.modes(natural))
        if np.all(np.isnan(amplitudes)):
            scope, remedy = f"of family {search.family + 1}", "take another family (--family), or"
            if search.band_hz:
                scope, remedy = f"between {band[0]:.6g} and {band[1]:.6g} Hz", "take another band_hz, or"
            raise RingError(
                f"label: {label!r} has no peak {scope} under order {abs(order)}; {remedy} an interface coordinate that "
                "its modes move"
            )
        sector = int(np.nanargmax(amplitudes))
        if search.band_hz and np.abs(response.at(np.array(band))).max() > amplitudes[sector]:
            raise RingError(
                f"band_hz: under order {abs(order)}, the response is larger at an end of the band "
                "than at any peak in it; take a band whose ends are apart from resonances"
            )
        return cls(response, float(amplitudes[sector]), sector, float(frequencies[sector]))


def _check_damped(ring: RingModel | SectorRing) -> None:
    if not ring.damping_ratio > 0.0:
        raise RingError("damping_ratio: an undamped ring has no peaks to compare; give it damping")


def _amplified(peak: _Peak, tuned: _Peak) -> Amplification:
    there = peak.response.at(np.array([peak.frequency_hz]))[0]
    taking_part = float(participation(there[:, None])[0])
    return Amplification(peak.amplitude / tuned.amplitude, peak.sector, peak.frequency_hz, peak.amplitude, taking_part)
