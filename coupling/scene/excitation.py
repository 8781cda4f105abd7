"""Loads of a scene: the excitation, and gravity."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from pydantic import Field
from pydantic.dataclasses import dataclass

from vanedamp.coupling.scene.load_pattern import Load, pattern_loads, repeated
from vanedamp.coupling.scene.registration import AnyWaveform
from vanedamp.coupling.scene.waveform import Waveform
from vanedamp.coupling.tangents.dual import cos, radians, rect, scalar, sin, values
from vanedamp.coupling.tangents.opaque import opaque
from vanedamp.files.store import file_stamp
from vanedamp.files.toml_input import STRICT, Direction, NonNegative, Positive, Real, Whole


@dataclass(frozen=True, config=STRICT)
class Harmonic:
    """One sine of an excitation: amplitude sin(order 2 pi f t + phase), times the level."""

    order: Annotated[Whole, Field(gt=0)]
    """multiple of the frequency"""
    amplitude: NonNegative
    """amplitude relative to the level [-]"""
    phase: Real = 0.0
    """phase of the sine [degree]"""

    @property
    def share(self) -> complex:
        """Complex amplitude relative to a sine of amplitude 1 and phase 0."""
        share: complex = rect(self.amplitude, radians(self.phase))
        return share


@dataclass(frozen=True, config=STRICT)
class Excitation:
    """Periodic excitation by one of `force`, `base_acceleration`, `resonance_amplitude`, `load` and `pattern`.

    With a plain sine the load is the level times sin(2 pi f t). resonance_amplitude speaks of a sine of order 1 and
    amplitude 1; with an engine order and a range of `resonance_near` its resonance is the one that the order's line
    meets, at the speed where it does. Forces of `load` and `pattern` are relative beside it.
    """

    frequency: Positive | None = None
    """frequency, the inverse of the period; or give `engine_order` [Hz]"""
    engine_order: Positive | None = None
    """periods a revolution, in place of the frequency, which then follows the speed of [rotation] [-]"""
    force: NonNegative | None = None
    """amplitude of the force at `at`, positive towards the right walls; the level of harmonics and waveform [N]"""
    base_acceleration: NonNegative | None = None
    """amplitude of the acceleration of the base, in place of a force; all motion is relative to the base [m/s^2]"""
    resonance_amplitude: Positive | None = None
    """amplitude to which the force, found from it, brings a resonance without bodies [m]"""
    resonance_near: Positive | tuple[Positive, Positive] | None = None
    """frequency near that resonance, or [lowest, highest]; of several the one that responds most (default: the
    frequency, or its range in a sweep) [Hz]"""
    at: str | None = None
    """interface label of a reduced model where the force acts and the response is taken; in a ring "tip" is "tip@0" """
    wave: Whole | None = None
    """the force acts in all sectors of a ring, in sector j of N later by 360 wave j/N degrees, harmonics by multiples
    of that (default: minus a whole engine_order: a ring that turns meets a load at rest the earlier, the larger j)"""
    harmonic: tuple[Harmonic, ...] = ()
    """sines whose sum excites; that of order 1 has amplitude 1 and phase 0 unless it is among them"""
    waveform: AnyWaveform | None = None
    """another signal over the period in place of the sines"""
    base_direction: Direction | None = None
    """direction of the base's motion in a reduced model's axes, of any length (default: that of `at`) [-]"""
    load: tuple[Load, ...] = ()
    """forces at several interface labels, in place of the one at `at`"""
    pattern: str | None = None
    """CSV file of such forces, with the columns at, order, force, phase_deg"""
    load_factor: NonNegative | None = None
    """factor of all forces of `load` or `pattern` (default: 1) [-]"""

    def __post_init__(self) -> None:
        self._check_period()
        given = [self.force, self.base_acceleration, self.resonance_amplitude]
        if sum(value is not None for value in given) > 1:
            raise ValueError("give at most one of force, base_acceleration and resonance_amplitude")
        self._check_loads()
        if isinstance(self.resonance_near, tuple) and self.resonance_near[0] > self.resonance_near[1]:
            low, high = self.resonance_near
            raise ValueError(f"resonance_near: expected [lowest, highest], not [{low:g}, {high:g}]")
        orders = [harmonic.order for harmonic in self.harmonic]
        for index, order in enumerate(orders):
            if order in orders[:index]:
                raise ValueError(f"harmonic[{index}].order: {order} is given twice; orders must differ")
        if self.waveform is not None and self.harmonic:
            raise ValueError("give one of harmonic and waveform")

    def _check_period(self) -> None:
        """Raise ValueError unless one thing says how long the period is."""
        if self.waveform is not None and self.waveform.timed:
            if self.engine_order is not None:
                raise ValueError(f'engine_order: the period is that of shape = "{self.waveform.shape}"; leave it out')
        elif (self.frequency is None) == (self.engine_order is None):
            raise ValueError("give one of frequency (Hz) and engine_order (periods a revolution)")

    def _check_loads(self) -> None:
        """Raise ValueError for loads next to keys that they replace, and for keys that belong to something left out."""
        if self.base_direction is not None and (self.distributed or self.force or self.resonance_amplitude):
            raise ValueError("base_direction: is that of base_acceleration; leave it out")
        if not self.distributed:
            if self.load_factor is not None:
                raise ValueError("load_factor: is that of load or pattern; give one of them")
            return
        if self.load and self.pattern is not None:
            raise ValueError("give one of load and pattern")
        name = "load" if self.load else "pattern"
        for other in ("force", "base_acceleration", "harmonic", "waveform", "wave"):
            if getattr(self, other) not in (None, ()):
                raise ValueError(f"give one of {name} and {other}")
        if self.load_factor is not None and self.resonance_amplitude is not None:
            raise ValueError("give one of load_factor and resonance_amplitude, which finds it")
        if fault := repeated({f"load[{index}]": load for index, load in enumerate(self.load)}):
            raise ValueError(fault)

    @property
    def travelling(self) -> int | None:
        """Engine order of the wave by which a force loads a ring; None: it acts at one label."""
        if (self.force is None and self.resonance_amplitude is None) or self.distributed:
            return None
        order = self.engine_order
        return self.wave if self.wave is not None or order is None or order % 1.0 else -int(order)

    @property
    def distributed(self) -> bool:
        """Whether forces at several interface labels excite, rather than one at `at` or the base."""
        return bool(self.load) or self.pattern is not None

    @property
    def level(self) -> float:
        """Amplitude of the force, N, or factor of the loads, as far as they are given."""
        if self.distributed:
            return 1.0 if self.load_factor is None else self.load_factor
        return 0.0 if self.force is None else self.force

    @property
    def loads(self) -> dict[str, Load]:
        """The forces at interface labels, by the place that names them in messages. Raises InputError for the file."""
        if self.pattern is not None:
            return pattern_loads(self.pattern, file_stamp(self.pattern))
        return {f"excitation.load[{index}]": load for index, load in enumerate(self.load)}

    @property
    def shares(self) -> dict[int, complex]:
        """Complex amplitudes of the sines by their orders, 1 first: it is there even if it has none.

        They multiply the level. Loads have amplitudes of their own, and no others: zeros, by their orders.
        For a `signal`, its Fourier series, which drive no run (Waveform.harmonics).
        """
        if self.waveform is not None:
            shares: dict[int, complex] = opaque(lambda signal: signal.harmonics(), self.waveform)
            return shares
        if self.distributed:
            orders = {load.order for load in self.loads.values() if load.force}
            return dict.fromkeys(sorted({1} | orders), 0.0j)
        given = {1: 1.0 + 0.0j} | {harmonic.order: harmonic.share for harmonic in self.harmonic}
        return {order: given[order] for order in sorted(given) if order == 1 or given[order]}

    @property
    def signal(self) -> Waveform | None:
        """The waveform that is no finite sum of sines, known by its values only; None for a sum."""
        return self.waveform if self.waveform is not None and self.waveform.shares is None else None


def pulled(field: np.ndarray, cavity: np.ndarray, normal: np.ndarray | None) -> tuple[float, float]:
    """Return the parts of a field (3,) along a cavity and across it, as of Gravity.components."""
    across = np.linalg.norm(np.cross(field, cavity)) if normal is None else -field @ normal
    return scalar(field @ cavity), scalar(across)


@dataclass(frozen=True, config=STRICT)
class Gravity:
    """Gravity, by its angle to all cavities, or by its direction in space."""

    acceleration: NonNegative = 9.81
    """acceleration of gravity [m/s^2]"""
    orientation_deg: Real = 0.0
    """angle to all cavities: 0 presses the bodies on the floor, 90 pulls them along the cavity to its left wall
    [degree]"""
    direction: Direction | None = None
    """direction in a reduced model's axes, of any length, in place of the angle [-]"""

    def __post_init__(self) -> None:
        if self.direction is not None and self.orientation_deg != 0.0:
            raise ValueError("give one of orientation_deg and direction")

    def components(self, cavity: np.ndarray, normal: np.ndarray | None = None) -> tuple[float, float]:
        """Return the acceleration (m/s^2) along a cavity, positive to the right, and across it, pressing on its floor.

        cavity: (3,) unit vector from its left wall to its right one; normal: (3,) from its floor to its ceiling, None
        where it is not known. Both are without meaning for gravity by an angle. Gravity by a direction presses a body
        on its floor, whichever side that is unless the normal tells.
        """
        if self.direction is None:
            angle = radians(self.orientation_deg)
            along, across = -sin(angle), cos(angle)
        else:
            down = np.array(self.direction) / np.linalg.norm(self.direction)
            along, across = pulled(down, cavity, normal)
        if abs(across) < 1e-15:  # upright is upright
            across = across - values(across)
        return self.acceleration * along, self.acceleration * across
