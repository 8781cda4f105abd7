"""Linear response of every sector of a ring to an engine order, its peaks, and localised modes.

An engine order r loads sector j by F sin(omega t - 2 pi r j / N). Responses are sums over poles,

    U(omega) = sum of residues / (i omega - pole) + residual,

U the complex amplitudes (N,) with the phase of the load on sector 0 as reference.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy import linalg

from vanedamp.files import store
from vanedamp.rom.reduced import ReducedModel
from vanedamp.rom.ring.deviations import Deviations, RingError
from vanedamp.rom.ring.placement import sector_label
from vanedamp.rom.ring.ring_model import RingModel
from vanedamp.rom.ring.sector_ring import SectorRing

# half-bandwidths around every resonance at which a response is sampled, halvings of the bracket of a peak, and the
# fraction of a peak that the nearest sample has at least
_AROUND = np.array([-4.0, -2.0, -1.0, -0.5, -0.25, 0.0, 0.25, 0.5, 1.0, 2.0, 4.0])
_ROUNDS = 16
_NEAR = 0.8


@dataclass(frozen=True, eq=False)
class OrderResponse:
    """Response of N sectors over the frequency.

    poles (p,) rad/s; residues (p, N); residual (N,) m: per force F of 1 N; modes (p,): the natural mode of each pole.
    """

    poles: np.ndarray
    residues: np.ndarray
    residual: np.ndarray
    modes: np.ndarray

    def __post_init__(self) -> None:
        for name in ("poles", "residues", "residual"):
            object.__setattr__(self, name, store.frozen(getattr(self, name), complex))

    def at(self, frequencies_hz: np.ndarray) -> np.ndarray:
        """Return complex amplitudes (f, N), m/N."""
        return self._contributions(frequencies_hz, slice(None)) + self.residual

    def peaks(self, low_hz: float, high_hz: float, modes: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Return the largest peak (N,), m/N, of every sector between two frequencies, and where (N,), Hz.

        A peak is a local maximum, so that none is at an end of the band; nan for a sector without one.

        modes: some natural modes; only peaks count to which they contribute more than all others.
        """
        natural, width = np.abs(self.poles), np.maximum(-self.poles.real, 1e-6 * np.abs(self.poles))
        near = (natural[:, None] + width[:, None] * _AROUND).ravel() / (2.0 * np.pi)
        grid = np.unique(np.r_[low_hz, high_hz, near[(near > low_hz) & (near < high_hz)]])
        response = self.at(grid)
        sizes = np.abs(response)
        is_peak = np.zeros(sizes.shape, bool)
        is_peak[1:-1] = (sizes[1:-1] > sizes[:-2]) & (sizes[1:-1] >= sizes[2:])
        if modes is not None:
            contribution = self._contributions(grid, np.isin(self.modes, modes))
            is_peak &= np.abs(contribution) > np.abs(response - contribution)
        # the largest sample may be of a lower peak, but not by much
        is_peak &= sizes > _NEAR * np.where(is_peak, sizes, 0.0).max(axis=0)
        index, sector = np.nonzero(is_peak)
        low, high, every = grid[index - 1], grid[index + 1], np.arange(len(index))
        for _ in range(_ROUNDS):  # the amplitude rises and falls once between neighbours of a local maximum
            points = np.linspace(low, high, 5)
            best = np.clip(np.argmax(self._amplitudes(points, sector), axis=0), 1, 3)
            low, high = points[best - 1, every], points[best + 1, every]
        middle = 0.5 * (low + high)
        largest, where = np.full(sizes.shape[1], np.nan), np.full(sizes.shape[1], np.nan)
        values = self._amplitudes(middle[None], sector)[0]
        for peak in np.argsort(values, kind="stable"):
            largest[sector[peak]], where[sector[peak]] = values[peak], middle[peak]
        return largest, where

    def _contributions(self, frequencies_hz: np.ndarray, poles: slice | np.ndarray) -> np.ndarray:
        """Return the contribution of some poles to the complex amplitudes (f, N)."""
        s = 2j * np.pi * np.asarray(frequencies_hz, dtype=float)
        return np.asarray((1.0 / (s[:, None] - self.poles[poles])) @ self.residues[poles])

    def _amplitudes(self, points: np.ndarray, sector: np.ndarray) -> np.ndarray:
        """Return amplitudes (q, c) at frequencies (q, c), each column of a sector (c,)."""
        terms = self.residues[:, sector] / (2j * np.pi * points[:, None, :] - self.poles[:, None])
        return np.abs(terms.sum(axis=1) + self.residual[sector])


def forced_response(
    model: RingModel | SectorRing | ReducedModel, order: int, frequencies_hz: np.ndarray, label: str,
    at: str | None = None, deviations: Deviations | None = None,
) -> np.ndarray:  # fmt: skip
    """Return the complex amplitudes (f, N), m/N, of every sector under an engine order of unit force at a label.

    model       a reduced ring, or the ReducedModel of a whole one
    order       the force comes later from sector to sector, earlier with a negative one
    label, at   interface labels of a sector where the force acts, and the response is taken (default: where it acts)
    deviations  of the sectors of a reduced ring

    Raises RingError for an unknown label, and a model that is no ring.
    """
    response = forced(model, order, label, at, deviations)
    return response.at(np.asarray(frequencies_hz, dtype=float))


def forced(
    model: RingModel | SectorRing | ReducedModel, order: int, label: str, at: str | None = None,
    deviations: Deviations | None = None, speed: float = 0.0,
) -> OrderResponse:  # fmt: skip
    """Return the response to an engine order over all frequencies. Arguments and errors: see `forced_response`.

    speed: of a reduced ring that rotates, rad/s.
    """
    if not isinstance(model, ReducedModel):
        return natural_of(model, deviations, speed).forced(order, label, at)
    ring = model.provenance.get("ring")
    if ring is None:
        raise RingError("model: no reduced ring; a force that turns around needs the sectors of one")
    sectors = int(ring["sectors"])
    coordinates = [
        [place_of(model.interface, sector_label(name, j)) for j in range(sectors)] for name in (label, at or label)
    ]
    phases = _phases(order, sectors)
    squares, shapes = model.natural
    rows = model.selection @ shapes
    residual = np.zeros(sectors, complex)
    if model.residual_flexibility is not None:
        residual = model.residual_flexibility[np.ix_(coordinates[1], coordinates[0])] @ phases
    damping = shapes.T @ model.damping @ shapes
    return _superposed(squares, damping, rows[coordinates[1]], rows[coordinates[0]].T @ phases, residual)


class Natural(NamedTuple):
    """All natural modes of a ring with deviations: squares (n,), shapes (n, n) in its waves, modal damping (n, n)."""

    ring: RingModel
    squares: np.ndarray
    shapes: np.ndarray
    damping: np.ndarray

    def forced(self, order: int, label: str, at: str | None = None) -> OrderResponse:
        """Return the response to an engine order. Raises RingError for an unknown label."""
        ring = self.ring
        load = self.shapes.T @ load_of(ring, order, label)
        rows = ring.rows[:, place_of(ring.interface, at or label)] @ self.shapes
        return _superposed(self.squares, self.damping, rows, load, np.zeros(ring.sectors))


class OfModel(NamedTuple):
    """The same of a ring by sectors: its reduced model, in the modes that it keeps, and their shapes (n, m)."""

    model: ReducedModel
    shapes: np.ndarray

    @property
    def squares(self) -> np.ndarray:
        """(n,) squared angular frequencies."""
        return self.model.squares

    def forced(self, order: int, label: str, at: str | None = None) -> OrderResponse:
        """Return the response to an engine order. Raises RingError for an unknown label."""
        return forced(self.model, order, label, at)


def natural_of(
    ring: RingModel | SectorRing, deviations: Deviations | None = None, speed: float = 0.0
) -> Natural | OfModel:
    """Return the natural modes of a ring with deviations, at a speed, rad/s.

    Raises RingError where it can move freely or is unstable.
    """
    deviations = deviations or Deviations()
    if isinstance(ring, SectorRing):
        # also a family above the model's families, which responds to the same forces
        return OfModel(*ring.natural(deviations, speed, min(ring.modes + ring.sectors, ring.size)))
    mass, stiffness = ring.matrices(deviations, speed)
    squares, shapes = linalg.eigh(stiffness, mass)
    if squares[0] <= 0.0:
        raise RingError("the ring can move freely, or is unstable at that speed: it has no response to compare")
    damping = np.diag(2.0 * ring.damping_ratio * np.sqrt(squares))
    if (added := ring.added_damping(deviations)) is not None:
        damping = damping + shapes.T @ added @ shapes
    return Natural(ring, squares, shapes, damping)


def _superposed(
    squares: np.ndarray, damping: np.ndarray, rows: np.ndarray, load: np.ndarray, residual: np.ndarray
) -> OrderResponse:
    """Return the response rows @ q of modes (m,) with modal damping (m, m) to modal loads (m,)."""
    count = len(squares)
    diagonal = np.diag(damping)
    if np.abs(damping - np.diag(diagonal)).max() <= 1e-9 * np.abs(damping).max():
        root = np.sqrt(0.25 * diagonal**2 - squares + 0j)
        poles = np.concatenate([-0.5 * diagonal + root, -0.5 * diagonal - root])
        shares = np.concatenate([load / (2.0 * root), -load / (2.0 * root)])
        return OrderResponse(poles, np.tile(rows.T, (2, 1)) * shares[:, None], residual, np.tile(np.arange(count), 2))
    first = np.block([[np.zeros((count, count)), np.eye(count)], [-np.diag(squares), -damping]])
    poles, vectors = linalg.eig(first)
    shares = np.linalg.solve(vectors, np.concatenate([np.zeros(count), load]))
    modes = np.argmax(np.abs(vectors[:count]), axis=0)
    return OrderResponse(poles, (rows @ vectors[:count]).T * shares[:, None], residual, modes)


def load_of(ring: RingModel, order: int, label: str) -> np.ndarray:
    """Return the load (n,), complex, of an engine order of unit force at a label on the waves of a reduced ring."""
    return np.asarray(ring.rows[:, place_of(ring.interface, label)].T @ _phases(order, ring.sectors))


def participation(shapes: np.ndarray) -> np.ndarray:
    """Return the number of sectors (m,) that take part in shapes over sectors (N, m): (sum a^2)^2 / sum a^4.

    1: one sector moves; N: all by the same amplitude; 2 N / 3: a standing wave of many sectors.
    """
    squares = np.abs(shapes) ** 2
    return np.asarray(squares.sum(axis=0) ** 2 / (squares**2).sum(axis=0))


def _phases(order: int, sectors: int) -> np.ndarray:
    """Return the factors (N,) of the load on the sectors."""
    return np.exp(-2j * np.pi / sectors * (order * np.arange(sectors) % sectors))


def place_of(labels: tuple[str, ...], label: str) -> int:
    """Return the number of an interface label. Raises RingError for an unknown one."""
    if label not in labels:
        raise RingError(f"label: no interface coordinate {label!r}; there are: {', '.join(labels)}")
    return labels.index(label)
