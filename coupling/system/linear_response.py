"""The linear references of a damped response: free, without bodies and joints, and with bodies fixed and joints stuck.

What sticks is rigid along, or its tangential spring. Joints closed at rest are springs across, or rigid; others open.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import NamedTuple

import numpy as np
from scipy.linalg import eigh, null_space

from vanedamp.coupling.scene.rotation import Rotation, frequency_of, speed_of
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.sines import peaks
from vanedamp.coupling.system.assembly import assemble
from vanedamp.coupling.system.engine_order import Natural, crossings
from vanedamp.coupling.system.flow import attached, mass_of
from vanedamp.coupling.system.resonance import steady_motion
from vanedamp.coupling.system.system import CASING, System, on_structure
from vanedamp.coupling.system.unit_laws import SINGULAR, contacts_of
from vanedamp.files.toml_input import InputError

#: frequencies over a range, and around each resonance in half-power widths: between two of them no maximum hides
_EVEN, _AROUND = 201, np.linspace(-3.0, 3.0, 25)
#: local maxima that are refined; the others are lower
_REFINED = 3
#: half-power widths around a crossing of an engine order that contain the peak of its resonance
_WIDTHS = 3.0


class LinearPeak(NamedTuple):
    """Largest amplitude over a range: its frequency (Hz), height (m), and the half-power width 2 zeta f there (Hz).

    The height is infinite where a resonance without damping lies in the range.
    """

    frequency: float
    amplitude: float
    width: float


@dataclass(frozen=True, eq=False)
class LinearResponse:
    """A linear structure with n modes under its excitation, of e harmonics.

    load (e, n) complex and response (n,) in modal coordinates; stiffness (k,), damping (k, k) and mass (k, k) in those
    left; shape: (n, k) modal coordinates by these (None: the same); table (e,): complex displacements of a prescribed
    motion, m; order (e,) of the harmonics, as multiples of the frequency.
    """

    stiffness: np.ndarray
    damping: np.ndarray
    mass: np.ndarray
    load: np.ndarray
    response: np.ndarray
    table: np.ndarray
    order: np.ndarray
    shape: np.ndarray | None = None

    def amplitude(self, frequencies: np.ndarray, load: np.ndarray | None = None) -> np.ndarray:
        """Return amplitudes of the response (f,), m, at frequencies (f,), Hz; of harmonics the peak per period.

        load: (f, e, n) at each instead of its own. Infinite at a frequency that is, to the last bit, a
        resonance without damping. The same digits for one frequency as for many.
        """
        return self.heights(self.motions(frequencies, load))

    def heights(self, motions: np.ndarray) -> np.ndarray:
        """Return amplitudes of the response (f,), m, of `motions`."""
        waves = ((motions * self.response).sum(axis=-1) + self.table).T
        finite = np.isfinite(waves).all(axis=0)
        amplitude = np.full(len(finite), np.inf)
        amplitude[finite] = np.abs(waves[0, finite]) if len(waves) == 1 else peaks(waves[:, finite], self.order)
        return amplitude

    def amplitudes(self, frequency: float, rows: np.ndarray) -> np.ndarray:
        """Return amplitudes (s,) of functionals (s, n) instead of the response, at a frequency, Hz.

        Infinite at a frequency that is, to the last bit, a resonance without damping.
        """
        try:
            waves = self.motion(frequency) @ rows.T
        except np.linalg.LinAlgError:
            return np.full(len(rows), np.inf)
        return np.abs(waves[0]) if len(waves) == 1 else peaks(waves, self.order)

    def motion(self, frequency: float) -> np.ndarray:
        """Return the complex modal coordinates (e, n) of the harmonics at a frequency, Hz.

        Raises LinAlgError at a resonance without damping.
        """
        return self.steady(self.load, 2 * np.pi * frequency * self.order)

    def motions(self, frequencies: np.ndarray, load: np.ndarray | None = None) -> np.ndarray:
        """Return the same (f, e, n) at frequencies (f,), infinite there; arguments as of `amplitude`."""
        frequencies = np.asarray(frequencies, float)
        loads = np.broadcast_to(self.load if load is None else load, (len(frequencies), *self.load.shape))
        return np.stack([self._motion(h, frequencies, loads[:, h]) for h in range(len(self.order))], axis=1)

    def _motion(self, h: int, frequencies: np.ndarray, load: np.ndarray) -> np.ndarray:
        """Return those of harmonic h (f, n); load: (f, n)."""
        omega = 2 * np.pi * self.order[h] * frequencies
        try:
            return self.steady(load, omega)
        except np.linalg.LinAlgError:
            if len(frequencies) == 1:
                return np.full(load.shape, complex(np.inf))
            halves = (np.array_split(part, 2) for part in (frequencies, load))
            return np.concatenate([self._motion(h, *half) for half in zip(*halves, strict=True)])

    def steady(self, load: np.ndarray, omega: np.ndarray) -> np.ndarray:
        """Return modal coordinates (f, n) under modal forces (n,) or (f, n) at angular frequencies (f,)."""
        if self.shape is None:
            return steady_motion(self.stiffness, self.damping, self.mass, load, omega)
        # products of matrices have other digits for one frequency than for many
        loads = np.einsum("...n,nk->...k", load, self.shape)
        return np.einsum("fk,nk->fn", steady_motion(self.stiffness, self.damping, self.mass, loads, omega), self.shape)

    def peak(self, low: float, high: float) -> LinearPeak:
        """Return the largest amplitude from low to high, Hz, to round-off; at an end where no resonance is higher."""
        natural, widths = self.resonances()
        inside = (natural >= low) & (natural <= high)
        for frequency in natural[inside & (widths == 0.0)]:
            return LinearPeak(float(frequency), math.inf, 0.0)
        grid = self.grid(low, high)
        heights = self.amplitude(grid)
        padded = np.concatenate([[-1.0], heights, [-1.0]])
        tops = np.flatnonzero((heights >= padded[:-2]) & (heights >= padded[2:]))
        tops = tops[np.argsort(heights[tops], kind="stable")[::-1][:_REFINED]]
        amplitude, frequency = max(self._refined(grid, heights, int(top)) for top in tops)
        width = float(widths[np.argmin(np.abs(natural - frequency))]) if len(natural) else 0.0
        return LinearPeak(frequency, amplitude, width)

    def grid(self, low: float, high: float) -> np.ndarray:
        """Return frequencies (k,), Hz, from low to high between which the amplitude hides no maximum."""
        natural, widths = self.resonances()
        near = (natural[:, None] + widths[:, None] * _AROUND)[widths > 0.0].ravel()
        return np.unique(np.concatenate([np.linspace(low, high, _EVEN), np.clip(near, low, high)]))

    def _refined(self, grid: np.ndarray, heights: np.ndarray, top: int) -> tuple[float, float]:
        """Return height and frequency of the maximum around a point of the grid; that point at an edge."""
        from scipy.optimize import minimize_scalar

        peak = float(heights[top]), float(grid[top])
        if 0 < top < len(grid) - 1:
            refined = minimize_scalar(
                lambda frequency: -float(self.amplitude(np.array([frequency]))[0]),
                bounds=(grid[top - 1], grid[top + 1]), method="bounded", options={"xatol": 1e-9 * grid[top]},
            )  # fmt: skip
            peak = max(peak, (-float(refined.fun), float(refined.x)))
        return peak

    @property
    def natural(self) -> tuple[np.ndarray, np.ndarray]:
        """Squared undamped angular frequencies (k,), and mass-normalised shapes (k, k)."""
        return eigh(np.diag(self.stiffness), self.mass) if len(self.mass) else (np.zeros(0), self.mass)

    def resonances(self) -> tuple[np.ndarray, np.ndarray]:
        """Return frequencies at which a harmonic meets a natural one, and half-power widths there (e n,), Hz."""
        squares, shapes = self.natural
        widths = np.einsum("ik,ij,jk->k", shapes, self.damping, shapes) / (2 * np.pi)
        natural = np.sqrt(np.maximum(squares, 0.0)) / (2 * np.pi)
        return np.divide.outer(natural, self.order).ravel(), np.divide.outer(widths, self.order).ravel()


def linear_amplitudes(scene: Scene, frequencies: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the amplitudes (f,) of `linear_responses`, m, at frequencies (f,), Hz, of the scene's engine order if any.

    Raises InputError as that does.
    """
    order = scene.excitation.engine_order
    if order is None:
        free, fixed = (response.amplitude(frequencies) for response in linear_responses(scene))
        return free, fixed
    curves = []
    for frequency in frequencies:
        turning = replace(scene, rotation=Rotation(speed=speed_of(order, frequency)))
        curves.append([response.amplitude(np.array([frequency]))[0] for response in linear_responses(turning)])
    free, fixed = np.transpose(curves)
    return free, fixed


def linear_peaks(scene: Scene, low: float, high: float) -> tuple[LinearPeak, LinearPeak]:
    """Return the peaks of `linear_responses` from low to high: Hz, or rad/s along the scene's engine order.

    Raises InputError as that does.
    """
    order = scene.excitation.engine_order
    if order is None:
        free, fixed = (response.peak(low, high) for response in linear_responses(scene))
        return free, fixed

    @cache
    def at(speed: float) -> tuple[LinearResponse, LinearResponse]:
        return linear_responses(replace(scene, rotation=Rotation(speed=speed)))

    return peak_along(lambda x: at(x)[0], order, low, high), peak_along(lambda x: at(x)[1], order, low, high)


def peak_along(response: Callable[[float], LinearResponse], order: float, low: float, high: float) -> LinearPeak:
    """Return the largest amplitude of a linear response along an engine order from low to high, rad/s.

    response: at a speed, rad/s. Frequency and half-power width of the peak refer to the line, Hz; it lies at an
    end where no resonance in the range is higher.
    """

    def amplitude(speed: float) -> float:
        return float(response(speed).amplitude(np.array([frequency_of(order, speed)]))[0])

    def natural(speed: float) -> np.ndarray:
        return np.sort(response(speed).resonances()[0])

    from scipy.optimize import minimize_scalar

    best = max((amplitude(speed), speed, 0.0) for speed in (low, high))
    for speed, width in _resonances(response, natural, order, low, high):
        if width == 0.0:
            return LinearPeak(frequency_of(order, speed), math.inf, 0.0)
        around = speed_of(order, _WIDTHS * width)
        bounds = (max(low, speed - around), min(high, speed + around))
        top = minimize_scalar(lambda x: -amplitude(x), bounds=bounds, method="bounded", options={"xatol": 1e-9 * speed})
        best = max(best, (-float(top.fun), float(top.x), width))
    height, speed, width = best
    return LinearPeak(frequency_of(order, speed), height, width)


def _resonances(
    response: Callable[[float], LinearResponse], natural: Natural, order: float, low: float, high: float
) -> Iterator[tuple[float, float]]:
    """Yield the crossings of an engine order, rad/s, and the half-power widths along it, Hz."""
    for speed in crossings(natural, partial(frequency_of, order), low, high):
        frequencies, widths = response(speed).resonances()
        line = frequency_of(order, speed)
        nearest = int(np.argmin(np.abs(frequencies - line)))
        step = 1e-4 * speed * (1.0 if speed + 1e-4 * speed <= high else -1.0)
        mode = int(np.argmin(np.abs(natural(speed) - line)))
        # a natural frequency that rises with the line stays near it for longer
        rise = (natural(speed + step)[mode] - natural(speed)[mode]) / frequency_of(order, step)
        yield speed, float(widths[nearest] / max(abs(1.0 - rise), 1e-3))


def linear_responses(scene: Scene, system: System | None = None) -> tuple[LinearResponse, LinearResponse]:
    """Return the free response, and that with bodies fixed and joints stuck. system: of the scene.

    Raises InputError, also for an excitation that is no sum of sines: the peak that a truncated Fourier series leaves
    out has no bound that holds for every waveform.
    """
    if scene.excitation.signal is not None:
        raise InputError("excitation.waveform: linear curves are those of sums of sines; give harmonics")
    system = assemble(scene) if system is None else system
    return linear_response(system, False), linear_response(system, True)


def linear_response(system: System, fixed: bool, across: bool = False) -> LinearResponse:
    """Return the response without bodies and joints, or with bodies fixed and joints stuck, to the harmonics.

    across: whether fixed bodies follow their floors across the cavity and in its rotation, too.
    """
    modes, order = system.of_structure, system.order
    motions = attached(system, np.full(system.bodies, fixed), across=across)
    moves = np.flatnonzero(system.load.any(axis=1) | (system.table != 0) | (order == order[-1]))
    response = LinearResponse(
        modes.stiffness, modes.damping, mass_of(system, motions), (system.load @ motions)[moves], modes.response,
        system.table[moves], order[moves],
    )  # fmt: skip
    rows, spring, dashpot = _stuck(system)
    return _held(response, rows, spring, dashpot) if fixed and len(rows) else response


def _held(free: LinearResponse, rows: np.ndarray, spring: np.ndarray, dashpot: np.ndarray) -> LinearResponse:
    """Return a response with motions (r, n) held by springs and dashpots (r,), or rigidly."""
    yields = np.isfinite(spring)
    soft, rigid, mass = rows[yields], rows[~yields], free.mass
    stiffness = np.diag(free.stiffness) + (spring[yields] * soft.T) @ soft
    # neighbours around a ring may hold each other twice
    left = null_space(np.vstack([rigid, 0.0 * free.response]), rcond=SINGULAR)
    if not left.size:
        return replace(free, stiffness=np.zeros(0), damping=left.T @ left, mass=left.T @ left, shape=left)
    squares, shapes = eigh(left.T @ stiffness @ left, left.T @ mass @ left)
    shape = left @ shapes
    damping = shape.T @ (free.damping + (dashpot[yields] * soft.T) @ soft) @ shape
    return replace(free, stiffness=squares, damping=damping, mass=np.eye(len(squares)), shape=shape)


def _stuck(system: System) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return what joints and friction dampers hold that stick: motions (r, n), springs and dashpots (r,), inf: rigid.

    Whatever their friction; joints with a gap at rest are open.
    """
    u, n = len(system.rest), system.modes
    contact, J = contacts_of(system), on_structure(system).J[:, :n]
    # friction dampers have units only with friction
    sticks = system.without_body & J[u:].any(axis=1) & (~contact | (system.rest <= 0.0)) & (system.surface != CASING)
    across, along = sticks & contact, np.full(u, np.inf)
    along[system.sprung] = system.tangential
    rows = np.concatenate([J[:u][across], J[u:][sticks], system.casing[:, :n]])
    spring = np.concatenate([system.spring[across], along[sticks], system.casing_spring])
    dashpot = np.zeros(len(rows))
    dashpot[: across.sum()] = system.dashpot[across]
    moves = rows.any(axis=1)
    return rows[moves], spring[moves], dashpot[moves]


def fixed_mode(system: System, motion: np.ndarray) -> tuple[float, np.ndarray]:
    """Return angular frequency, rad/s, and shape (n,) of the fixed mode most like a motion (n,); nan, zeros: none."""
    fixed = linear_response(system, True)
    squares, shapes = fixed.natural
    if not len(squares):
        return math.nan, np.zeros(system.modes)
    shapes = shapes if fixed.shape is None else fixed.shape
    like = int(np.argmax(np.abs(motion @ shapes)))
    return float(np.sqrt(squares[like])), shapes[:, like]


def receptance(scene: Scene, frequencies: np.ndarray, fixed: bool = False) -> np.ndarray:
    """Return the complex displacement of the response per newton at `excitation.at`, m/N, shape (f,).

    Free, or (`fixed`) with bodies fixed and joints stuck.
    """
    held = linear_response(assemble(scene), fixed)
    return np.asarray(held.steady(held.response, 2 * np.pi * np.asarray(frequencies)) @ held.response)
