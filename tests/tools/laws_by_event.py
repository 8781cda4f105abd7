"""What holds at every event of a run: walls, forces within their bounds, Newton's laws, impulses."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, fields

import numpy as np

from tests.tools.segment_stepper import SLIDES, Moment, Segment, Step, Stepper
from vanedamp.coupling.engine.line.tolerances import ADHESION
from vanedamp.coupling.numerics.codes import CLOSED, DONE, LEAVING, OPEN, STICK, TOUCHING
from vanedamp.coupling.numerics.tolerances import CHATTER, COLLAPSE, RESOLUTION, SIMULTANEOUS, SPEED_ROUND_OFF
from vanedamp.coupling.scene.scene import Scene

#: points at which the motion between two events is looked at
POINTS = 9
#: share of a gap that is round-off
PENETRATION = 1e-12
#: share of the terms that a sum of forces or accelerations is round-off of
BALANCE = 1e-9
#: share of the fastest speed so far that is round-off of a velocity
SPEED = 1e-9
#: what counts as motion at all, as a share of the free travel
SLOW = 1e-6


@dataclass
class Worst:
    """Largest violations met, each relative to what it is a share of."""

    penetration: float = 0.0
    bound: float = 0.0
    balance: float = 0.0
    momentum: float = 0.0
    restitution: float = 0.0
    jump: float = 0.0
    ledger: float = 0.0
    scenes: int = 0
    steps: int = 0
    impacts: int = 0

    def note(self, name: str, value: float, limit: float, step: Step | None = None) -> None:
        setattr(self, name, max(getattr(self, name), float(value)))
        where = "" if step is None else f" at {step.before.begun:.17g} + {step.span:.3g} s"
        assert value <= limit, f"{name} {value:.3g} above {limit:.3g}{where}"

    def merge(self, other: Worst) -> None:
        """Take in what another run has met."""
        for field in fields(self):
            mine, its = getattr(self, field.name), getattr(other, field.name)
            setattr(self, field.name, mine + its if field.type == "int" else max(mine, its))


def check_events(scene: Scene, longest: int | None = None) -> Worst:
    """Step through a run, or its first `longest` steps. Raises AssertionError at the first law that is broken."""
    worst, stepper = Worst(scenes=1), Stepper(scene)
    system = stepper.run.system
    widest = system.play[_contacts(system)].max()
    fastest, last = SLOW * system.omega * widest, np.full(len(system.delassus), -np.inf)
    if stepper.code == DONE:
        first = stepper.segment()
        _check_state(worst, first, first.at(0.0), None)
    for step in itertools.islice(stepper.steps(), longest):
        end = _check_between(worst, step)
        # speeds on both sides of an event have the round-off of the terms that they are sums of there
        fastest = max(fastest, step.before.speed_size(), step.after.speed_size())
        now = step.after.at(0.0)
        hit = _check_event(worst, step, end, now, fastest, last)
        last[hit] = step.after.begun
        _check_state(worst, step.after, now, step)
        worst.steps += 1
        worst.impacts += step.impacts
    assert stepper.code == DONE or worst.steps == longest, f"ended with code {stepper.code}"
    return worst


def _contacts(system) -> np.ndarray:
    return np.arange(len(system.delassus)) >= system.friction_rows


def _check_between(worst: Worst, step: Step) -> Moment:
    """Walls and bounds of forces on the way to the next event. Returns the motion at its end."""
    segment, system = step.before, step.before.system
    path = segment.at(step.span * np.linspace(0.0, 1.0, POINTS))
    solid = _contacts(system) & np.isinf(system.spring)
    depth = -path.gap[:, solid].min(axis=0, initial=0.0) / system.play[solid]
    worst.note("penetration", depth.max(initial=0.0), PENETRATION, step)
    _check_bounds(worst, segment, path, step)
    return path.take(-1)


def _check_bounds(worst: Worst, segment: Segment, path: Moment, step: Step | None) -> None:
    """Forces within their bounds, no pull at walls, friction against its slip; springs that left do not push."""
    system, k = segment.system, segment.system.friction_rows
    force, speed = np.atleast_2d(path.force), np.atleast_2d(path.speed)
    size = _force_sizes(segment)
    friction = np.abs(force[:, :k]) - system.limit[:k]
    # a compliant contact ends when its spring is pulled by ADHESION of the free travel, not before
    springs = np.where(np.isfinite(system.spring[k:]), system.spring[k:], 0.0)
    pull = -force[:, k:] - 2 * ADHESION * springs * system.play[k:]
    for excess in (friction.max(axis=0) / size[:k], pull.max(axis=0, initial=0.0) / size[k:]):
        worst.note("bound", excess.max(initial=0.0), BALANCE, step)
    slides = np.isin(segment.state[:k], SLIDES)
    against = (speed[:, :k] * -segment.state[:k])[:, slides]
    # a slip ends where its speed vanishes, which is known to the resolution of the time
    tick = RESOLUTION * system.period * np.abs(segment.kinematic()).max() / SPEED
    worst.note("bound", against.max(initial=0.0) / (segment.speed_size() + tick + 1e-300), SPEED, step)
    assert np.array_equal(segment.applied_force[:k][slides], -segment.state[:k][slides] * system.limit[:k][slides])


def _force_sizes(segment: Segment) -> np.ndarray:
    """(r,) size of the terms that the force of each row is a sum of."""
    system = segment.system
    bodies = system.of_bodies
    loads = np.abs(bodies.weight).max() + np.abs(bodies.load).max() + np.abs(system.limit).max(initial=0.0)
    return np.maximum(segment.force_size(), loads + 1e-300)


def _check_state(worst: Worst, segment: Segment, now: Moment, step: Step | None) -> None:
    """Newton's second law, and complementarity of gap, speed, acceleration and force, right after an event."""
    system, acceleration = segment.system, segment.dynamic(now)
    scale = segment.dynamic_size().max(initial=1e-300)
    error = np.abs(acceleration - segment.kinematic())[segment.moves]
    worst.note("balance", error.max(initial=0.0) / scale, BALANCE, step)
    friction = ~_contacts(system)
    solid, state = np.isinf(system.spring), segment.state
    still = solid & np.where(friction, state >= STICK, (state == CLOSED) | (state == TOUCHING))
    worst.note("balance", np.abs(acceleration[still]).max(initial=0.0) / scale, BALANCE, step)
    assert np.all(segment.velocity[still & (friction | system.moves_with_floor)] == 0.0), "a row at rest moves"
    assert np.all(segment.displacement[still & ~friction] == 0.0), "a closed contact is open"
    open_ = ~friction & (state == OPEN)
    gap = system.play[open_]
    if np.any(open_ & solid):
        assert np.all(now.force[open_] == 0.0), "an open contact pushes"
    worst.note("penetration", (-segment.displacement[open_] / gap).max(initial=0.0), PENETRATION, step)
    rests = solid & open_ & (segment.displacement == 0.0) & (segment.velocity == 0.0)
    worst.note("balance", (-acceleration[rests]).max(initial=0.0) / scale, BALANCE, step)
    starts = solid & friction & np.isin(state, SLIDES) & (segment.velocity == 0.0)
    worst.note("balance", (-state * acceleration)[starts].max(initial=0.0) / scale, BALANCE, step)
    left = ~friction & (state == LEAVING)
    travel = system.spring[left] * system.play[left]
    pushes = -(system.spring[left] * segment.displacement[left] + system.dashpot[left] * segment.velocity[left])
    worst.note("bound", (pushes / travel).max(initial=0.0), BALANCE, step)


def _check_event(worst: Worst, step: Step, end: Moment, now: Moment, fastest: float, last: np.ndarray) -> np.ndarray:
    """Impulses at closed contacts explain every jump and obey Newton's law. Returns the contacts that were hit."""
    after, system = step.after, step.before.system
    contacts = _contacts(system)
    scale = np.where(contacts, system.play, max(np.abs(end.gap).max(), 1e-300))
    # speeds that differ by SPEED_ROUND_OFF of the fastest are equal: slip and gap at a wall apart from the floor may
    # have drifted apart at that speed for a period when they are joined again
    scale = scale + SPEED_ROUND_OFF * fastest * system.period / SIMULTANEOUS
    jumps = np.isfinite(system.spring) & ~contacts  # a spring's elongation is set to its bound
    worst.note("jump", (np.abs(now.gap - end.gap) / scale)[~jumps].max(initial=0.0), 2 * SIMULTANEOUS, step)
    touching = contacts & np.isinf(system.spring) & (after.displacement == 0.0)
    rates, bodies = now.p_rate - end.p_rate, now.body - end.body
    mass, on_bodies, on_modes = system.of_bodies.mass, system.of_bodies.J[touching], system.of_structure.J[touching]
    root = np.sqrt(mass)
    spread = np.hstack([on_modes, on_bodies / root])
    impulse = np.linalg.lstsq(spread.T, np.r_[rates, bodies * root], rcond=None)[0]
    left = np.r_[rates - impulse @ on_modes, bodies - impulse @ on_bodies / mass]
    worst.note("momentum", np.abs(left).max(initial=0.0) / fastest, SPEED, step)
    if step.impacts == 0:
        worst.note("jump", np.abs(np.r_[rates, bodies]).max() / fastest, SPEED, step)
        return np.zeros(len(touching), bool)
    if np.isinf(system.spring[contacts]).any():
        assert touching.any(), "an impact without a contact"
        _check_newton(worst, step, end, now, touching, impulse, fastest, last)
    else:
        worst.note("jump", np.abs(np.r_[rates, bodies]).max() / fastest, SPEED, step)
    return touching & (end.speed < 0.0)


def _check_newton(worst, step, end, now, touching, impulse, fastest, last) -> None:
    """v+ >= -k v-, with equality under an impulse; below the tolerance of a chatter the impact may be plastic."""
    system = step.before.system
    limit = 0.5 * CHATTER * system.period * _accelerations(step, end)[touching]
    before, after = end.speed[touching], now.speed[touching]
    restitution = system.restitution[touching]
    restitution = np.where(step.after.begun - last[touching] < 2 * COLLAPSE * system.period, 0.0, restitution)
    approach = np.maximum(-before, 0.0)
    completed = restitution * approach <= np.maximum(1 - restitution, 0.1) * limit + SPEED * fastest
    short = restitution * approach - after
    worst.note("restitution", (short[~completed] / fastest).max(initial=0.0), SPEED, step)
    worst.note("restitution", (-after / fastest).max(initial=0.0), SPEED, step)
    small = (SPEED * fastest + 4 * limit.max()) / np.diag(system.delassus)[touching].min()
    worst.note("restitution", max(-impulse.min() / small, 0.0) * SPEED, SPEED, step)
    pressed = (impulse > small) & ~completed
    worst.note("restitution", (-short[pressed] / fastest).max(initial=0.0), SPEED, step)


def _accelerations(step: Step, end: Moment) -> np.ndarray:
    """(r,) what the gaps were accelerated with before the event, and would be without the forces of closed contacts."""
    start = np.abs(step.before.kinematic())
    until = np.abs(step.before.dynamic(end))
    pressed = np.abs(step.before.at(0.0).force).max() + np.abs(end.force).max()
    return np.maximum(start, until) + pressed * np.diag(step.before.system.delassus)


assert SIMULTANEOUS <= PENETRATION
