"""Symmetries of a scene, and whether two runs are images of each other until chaos has amplified round-off.

How fast it does so is measured: the scene is run again slightly perturbed, and where these runs part, the comparison
ends. Up to there the image may differ by what they differ by, although its own round-off is ten thousand times smaller.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tests.tools.scene_strategies import scene_of
from tests.tools.segment_stepper import Segment, Stepper
from vanedamp.coupling.numerics.codes import DONE, OPEN, PERIOD
from vanedamp.coupling.response.event_log import events_of, rows_of_line
from vanedamp.coupling.system.system import System

#: perturbation of the runs that measure chaos, as a share of lengths and masses
PERTURBATION = 1e-11
#: where they have parted, in periods, of the fastest speed and of each state
PARTED = 1e-6
#: what round-off may do without chaos
ROUND_OFF = 1e-9
#: impacts that close on each other are one, in periods
AT_ONCE = 1e-6
#: what moves less is at rest: in the units of scene_strategies motion is about 1
AT_REST = 1e-6
#: impacts slower than this share of the fastest are the end of a chatter
FADING = 1e-3

Hits = dict[tuple[int, str], np.ndarray]


@dataclass(frozen=True)
class Record:
    """Impacts by body and side, shapes (k, 2): time (periods) and speed before; sections (s, 3 + 2b) of all periods."""

    hits: Hits
    sections: np.ndarray
    code: int
    together: float  # when two contacts are first hit at once: round-off decides which of them moves the other

    @property
    def fastest(self) -> float:
        """Speed of the fastest impact, m/s."""
        return max((np.abs(hit[:, 1]).max() for hit in self.hits.values()), default=1.0)


def record(data: dict, change=None) -> Record:
    """Run the scene of some tables to its end."""
    stepper = Stepper(scene_of(data), change)
    run, code = stepper.run, stepper.code
    code = run.advance(stepper.periods, stepper.budget) if code == DONE else code
    hits: dict = defaultdict(list)
    before, together = (-np.inf, (-1, "")), np.inf
    for event in events_of(rows_of_line(run.whole), run.chunks):
        if event.kind == "impact":
            time, contact = event.time / run.system.period, (event.damper, event.side)
            hits[contact].append((time, event.relative_velocity_before))
            last, other = before
            if contact != other and time - last < AT_ONCE:
                together = min(together, last)
            before = time, contact
    done = int(run.state.counters[PERIOD])
    return Record({key: np.array(hit) for key, hit in hits.items()}, run.records.section[: done + 1], code, together)


def compare(one: Record, other: Record, apart: list[Record], shift: float = 0.0, sections: bool = True) -> int:
    """Assert that `other` is `one`, `shift` periods later. Returns the number of impacts that could be compared.

    apart: perturbed runs of `one`.
    """
    assert other.code == DONE, f"the image ended with code {other.code}"
    end, spread = one.together, ROUND_OFF
    for near in apart:
        part, difference, _ = _difference(one, near, 0.0, np.inf)
        end, spread = min(end, part), max(spread, difference)
    part, difference, compared = _difference(one, other, shift, end - 10 * PARTED)
    assert part >= end - 10 * PARTED, f"impacts part at {part:.9g} of {end:.9g} periods"
    assert difference <= spread, f"impacts differ by {difference:.3g}, perturbed runs by {spread:.3g}"
    if sections:
        _compare_sections(one, other, apart, int(min(end, len(one.sections) - 1)) + 1)
    return compared


def _compare_sections(one: Record, other: Record, apart: list[Record], count: int) -> None:
    # a structure that friction holds moves by round-off only
    scale = np.maximum(np.abs(one.sections).max(axis=0), AT_REST)
    scale[3:] = scale[3:].max()
    spread, difference = (
        np.max([np.abs((one.sections - run.sections)[:count] / scale).max(axis=1) for run in runs], axis=0)
        for runs in (apart, [other])
    )
    # bodies that touch no wall any more part without an impact that would tell
    count = np.argmax(spread > PARTED) if np.any(spread > PARTED) else count
    widest, largest = spread[:count].max(initial=ROUND_OFF), difference[:count].max(initial=0.0)
    assert largest <= widest, f"sections differ by {largest:.3g}, perturbed runs by {widest:.3g}"


def _difference(one: Record, other: Record, shift: float, end: float) -> tuple[float, float, int]:
    """(when the impacts of two runs part, largest difference before, how many those are), from `shift` to `end`."""
    parts, pairs = np.inf, []
    last = len(one.sections) - 1 - PARTED
    for key in one.hits.keys() | other.hits.keys():
        a, b = (_fast(run.hits.get(key, np.zeros((0, 2))), one.fastest) for run in (one, other))
        b[:, 0] += shift
        a, b = (hit[(hit[:, 0] > shift) & (hit[:, 0] < last)] for hit in (a, b))
        count = min(len(a), len(b))
        if len(a) != len(b):
            parts = min(parts, (a if len(a) > count else b)[count, 0])
        apart = np.abs(a[:count] - b[:count]).max(axis=1)
        if np.any(apart > PARTED):
            parts = min(parts, a[np.argmax(apart > PARTED), 0])
        pairs.append((a[:count, 0], apart))
    before = np.concatenate([apart[times < min(parts, end)] for times, apart in pairs] or [np.zeros(0)])
    return parts, before.max(initial=0.0), len(before)


def _fast(hits: np.ndarray, fastest: float) -> np.ndarray:
    """Impacts that are no end of a chatter, speeds as shares of the fastest."""
    return hits[np.abs(hits[:, 1]) > FADING * fastest] / [1.0, fastest]


def perturbed(data: dict) -> list[dict]:
    """The tables with lengths and masses larger and smaller by a perturbation."""
    near = []
    for factor in (1 + PERTURBATION, 1 - PERTURBATION):
        cavities = [cavity | {"gap": cavity["gap"] * factor} for cavity in data["cavity"]]
        dampers = [
            damper | {"position": damper["position"] * factor, "mass": damper["mass"] * factor ** (1 + index)}
            for index, damper in enumerate(data["damper"])
        ]
        initial = {name: value * factor for name, value in data.get("initial", {}).items()}
        near.append(data | {"cavity": cavities, "damper": dampers, "initial": initial})
    return near


def turned(angle: complex) -> Callable[[System], System]:
    """System whose excitation is turned by a complex phase."""
    return lambda system: system._replace(load=system.load * angle, table=system.table * angle)


def mirrored(data: dict) -> tuple[dict, Callable]:
    """Tables of the mirror image and the change of its run: left is right, the force has the opposite phase."""
    swap = {"left": "right", "right": "left"}
    image = data | {
        "initial": {name: -value for name, value in data.get("initial", {}).items()},
        "gravity": data["gravity"] | {"orientation_deg": -data["gravity"]["orientation_deg"]},
        "cavity": [{swap.get(key, key): value for key, value in cavity.items()} for cavity in data["cavity"]],
        "damper": [
            damper | {"position": -damper["position"], "velocity": -damper["velocity"]}
            for damper in data["damper"][::-1]
        ],
    }

    def change(run):
        run.system = turned(-1.0)(run.system)

    return image, change


def unmirrored(record: Record) -> Record:
    """What the mirror image did, mirrored back."""
    bodies = (record.sections.shape[1] - 3) // 2
    swap = {"left": "right", "right": "left", "body": "body"}
    hits = {
        (bodies - 1 - damper - (side == "body"), swap[side]): hit * [1.0, 1.0 if side == "body" else -1.0]
        for (damper, side), hit in record.hits.items()
    }
    places = np.r_[0:3, 3 + np.arange(bodies)[::-1], 3 + bodies + np.arange(bodies)[::-1]]
    return Record(hits, -record.sections[:, places], record.code, record.together)


def reordered(data: dict, order: list[int]) -> tuple[dict, list[int]]:
    """Tables with the cavities in another order and the bodies with them, and the old number of each body."""
    cavities = [data["cavity"][i] for i in order]
    old = [
        i for cavity in cavities[::-1] for i, damper in enumerate(data["damper"]) if damper["cavity"] == cavity["name"]
    ]
    return data | {"cavity": cavities, "damper": [data["damper"][i] for i in old]}, old


def renumbered(record: Record, old: list[int]) -> Record:
    """A record with the old numbers of its bodies."""
    new = np.argsort(old)
    bodies = len(old)
    hits = {(old[damper], side): hit for (damper, side), hit in record.hits.items()}
    return Record(hits, record.sections[:, np.r_[0:3, 3 + new, 3 + bodies + new]], record.code, record.together)


def later(data: dict) -> tuple[float, Callable] | None:
    """A time (periods) within a run, and the change of a run so that it begins there, as if that were time zero.

    Within the longest of the first flights at which no compliant contact is pressed; None if there is none.
    """
    stepper, best = Stepper(scene_of(data)), None
    for count, step in enumerate(stepper.steps()):
        pressed = np.any(np.isfinite(stepper.run.system.spring) & _pressed(step.before))
        if not pressed and (best is None or step.span > best.span):
            best = step
        if count > 60:
            break
    if best is None:
        return None
    tau = 0.37 * best.span
    moment, time = best.before.at(tau), best.before.begun + tau
    system = stepper.run.system

    def change(run):
        run.system = turned(np.exp(1j * system.omega * time))(run.system)
        start, b = run.columns, system.bodies
        start.displacement[0], start.velocity[0] = system.scale * moment.p, system.scale * moment.p_rate
        start.slip[0], start.slip_velocity[0] = moment.gap[:b], moment.speed[:b]
        start.elongation[0] = moment.gap[b : system.friction_rows]

    return time / system.period, change


def _pressed(segment: Segment) -> np.ndarray:
    contacts = np.arange(len(segment.state)) >= segment.system.friction_rows
    return contacts & (segment.state != OPEN)
