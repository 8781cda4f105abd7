"""Records of a run by any method: sections, energies, samples, events, and the codes of these."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vanedamp.coupling.numerics.compiler.record import record_with
from vanedamp.coupling.quantities.sums import ENERGIES
from vanedamp.coupling.system.system import System

KINDS = ("impact", "stick", "slip", "detach", "rest")
IMPACT, STICKS, SLIPS, DETACHES, RESTS = np.arange(len(KINDS))
#: columns of the log of planar bodies, and of the log of sliders
WIDTH, LINE_WIDTH = 8, 6
#: entries of the energy balance
EXCITATION, VISCOUS, FRICTION, IMPACT_LOSS, CONTACT, STORED = range(len(ENERGIES))
#: rows of a course at first; pieces of a period in it at most, plus one per segment
_COURSE, MOST_PIECES = 2**16, 4096


@record_with(free_axes=2)
class Records(NamedTuple):
    """Records of a run, made once and filled as it advances. One entry per period unless stated otherwise."""

    peak: np.ndarray  # largest |x|, m
    harmonic: np.ndarray  # complex integral of x exp(-i omega t), m s
    square: np.ndarray  # integral of x^2, m^2 s
    momentum: np.ndarray  # complex integral of the bodies' momentum times exp(-i omega t), N s^2
    impacts: np.ndarray
    section: np.ndarray  # (periods + 1, 3 + 2b): x, x', bodies' momentum, slips, slip velocities at the period's start
    ledger: np.ndarray  # (periods + 1, 6) cumulative, J
    parts: np.ndarray  # (periods + 1, 1 + b): energy of the structure with all springs, and of each body, J
    collided: np.ndarray  # energy of the relative motion that impacts reversed or dissipated, J
    samples: np.ndarray  # (periods * s, 1 + b): x and the slips, s equidistant samples per period
    coordinates: np.ndarray  # (periods * s, n) modal coordinates there, (., 0): not wanted; first nan: not kept
    tilt: np.ndarray  # (periods + 1, b) largest |tilt| in the cavity, rad
    lifted: np.ndarray  # (periods + 1, b) time off the floor, s
    walls: np.ndarray  # (periods + 1, b) impacts of planar bodies on their walls
    sampled: np.ndarray  # (periods * s, N) all coordinates at the samples, of runs in the plane
    shut: np.ndarray  # (periods * s, u) int: whether contacts are closed there
    log: np.ndarray  # (capacity, WIDTH or LINE_WIDTH) entries of a slice (response.event_log)
    swing: np.ndarray  # (., 3): largest and smallest x, m, and its integral, m s; (0, 3): bodies bring no static load
    # (periods + 1, w) work of friction of each row of the log, J; w = 0: not wanted; in the plane from `counted` on
    worn: np.ndarray
    struck: np.ndarray  # (periods + 1, w) sum over its impacts of their energy to the power `exponent`, J^exponent
    hits: np.ndarray  # (periods + 1, w) its impacts
    exponent: np.ndarray  # (1,)
    # (periods + 1, k, 3) of further outputs (System.outputs): largest |value|, or where bodies bring a static load as
    # `swing`; -inf: not noted; k = 0: not wanted
    outputs: np.ndarray
    counted: np.ndarray  # (1,) int: period from which on they are noted, the course, and work of friction in the plane
    # (rows, 2 + 4k) course of the further outputs (energy_forms): the period, the time to the next row, s, 0 at the end
    # of a segment, the outputs, and their first three derivatives; rows = 0: not wanted
    course: np.ndarray
    noted: np.ndarray  # (1,) int: its rows so far

    @property
    def samples_per_period(self) -> int:
        """Samples of each period."""
        return len(self.samples) // max(len(self.peak) - 1, 1)


def new_records(
    system: System, periods: int, samples: int, coordinates: bool = False, deflected: bool = False,
    exponent: float | None = None, outputs: bool = False, course: bool = False,
) -> Records:  # fmt: skip
    """Return empty records for `periods` periods with `samples` samples each.

    coordinates: of these samples as well; deflected: whether loads of the bodies deflect the structure;
    exponent: of the energies of impacts that wear; None: wear is not wanted; outputs: whether largest values of the
    further outputs are wanted; course: whether their course is.
    """
    b = system.bodies
    of_modes = np.empty((periods * samples, system.modes if coordinates else 0))
    of_modes[:1] = np.nan  # unused entries of a run that ends early take no memory
    rows = 0 if exponent is None else system.bodies + system.dampers + system.contacts
    worn, struck, hits = np.zeros((3, periods + 1, rows))
    return Records(
        peak=np.zeros(periods + 1), harmonic=np.zeros(periods + 1, complex), square=np.zeros(periods + 1),
        momentum=np.zeros(periods + 1, complex), impacts=np.zeros(periods + 1, np.int64),
        section=np.zeros((periods + 1, 3 + 2 * b)), ledger=np.zeros((periods + 1, len(ENERGIES))),
        parts=np.zeros((periods + 1, 1 + b)), collided=np.zeros(periods + 1),
        samples=np.zeros((periods * samples, 1 + b)),
        coordinates=of_modes, tilt=np.zeros((periods + 1, b)), lifted=np.zeros((periods + 1, b)),
        walls=np.zeros((periods + 1, b), np.int64),
        sampled=np.zeros((periods * samples, len(system.mass))),
        shut=np.zeros((periods * samples, len(system.rest)), np.int8),
        log=np.zeros((4096 + 8 * (b + system.dampers + system.contacts), WIDTH if system.in_plane else LINE_WIDTH)),
        swing=np.tile([-np.inf, np.inf, 0.0], ((periods + 1) * deflected, 1)),
        worn=worn, struck=struck, hits=hits, exponent=np.array([1.0 if exponent is None else exponent]),
        outputs=np.tile([-np.inf, np.inf, 0.0], (periods + 1, len(system.outputs) * outputs, 1)),
        counted=np.zeros(1, np.int64), course=np.zeros((_COURSE * course, 2 + 4 * len(system.outputs))),
        noted=np.zeros(1, np.int64),
    )  # fmt: skip
