"""The linear transient: its length is known before a run.

From rest, each mode of the structure with attached bodies starts with its steady amplitude missing, and the
difference decays at the mode's own rate (system.linear_modes). At its resonance a mode of damping ratio zeta has
exp(-2 pi zeta n) left after n periods.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Annotated, NamedTuple

import numpy as np

from vanedamp.coupling.numerics.compiler.jit import strict, strict_entry
from vanedamp.coupling.numerics.compiler.record import record_with
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.structures import Prescribed
from vanedamp.coupling.system.assembly import assemble
from vanedamp.coupling.system.linear_modes import linear_systems, set_modes, start_of_modes
from vanedamp.coupling.system.system import System

#: longest transient that is taken without being asked for, in periods
LIMIT = 10_000
#: periods up to which a run whose length is open is made longer until it is steady
MOST = 24_000
#: steady response, relative to its start, below which a structure is at rest: an absorber without damping
#: leaves round-off, of which no fraction is ever reached
_NOTHING = 1e-6
#: fraction of the transient left when a short run of a choice has settled, and the fewest periods which that takes
_LEFT, _SETTLE = 0.05, 100


def left_over(scene: Scene, periods: float) -> float:
    """Return an upper bound of the transient left after `periods` periods, as a fraction of the steady response.

    Of the structure with bodies on springs and tracks attached, others loose or held by friction, without impacts.
    0 where nothing excites it.
    """
    return Transient(scene).left_over(periods)


class Length(NamedTuple):
    """Periods of a run: those left out, those simulated, and the limit up to which it continues until steady."""

    dropped: int
    simulated: int
    most: int


@record_with(free_axes=2)
class TransientInputs(NamedTuple):
    """Data of a scene before its run; frequency, loads and start change arrays only.

    e harmonics, N coordinates, n modes, b bodies; `begin_transient` sets `excited`.
    """

    modes: int  # n
    clock: Annotated[np.ndarray, "2"]  # angular frequency of order 1, rad/s, and period, s
    frequency: Annotated[np.ndarray, "e"]  # rad/s
    load: Annotated[np.ndarray, "e N", complex]  # N
    q: Annotated[np.ndarray, "N"]  # (n + b,) start of modal coordinates and positions
    v: Annotated[np.ndarray, "N"]  # (n + b,) their rates
    excited: Annotated[np.ndarray, "1", bool]  # whether loads act on the structure
    driven: bool  # whether something else moves it: a base, or an excitation that is no sum of sines
    apart: bool  # whether the held system is another one than the loose
    free: Annotated[np.ndarray, "N", bool]  # (1 + b,) of the structure False, of each body whether no spring holds it
    weight_energy: float  # by which weight lowers the energy of the springs that hold bodies, J
    rigid: bool  # whether friction dampers stick without a spring
    tolerance: float
    open: bool  # whether the length of the run is
    auto: bool  # whether the run ends as soon as its mean is known
    suited: bool  # whether the transient decides on it
    dropped: int  # periods that are left out unless it does
    simulated: int
    most: int  # longest run; 0: no longer than its length


class Transient:
    """The linear transient of a scene: its start, its rates of decay and its beats. system: the scene's.

    numbers: for compiled functions, (TransientInputs, loose and held LinearModes); parts: of both (LinearParts).
    """

    def __init__(self, scene: Scene, system: System | None = None) -> None:
        self.scene, self.system = scene, assemble(scene) if system is None else system
        systems = linear_systems(scene, self.system)
        (loose, free), (held, stuck) = systems[0], systems[-1]
        time, prescribed = scene.time, isinstance(scene.structure, Prescribed)
        q, v = start_of_modes(scene, self.system)
        setup = TransientInputs(
            modes=self.system.modes, clock=np.array([self.system.omega, self.system.period]),
            frequency=self.system.frequency, load=self.system.load, q=q, v=v, excited=np.zeros(1, bool),
            driven=prescribed or scene.excitation.signal is not None, apart=len(systems) > 1,
            free=np.array([False, *(not damper.sprung for damper in scene.damper)]), weight_energy=loose.weight_energy,
            rigid=any(damper.stiffness is None for damper in scene.friction_damper), tolerance=float(time.tolerance),
            open=time.open, auto=time.steady is not None, suited=time.open and not prescribed, dropped=time.dropped,
            simulated=time.simulated, most=0 if time.steady and not prescribed else most_periods(scene),
        )  # fmt: skip
        self.numbers, self.parts = (setup, free, stuck), (loose, held)
        begin_transient(setup, loose, held, free, stuck)

    def left_over(self, periods: float) -> float:
        """Return the bound of the remainder, as left_over."""
        return float(remainder(*self.numbers, float(periods)))

    def slowest(self, periods: int) -> tuple[float, float]:
        """Return the slowest decay per period that the response may show, and the longest beat, in periods.

        Beats, with the excitation at the same phase of each period, of modes that do not decay within `periods`.
        """
        decay, beat = slowest(*self.numbers, periods)
        return float(decay), float(beat)

    def weight_energy(self) -> float:
        """Return the energy, J, by which weight lowers the energy of the springs and tracks that hold bodies."""
        return self.numbers[0].weight_energy

    def settled_after(self, lengths: range, share: float | None = None) -> int:
        """Return the first of rising numbers of periods that leaves at most a fraction; their end without.

        share: fraction of the steady response; default: `time.tolerance`.
        """
        share = self.scene.time.tolerance if share is None else share
        return int(settled(*self.numbers, lengths.start, len(lengths), lengths.step, float(share)))

    def length(self) -> Length:
        """Return the length of the scene's run.

        Of one that leaves it open, as many periods as leave `time.tolerance` of the steady response, at least the
        default; the default too where LIMIT would not do: then nothing but the bodies can end the transient in time.
        """
        return Length(*run_length(*self.numbers))


@strict_entry
def begin_transient(setup, loose, held, free, stuck):
    """Set the modes of the loose system, `free`, and of the held one, `stuck`."""
    setup.excited[0] = False
    for h in range(len(setup.load)):
        for i in range(setup.modes):
            if setup.load[h, i] != 0.0:
                setup.excited[0] = True
    set_modes(loose, free, setup.load, setup.frequency, setup.q, setup.v)
    if setup.apart:
        set_modes(held, stuck, setup.load, setup.frequency, setup.q, setup.v)


@strict_entry
def remainder(setup, free, stuck, periods):
    """Return the bound of the remainder (Transient.left_over)."""
    if not setup.excited[0]:
        return 0.0
    return max(_remainder(setup, free, periods), _remainder(setup, stuck, periods))


@strict
def _remainder(setup, modes, periods):
    begun, left = 0.0, 0.0
    for j in range(len(modes.begun)):
        begun += modes.begun[j]
        left += modes.begun[j] * math.exp(-modes.rate[j] * setup.clock[1] * periods)
    left /= max(modes.steady[0], _NOTHING * begun)
    return left if math.isfinite(left) else np.inf


@strict_entry
def slowest(setup, free, stuck, periods):
    """Return the slowest decay and the longest beat (Transient.slowest)."""
    one, other = _slowest(setup, free, periods), _slowest(setup, stuck, periods)
    return min(one[0], other[0]), max(one[1], other[1])


@strict
def _slowest(setup, modes, periods):
    decay, longest = np.inf, 0.0
    for j in range(len(modes.begun)):
        if modes.felt[j] or not modes.begun[j] <= setup.tolerance * modes.steady[0]:
            rate, turns = modes.rate[j] * setup.clock[1], modes.own[j] / setup.clock[0]
            decay = min(decay, rate)
            if rate * periods < 1.0:
                longest = max(longest, 1.0 / abs(turns - math.floor(turns + 0.5)))
    return decay, longest


@strict_entry
def settled(setup, free, stuck, start, count, step, share):
    """Return the first of `count` rising numbers of periods that leaves at most a fraction; their end without."""
    low, high = np.int64(0), count
    while low < high:
        middle = (low + high) >> 1
        if remainder(setup, free, stuck, float(start + middle * step)) <= share:
            high = middle
        else:
            low = middle + 1
    return start + low * step


@strict_entry
def run_length(setup, free, stuck):
    """Return the length of a run (Transient.length)."""
    enough, periods = setup.dropped, setup.simulated
    if setup.suited:
        count = LIMIT + 1 - setup.dropped
        enough = settled(setup, free, stuck, setup.dropped, count, np.int64(1), setup.tolerance)
        enough = setup.dropped if enough == LIMIT + 1 else enough
        periods += enough - setup.dropped
    return enough, periods, max(periods, setup.most)


def most_periods(scene: Scene) -> int:
    """Return the largest number of periods that a run of a scene may take."""
    return MOST if scene.time.open else scene.time.simulated


def settled_after(scene: Scene, lengths: range) -> int:
    """Return the first of rising numbers of periods that leaves at most `time.tolerance`; their end where none does."""
    return Transient(scene).settled_after(lengths)


def short_transient(scene: Scene) -> int:
    """Return how many periods leave little of the structure's transient, at most those that the scene drops."""
    most = max(_SETTLE, timed(scene).time.dropped)
    return min(Transient(scene).settled_after(range(_SETTLE, most + 1), _LEFT), most)


def timed(scene: Scene) -> Scene:
    """Return the scene with the length of its run at least, where it leaves that open."""
    if not scene.time.open or isinstance(scene.structure, Prescribed):
        return scene
    length = Transient(scene).length()
    if length[:2] == (scene.time.dropped, scene.time.simulated):
        return scene
    transient = None if scene.time.steady else length.dropped
    return replace(scene, time=replace(scene.time, periods=length.simulated, transient=transient))
