"""A passage under way in compiled functions, and its outcome codes."""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np

from vanedamp.coupling.numerics.compiler.record import record_with

#: functionals of units: gaps of contacts, or speeds of rows
GAPS, SPEEDS = np.int64(0), np.int64(1)
#: defects of a derivative, each worse than the one before (passage.PassageStatus)
OK, GRAZING, COINCIDENT, UNDETERMINED, STOPPED = range(5)
#: outcome of an event: its derivative is known, or there is none; or Python is to find a flow, slopes of a law, room
KNOWN, UNTRUSTED, WANTS_FLOW, WANTS_LAW, WANTS_ROOM = range(5)

# numbers of a walk: segments of the course passed; their flow, -1: none yet; defect so far; whether a chatter was
# completed, which the engine ends at the last flights of a millionth of a period: what these do is left out; the first
# column of derivatives whose motions may make a kink; event whose law's slopes are known, -1: none; the unit and the
# event that came nearest; whether derivatives are unknown; whether events that nearly happen are sought, and what
# passes is kept; in which segment, from 1, the part of the passage that is wanted ends, 0: not yet, and whether the
# passage ends with it; whether it begins so whatever happens; whether restitutions have slopes
(
    NEXT, FLOW, STATUS, COMPLETED, COUNTS, LAW_OF, NEAR_UNIT, NEAR_CODE, LOST, SEEKS, KEEPS, REACHED, SHORT, GIVEN,
    SMOOTH,
) = range(15)  # fmt: skip
WALKING = 15


@record_with(free_axes=3)
class Walking(NamedTuple):
    """A passage on its way; C = k + P columns, s segments of the course, g parts of the system.

    M: (2N, C) at the start of the present segment, by the state at the start in units of its sizes, and by numbers.
    """

    at: Annotated[np.ndarray, "numbers", int]
    given: Annotated[np.ndarray, "k"]  # the state with which the passage is to begin
    turns: Annotated[np.ndarray, "k P"]  # how numbers change it
    unheld: Annotated[np.ndarray, "2N C"]  # derivative of the start before units at rest stop it
    wanted: Annotated[np.ndarray, "u", int]  # states of a flow that Python is to find
    wanted_force: Annotated[np.ndarray, "2u"]
    law: Annotated[np.ndarray, "3 u"]  # restitutions in an event, their slopes by speed and by coefficient
    z: Annotated[np.ndarray, "K"]  # at the end of the last segment
    M: Annotated[np.ndarray, "2N C"]
    end: Annotated[np.ndarray, "K C"]  # the same there, of z
    # sizes of coordinates so far, those by which they are compared; largest derivatives of each by the start, and by
    # each number
    size: Annotated[np.ndarray, "2N"]
    reach: Annotated[np.ndarray, "2N P1"]
    # the last event that matters: time, how derivatives shift it by parts of the system, and whether they do
    last: Annotated[np.ndarray, "1"]
    last_shift: Annotated[np.ndarray, "g C"]
    shifted: Annotated[np.ndarray, "g", int]
    took_part: Annotated[np.ndarray, "u"]  # when each unit last took part in an event, s
    clearance: Annotated[np.ndarray, "1"]
    shift: Annotated[np.ndarray, "C"]  # of the last event in time, s
    part: Annotated[np.ndarray, "1"]  # time at which `reached` is wanted, s
    reached: Annotated[np.ndarray, "K C"]
    z_reached: Annotated[np.ndarray, "K"]
    terms: Annotated[np.ndarray, "T K"]  # of Taylor's series
    of_terms: Annotated[np.ndarray, "T K W"]  # W columns: C, or K
    # of every segment: its flow, rate of the event function that begins it, nan without; if they are kept: M at its
    # start and end, z at its end, shift of its start
    flows: Annotated[np.ndarray, "s", int]
    met: Annotated[np.ndarray, "s"]
    begins: Annotated[np.ndarray, "t 2N C"]
    ends: Annotated[np.ndarray, "t 2N C"]
    z_ends: Annotated[np.ndarray, "t K"]
    shifts: Annotated[np.ndarray, "t C"]
