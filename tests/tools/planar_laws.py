"""Random scenes of blocks, discs and sliders, stepped through event by event: what every motion of them obeys.

Between events the motion is computed again, by matrix exponentials of the equations of motion with the forces of the
contacts' states. Run as a script, it looks at many scenes and prints the largest violations:

    .venv/bin/python -m tests.tools.planar_laws [FIRST_SEED [SCENES [LAW]]]
"""

from __future__ import annotations

import math
import sys
from collections import Counter
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
from scipy.linalg import expm, null_space

from tests.tools.planar import Run, open_run
from vanedamp.coupling.engine.line.event_functions import CHATTER
from vanedamp.coupling.engine.line.gap_kinematics import SIMULTANEOUS
from vanedamp.coupling.numerics.codes import (
    DONE,
    EVENT_BUDGET,
    EVENTS,
    LEAVING,
    OPEN,
    PERIOD,
    SLIP_LEFT,
    SLIP_RIGHT,
    STICK,
)
from vanedamp.coupling.numerics.tolerances import COLLAPSE
from vanedamp.coupling.response.records import FRICTION, IMPACT, IMPACT_LOSS, VISCOUS
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.system.system import System
from vanedamp.files.toml_input import InputError, validate
from vanedamp.rom.reduced import ReducedModel

#: points at which the motion between two events is looked at
POINTS = 12
#: steps of one scene among thousands that are looked at: an elastic body may hop for ever
LONGEST = 150
#: share of the largest singular value below which rows depend on each other
DEPENDENT = 1e-9
#: round-off of a gap, and of a speed in it over a time constant of its spring, as a share of the play
GAP_ROUND_OFF = 1e-12
#: points of a period at which a scene is compared with its image; perturbation that measures chaos; where that ends
PLACES, PERTURBATION, PARTED = 20, 1e-11, 1e-6
#: limits of the violations, each as a share of the terms that it is a difference of. A nearly singular wedge has had a
#: closed gap of 1.6e-9 of the play
LIMITS = {
    "penetration": 1e-9, "apart": 1e-8, "motion": 1e-8, "pull": 1e-9, "cone": 1e-9, "along_slip": 1e-8,
    "starts": 1e-9, "newton": 1e-9, "impulse": 1e-9, "momentum": 1e-7, "gain": 1e-9, "ledger": 1e-10,
    "returns": 1e-10, "round_off": 0.0,
}  # fmt: skip


@dataclass
class Worst:
    """Largest violations met, each relative to what it is a share of (LIMITS), and counts."""

    penetration: float = 0.0  # of a contact, per its play
    apart: float = 0.0  # gap of a closed contact, per its play, speed of a row at rest, per the fastest
    motion: float = 0.0  # error of q and v at the end of a segment
    pull: float = 0.0  # of a closed contact
    cone: float = 0.0  # friction beyond its bound
    along_slip: float = 0.0  # slip against the direction that friction assumes
    starts: float = 0.0  # acceleration of an open contact into its surface, of a slip against its direction
    newton: float = 0.0  # v+ other than -k v-, per the fastest
    impulse: float = 0.0  # pulling, or out of the cone
    momentum: float = 0.0  # jump of the velocities that no impulses explain
    gain: float = 0.0  # energy that an impact brings
    ledger: float = 0.0
    returns: float = 0.0  # energy that friction, dashpots or impacts give back from one event to the next
    round_off: float = 0.0  # rows of closed contacts that an impact leaves with the round-off of its impulses
    scenes: int = 0
    steps: int = 0
    jams: int = 0  # impacts without a collision
    reduced: int = 0  # impacts with less than their coefficients
    impacts: int = 0

    def note(self, name: str, value: float, where: str) -> None:
        """Keep the largest value. Raises AssertionError beyond its limit."""
        setattr(self, name, max(getattr(self, name), float(value)))
        assert value <= LIMITS[name], f"{name} {value:.3g} above {LIMITS[name]:.3g} {where}"

    def merge(self, other: Worst) -> None:
        """Take in what another run has met."""
        for field in fields(self):
            mine, its = getattr(self, field.name), getattr(other, field.name)
            setattr(self, field.name, mine + its if field.type == "int" else max(mine, its))


# --- random scenes


def tables(seed: int) -> dict:
    """Tables of a random scene, in natural units: motion about 1, angular frequency about 1."""
    rng = np.random.default_rng(seed)
    pick = lambda *options: options[rng.integers(len(options))]  # noqa: E731
    between = lambda low, high: float(np.exp(rng.uniform(math.log(low), math.log(high))))  # noqa: E731
    rigid = rng.random() < 0.6
    common = pick(None, 0.0, float(rng.uniform(0.1, 0.95)))
    cavities, dampers = [], []
    for c in range(pick(1, 1, 2)):
        gap, play = between(0.05, 3.0), between(0.01, 1.0)
        cavity = {"name": f"c{c}", "gap": gap, "play": play}
        if rigid and rng.random() < 0.4:
            cavity |= {"normal_motion": float(rng.uniform(-0.6, 0.6)), "rotation": float(rng.uniform(-0.3, 0.3))}
        cavities.append(cavity)
        kind = pick("slider", "block", "block", "disc", "mixed", "mixed")
        count = 1 if kind == "slider" else pick(1, 1, 2, 3) if len(cavities) == 1 else 1
        radius, room, at = between(0.1, 0.5), gap / count, -gap / 2
        for _ in range(count):
            shape = pick("block", "disc") if kind == "mixed" else kind
            damper = {
                "cavity": cavity["name"], "shape": shape, "mass": between(0.005, 0.5),
                "friction": pick(0.0, float(rng.uniform(0.02, 0.8)), float(rng.uniform(0.02, 0.8))),
                "restitution": pick(0.0, 1.0, *rng.uniform(0.05, 0.95, 6).tolist()) if common is None else common,
                "position": at + room * float(rng.uniform(0.0, 1.0)),
                "velocity": pick(0.0, float(rng.uniform(-0.5, 0.5))),
            }  # fmt: skip
            at += room
            if shape == "disc":
                damper["radius"] = radius
            if shape == "block":
                damper |= {"length": between(0.1, 2.0), "height": between(max(0.1, radius), 2.0)}
            if shape != "slider" and rng.random() < 0.6:
                damper["lift"] = play * float(rng.uniform(0.0, 0.6))
                damper["lift_velocity"] = float(rng.uniform(-0.3, 0.3))
                damper["tilt_rate"] = float(rng.uniform(-0.3, 0.3))
                if shape == "disc":
                    damper["tilt"] = float(rng.uniform(-1.0, 1.0))
                else:
                    largest = min((play - damper["lift"]) / damper["length"], 0.2 * room / damper["height"])
                    damper["tilt"] = pick(0.0, largest * float(rng.uniform(-0.99, 0.99)))
            if shape != "slider" and rng.random() < 0.15:
                a, b = (damper[key] for key in (("radius", "radius") if shape == "disc" else ("length", "height")))
                whole = damper["mass"] * (a * b / 2 if shape == "disc" else (a * a + b * b) / 12)
                damper["inertia"] = whole * float(rng.uniform(0.7, 1.4))
            if rng.random() < 0.1:
                damper |= {"stiffness": damper["mass"] * between(0.3, 5.0), "dashpot": damper["mass"] * 0.05}
            dampers.append(damper)
    rubs = any(damper["friction"] for damper in dampers)
    data = {
        "excitation": {"frequency": float(rng.uniform(0.9, 1.1)) / (2 * math.pi)},
        "gravity": {
            "acceleration": pick(between(1e-3, 1.0), between(1e-3, 1.0), between(0.1, 2.0), 0.0),
            "orientation_deg": pick(0.0, 0.0, 90.0, 37.0, float(rng.uniform(-89, 89)), 45.0 if rubs else 180.0),
        },
        "cavity": cavities, "damper": dampers, "time": {"periods": int(rng.integers(2, 5)), "transient": 0},
    }  # fmt: skip
    if rng.random() < 0.3:
        data["excitation"]["harmonic"] = [{"order": 2, "amplitude": 0.5, "phase": float(rng.uniform(-180, 180))}]
    if not rigid:
        return data | {"structure": {"model": "prescribed", "displacement_amplitude": float(rng.uniform(0.1, 1.5))}}
    data["excitation"][pick("force", "base_acceleration")] = between(0.01, 0.5)
    if rng.random() < 0.25:
        data["friction_damper"] = [{"normal_force": between(0.02, 0.5), "friction": float(rng.uniform(0.1, 0.6))}]
    return data | {
        "structure": {"model": "rigid", "mass": 1.0, "stiffness": 1.0, "damping_ratio": between(1e-3, 0.1)},
        "initial": {"displacement": float(rng.uniform(-1, 1)), "velocity": float(rng.uniform(-1, 1))},
    }


def crowd(seed: int, folder: Path) -> dict:
    """Tables of a random scene whose structure has stops, friction dampers and sliders in cavities of their own, too.

    It is rigid or a reduced model, which is written to `folder`.
    """
    rng = np.random.default_rng([seed, 16])
    between = lambda low, high: float(np.exp(rng.uniform(math.log(low), math.log(high))))  # noqa: E731
    data = tables(seed)
    excitation = {key: data["excitation"][key] for key in ("frequency", "harmonic") if key in data["excitation"]}
    data["excitation"] = excitation | {"force": between(0.05, 0.5)}
    start = float(rng.uniform(-1, 1))
    for number in range(rng.integers(1, 3)):
        gap, side = between(0.05, 1.0), ("left", "right")[rng.integers(2)]
        data.setdefault("stop", []).append({"side": side, "gap": abs(start) + gap, "restitution": float(rng.random())})
        gap = between(0.05, 2.0)
        data["cavity"].append({"name": f"s{number}", "gap": gap})
        slider = {"cavity": f"s{number}", "mass": between(0.01, 0.3), "restitution": float(rng.random())}
        slider |= {"normal_load": between(1e-3, 0.1), "friction": float(rng.choice([0.0, rng.uniform(0.1, 0.6)]))}
        data["damper"].append(slider | {"position": gap * float(rng.uniform(-0.5, 0.5))})
    data["friction_damper"] = [
        {"normal_force": between(0.02, 0.3), "friction": float(rng.uniform(0.1, 0.6))} for _ in range(rng.integers(3))
    ]
    if rng.random() < 0.5:
        structure = {"model": "rigid", "mass": 1.0, "stiffness": 1.0, "damping_ratio": between(1e-3, 0.1)}
        return data | {
            "structure": structure,
            "initial": {"displacement": start, "velocity": float(rng.uniform(-1, 1))},
        }
    modes = int(rng.integers(1, 5))
    omega = np.r_[1.0, np.sort(rng.uniform(1.5, 6.0, modes - 1))]
    labels = ["a", "b", "a.normal", "a.rotation", "b.normal", "b.rotation"]
    shapes = rng.uniform(-0.3, 0.3, (len(labels), modes)) * [[1.0], [1.0], [1.0], [0.5], [1.0], [0.5]]
    shapes[:2, 0] = rng.uniform(0.7, 1.0, 2)
    model = ReducedModel.from_matrices(
        mass=np.eye(modes), stiffness=np.diag(omega**2), damping_ratio=between(1e-3, 0.1),
        interface=dict(zip(labels, shapes, strict=True)), directions=dict.fromkeys(labels, (0.0, 1.0, 0.0)),
        base_load=np.zeros((modes, 3)),
    )  # fmt: skip
    model.save(folder / f"crowd-{seed}.h5")
    data.pop("initial", None)
    data["structure"] = {"model": "rom", "file": str(folder / f"crowd-{seed}.h5")}
    data["excitation"]["at"] = "a"
    for number, cavity in enumerate(data["cavity"]):
        cavity.pop("normal_motion", None)
        cavity.pop("rotation", None)
        cavity["floor"] = labels[number % 2]
    for stop in data["stop"]:
        stop |= {"at": labels[rng.integers(2)]}
    return data


def jenkins(seed: int, folder: Path) -> dict:
    """Tables of a scene of `crowd` with at least one Jenkins element, and springs before most other sliders, too."""
    rng = np.random.default_rng([seed, 17])
    between = lambda low, high: float(np.exp(rng.uniform(math.log(low), math.log(high))))  # noqa: E731
    data = crowd(seed, folder)
    one = {
        "normal_force": between(0.02, 0.3),
        "friction": float(rng.uniform(0.1, 0.6)),
        "stiffness": between(0.1, 10.0),
    }
    others = [
        damper | ({"stiffness": between(0.02, 200.0)} if rng.random() < 0.7 else {})
        for damper in data["friction_damper"]
    ]
    return data | {"friction_damper": [one, *others]}


def scene_of(data: dict) -> Scene:
    """The scene of such tables."""
    return validate(Scene, data, "scene")


def mirrored(data: dict) -> dict:
    """The mirror image of a scene: what moved to the left moves to the right."""
    image = {key: value for key, value in data.items()}
    turn = {"position": -1, "velocity": -1, "tilt": -1, "tilt_rate": -1}
    flip = lambda table, keys: {key: -value if key in keys else value for key, value in table.items()}  # noqa: E731
    image["damper"] = [flip(damper, turn) for damper in data["damper"][::-1]]
    image["cavity"] = [flip(cavity, {"normal_motion"}) for cavity in data["cavity"]]
    image["gravity"] = flip(data["gravity"], {"orientation_deg"})
    if "initial" in data:
        image["initial"] = flip(data["initial"], {"displacement", "velocity"})
    given = data["excitation"].get("harmonic", [])
    sines = [{"order": 1, "amplitude": 1.0, "phase": 180.0}]
    sines += [sine | {"phase": sine["phase"] + 180.0} for sine in given]
    image["excitation"] = data["excitation"] | {"harmonic": sines}
    return image


# --- steps


@dataclass(frozen=True)
class Moment:
    """The state right after an event, or at the start of a period."""

    time: float  # since the start of the run, s
    phase: float  # within the period, s
    q: np.ndarray
    v: np.ndarray
    state: np.ndarray
    ledger: np.ndarray
    prestress: np.ndarray  # of contacts that depend on each other


class Stepper:
    """A run that stops after every event and at the end of every period."""

    def __init__(self, scene: Scene) -> None:
        self.run: Run = open_run(scene, scene.time.simulated, 10**9)
        run = self.run
        self.periods = scene.time.simulated
        self.code = run.begin(0)
        self.hits = self._take()

    def _take(self) -> np.ndarray:
        taken = self.run.events(IMPACT)
        self.run.chunks.clear()
        return taken

    def step(self) -> np.ndarray | None:
        """Advance to the next event or the end of the period. Returns the impacts there, None at the end of the run."""
        run, counters = self.run, self.run.state.counters
        if counters[PERIOD] >= self.periods or self.code not in (DONE, EVENT_BUDGET):
            return None
        return self._advance(int(counters[PERIOD]) + 1, int(counters[EVENTS]) + 1, run)

    def settle(self) -> None:
        """Enter the states that have been decided, without a step."""
        if self.code == DONE:
            self._advance(self.periods, int(self.run.state.counters[EVENTS]), self.run)

    def _advance(self, periods: int, events: int, run: Run) -> np.ndarray:
        self.code = run.advance(periods, events)
        return self._take()

    def moment(self) -> Moment:
        """Where the run is now."""
        st = self.run.state
        phase = float(st.time[0])
        return Moment(
            int(st.counters[PERIOD]) * self.run.system.period + phase, phase, st.q.copy(), st.v.copy(),
            st.state.copy(), st.ledger.copy(), st.prestress.copy(),
        )  # fmt: skip


def _held(rows: np.ndarray, wrench: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Forces (k, N) of constraints with these rows (k, N) and wrenches (N, k), and accelerations (N, N), by the loads.

    In coordinates sqrt(M) q. By the projector on the motions that are free, along the wrenches: the rows of a block
    that is wedged may nearly depend on each other, and the mobility has the square of their condition.
    """
    one = np.eye(rows.shape[1])
    if not len(rows):
        return np.zeros_like(rows), one
    scale = np.maximum(np.linalg.norm(rows, axis=1), 1e-150)
    rows, wrench = rows / scale[:, None], wrench / scale
    free, normal = null_space(rows, rcond=DEPENDENT), null_space(wrench.T, rcond=DEPENDENT)
    if free.shape != normal.shape:
        forces = -np.linalg.pinv(rows @ wrench, rcond=DEPENDENT) @ rows
        return forces / scale[:, None], one + wrench @ forces
    projector = free @ np.linalg.solve(normal.T @ free, normal.T)
    return np.linalg.pinv(wrench, rcond=DEPENDENT) @ (projector - one) / scale[:, None], projector


class Motion:
    """The equations of motion under some contact states:  z' = A z  of  z = (q, v, cos and sin of the harmonics, 1)."""

    def __init__(self, system: System, state: np.ndarray) -> None:
        n, u, e = len(system.mass), len(system.rest), len(system.frequency)
        units, contact = np.arange(u), np.arange(u) < system.contacts
        yields = np.isfinite(system.spring)
        closed, pressed = units[contact & ~yields & (state < OPEN)], units[yields & (state < OPEN)]
        sticks = units[(state == STICK) & ((system.friction > 0) | ~contact)]
        way = 1.0 * (state == SLIP_RIGHT) - (state == SLIP_LEFT)
        normal, slip = system.J[:u], system.J[u:]
        spread = np.zeros((2 * u, len(closed) + len(sticks)))  # forces of all rows by the unknown ones
        spread[closed, np.arange(len(closed))] = 1.0
        spread[u + closed, np.arange(len(closed))] = -(way * system.friction)[closed]
        spread[u + sticks, len(closed) + np.arange(len(sticks))] = 1.0
        rows = np.vstack([normal[closed], slip[sticks]])
        slides = np.where(~contact & (way != 0), -way * system.limit, 0.0)
        free = np.zeros((n, 2 * n + 2 * e + 1))  # accelerations without contacts
        free[:, :n], free[:, n : 2 * n] = -system.stiffness, -system.damping
        free[:, 2 * n : 2 * n + e], free[:, 2 * n + e : -1] = system.load.real.T, -system.load.imag.T
        free[:, -1] = system.weight + slip.T @ slides
        sprung = np.arange(u) >= u - len(system.tangential)
        free[:, :n] -= system.elongation.T @ (system.tangential[:, None] * system.elongation)
        springs = np.zeros((2 * u, free.shape[1]))
        springs[pressed, :n] = -system.spring[pressed, None] * normal[pressed]
        springs[pressed, n : 2 * n] = -system.dashpot[pressed, None] * normal[pressed]
        springs[pressed, -1] = -system.spring[pressed] * system.rest[pressed]
        springs[u + pressed] = -(way * system.friction)[pressed, None] * springs[pressed]
        free += system.J.T @ springs
        free /= system.mass[:, None]
        root = np.sqrt(system.mass)[:, None]
        held, projector = _held(rows / root.T, system.J.T @ spread / root)
        forces = held @ (root * free)
        self.force = spread @ forces + springs
        self.force[u:, -1] += slides
        self.acceleration = projector @ (root * free) / root
        # sliders have no mass: those that move go with what draws them
        self.massive = n - len(system.tangential)
        for a, row in zip(np.flatnonzero(sprung) - u + n, system.elongation, strict=True):
            if way[a - n]:
                self.acceleration[a] = row[: self.massive] @ self.acceleration[: self.massive]
        self.terms = np.abs(free) + (np.abs(system.J.T) @ np.abs(spread @ forces)) / system.mass[:, None]
        self.matrix = np.zeros((len(free.T),) * 2)
        self.matrix[:n, n : 2 * n] = np.eye(n)
        self.matrix[n : 2 * n] = self.acceleration
        ahead = 2 * n + np.arange(e)
        self.matrix[ahead, ahead + e], self.matrix[ahead + e, ahead] = -system.frequency, system.frequency
        self.system, self.n = system, n

    def start(self, moment: Moment) -> np.ndarray:
        """The vector z at a moment."""
        angle = self.system.frequency * moment.phase
        return np.concatenate([moment.q, moment.v, np.cos(angle), np.sin(angle), [1.0]])

    def size(self, z: np.ndarray) -> np.ndarray:
        """Sizes of the terms in such vectors; of loads their amplitudes."""
        size = np.abs(z)
        size[..., 2 * self.n :] = 1.0
        return size

    def path(self, moment: Moment, span: float) -> np.ndarray:
        """Vectors z (POINTS + 1, :) on the way, at even intervals from the moment to `span` later."""
        step, path = expm(self.matrix * (span / POINTS)), [self.start(moment)]
        for _ in range(POINTS):
            path.append(step @ path[-1])
        return np.array(path)


class Motions:
    """The motions of a system, each made once."""

    def __init__(self, system: System) -> None:
        self.system = system
        self._made: dict[bytes, Motion] = {}

    def of(self, moment: Moment) -> Motion:
        """The motion in the states of a moment."""
        key = moment.state.tobytes()
        if key not in self._made:
            self._made[key] = Motion(self.system, moment.state)
        return self._made[key]


# --- laws


class Checker:
    """The laws, checked step by step."""

    def __init__(self, scene: Scene, label: str) -> None:
        self.stepper, self.worst, self.label = Stepper(scene), Worst(scenes=1), label
        system = self.stepper.run.system
        self.system, self.u, self.contact = system, len(system.rest), np.arange(len(system.rest)) < system.contacts
        self.rigid = self.contact & np.isinf(system.spring)
        self.motion = Motions(system).of
        # what the loads could lend each coordinate: a body that lies still has the round-off of that
        lent = 0.5 * (np.abs(system.load) ** 2 / (system.mass * system.frequency[:, None] ** 2)).sum()
        self.fastest, self.flowed = np.full(len(system.mass), 1e-3), float(lent)
        self.last = np.full(self.u, -np.inf)
        self.initial = None

    def run(self, longest: int) -> Worst:
        """Take up to `longest` steps. Raises AssertionError at the first law that is broken."""
        stepper, worst = self.stepper, self.worst
        stepper.settle()
        before = stepper.moment()
        self.initial = before
        self._settled(before, self.motion(before), "at the start")
        while worst.steps < longest:
            hits = stepper.step()
            if hits is None:
                break
            after = stepper.moment()
            if stepper.code not in (DONE, EVENT_BUDGET):
                break
            where = f"at step {worst.steps} t = {after.time:.15g} ({self.label})"
            self._check(before, after, hits, where)
            before = after
            worst.steps += 1
            worst.impacts += len(hits)
        return worst

    def _check(self, before: Moment, after: Moment, hits: np.ndarray, where: str) -> None:
        system, n, worst, motion = self.system, len(before.q), self.worst, self.motion(before)
        span = after.phase - before.phase
        if span < 0 or (after.phase == 0.0 and after.time > before.time):
            span = system.period - before.phase
        path = motion.path(before, span)
        self.fastest = np.maximum(self.fastest, np.abs(path[:, n : 2 * n]).max(axis=0))
        self.speed = (np.abs(system.J) @ self.fastest).max()
        self._between(before, motion, path, span, where)
        q, v = path[-1, :n], path[-1, n : 2 * n]
        gap = system.rest + system.J[: self.u] @ q
        shut = self.rigid & ((after.state != OPEN) | (gap <= SIMULTANEOUS * system.play))
        hits = hits[self.rigid[hits[:, 2].astype(int)]]
        reach = np.abs(q).max() + np.abs(before.q).max() + system.period * self.fastest.max()
        worst.note("motion", np.abs(after.q - q).max() / reach, where)
        if len(hits):
            self._impact(v, before, after, hits, shut, motion, where)
        else:
            self._jump(v, after, np.zeros(2 * self.u), 0.0, where)
        self._ledger(after, where)
        losses = [VISCOUS, FRICTION, IMPACT_LOSS]
        worst.note("returns", (before.ledger - after.ledger)[losses].max() / self.flowed, where)
        self._settled(after, self.motion(after), where)

    def _between(self, before: Moment, motion: Motion, path: np.ndarray, span: float, where: str) -> None:
        """Walls, forces within their bounds and friction against slip on the way."""
        system, u, n, worst, state = self.system, self.u, motion.n, self.worst, before.state
        gap = system.rest + path[:, :n] @ system.J[:u].T
        slip = path[:, n : 2 * n] @ system.J[u:].T
        rate = path[:, n : 2 * n] @ system.J[:u].T
        force = path @ motion.force.T + before.prestress
        balance = (system.J.T @ before.prestress) / np.sqrt(system.mass)
        # against what all forces press: that of contacts which do not depend on each other is round-off
        pressed = np.abs(system.J.T) @ np.abs(force).max(axis=0) / np.sqrt(system.mass)
        worst.note("pull", np.abs(balance).max() / max(pressed.max(), 1e-300), where)
        # forces are differences of these, in a wedged block of those of its other contacts
        size = np.full(2 * u, (motion.size(path) @ np.abs(motion.force).T).max() + 1e-300)
        pressed = np.isfinite(system.spring) & (state < OPEN)
        size += GAP_ROUND_OFF / LIMITS["pull"] * (system.spring * system.play)[pressed].max(initial=0.0)
        open_, closed = self.contact & (state == OPEN), self.rigid & (state != OPEN)
        share = -gap / np.where(self.contact, system.play, 1.0)
        worst.note("penetration", share[:, open_].max(initial=0.0), where)
        worst.note("apart", np.abs(share[:, closed]).max(initial=0.0), where)
        worst.note("apart", np.abs(rate[:, closed]).max(initial=0.0) / self.speed, where)
        sticks, slides = state == STICK, (state == SLIP_LEFT) | (state == SLIP_RIGHT)
        worst.note("apart", np.abs(slip[:, sticks]).max(initial=0.0) / self.speed, where)
        pushes, friction = force[:, :u], force[:, u:]
        # what an instant leaves open is decided by the forces a moment later: so far they may lack what they change by
        left = np.maximum(system.moment - np.linspace(0.0, span, POINTS + 1), 0.0)[:, None]
        open_yet = left * np.abs(path @ (motion.force @ motion.matrix).T).max()
        pull = ((-pushes - open_yet) / size[:u])[:, self.contact & (state != OPEN)]
        worst.note("pull", pull.max(initial=0.0), where)
        leaves = state == LEAVING
        stiff = np.where(leaves, system.spring, 0.0)  # that of others may be infinite
        would = (
            -(stiff * gap + system.dashpot * rate) / np.where(leaves, stiff, 1.0) / np.where(leaves, system.play, 1.0)
        )
        worst.note("pull", would[:, leaves].max(initial=0.0), where)
        worst.note("penetration", -share[:, leaves].min(initial=0.0), where)
        beyond = np.abs(friction) - (system.friction * np.maximum(pushes, 0.0) + system.limit)
        worst.note("cone", ((beyond - open_yet) / (size[u:] + size[:u])).max(initial=0.0), where)
        sliders = len(system.tangential)
        pull = np.abs(path[:, :n] @ system.elongation.T) * system.tangential
        short = (system.limit[u - sliders :] - pull)[:, slides[u - sliders :]]
        worst.note("cone", np.abs(short).max(initial=0.0) / size[0], where)
        rubs = slides & ((system.friction > 0) | ~self.contact)
        against = -slip * np.where(state == SLIP_RIGHT, 1.0, -1.0)
        worst.note("along_slip", against[:, rubs].max(initial=0.0) / self.speed, where)

    def _settled(self, now: Moment, motion: Motion, where: str) -> None:
        """Accelerations right after an event: apart from the surface, and along the slip that begins."""
        system, u = self.system, self.u
        z = motion.start(now)
        acceleration = system.J @ (motion.acceleration @ z)
        size = (np.abs(system.J) @ (motion.terms @ motion.size(z))).max() + 1e-300
        speed = (np.abs(system.J) @ np.maximum(self.fastest, np.abs(now.v))).max()
        gap, rates = system.rest + system.J[:u] @ now.q, system.J @ now.v
        # gaps and speeds near the engine's limits of what is closed and at rest may count as either
        rests = self.contact & (now.state == OPEN) & (gap <= 0.1 * SIMULTANEOUS * system.play)
        self.worst.note("starts", (-rates[:u][rests]).max(initial=0.0) / speed, where)
        rests &= np.abs(rates[:u]) <= 1e-13 * speed
        # so may accelerations
        open_yet = system.moment * np.abs(system.J @ motion.acceleration @ motion.matrix @ z).max()
        self.worst.note("starts", ((-acceleration[:u][rests]).max(initial=0.0) - open_yet) / size, where)
        way = 1.0 * (now.state == SLIP_RIGHT) - (now.state == SLIP_LEFT)
        starts = (way != 0) & (np.abs(rates[u:]) <= 1e-13 * speed) & ((system.friction > 0) | ~self.contact)
        self.worst.note("starts", ((-way * acceleration[u:])[starts].max(initial=0.0) - open_yet) / size, where)

    def _jump(self, v: np.ndarray, after: Moment, impulse: np.ndarray, allowed: float, where: str) -> None:
        """Impulses explain the change of the velocities, up to the share `allowed` of the fastest.

        Sliders have no mass, and may begin to move at once.
        """
        root = np.sqrt(self.system.mass)
        error = root * (after.v - v) - (self.system.J.T @ impulse) / root
        error = error[: len(error) - len(self.system.tangential)]
        excess = np.abs(error).max() / (root * self.fastest).max() - allowed
        self.worst.note("momentum", max(excess, 0.0), where)

    def _impact(
        self,
        v: np.ndarray,
        before: Moment,
        after: Moment,
        hits: np.ndarray,
        shut: np.ndarray,
        motion: Motion,
        where: str,
    ) -> None:
        """The law of impact, impulses that push and stay in their cones, no gain of energy."""
        system, u, worst = self.system, self.u, self.worst
        impulse = np.zeros(2 * u)
        for hit in hits:
            impulse[int(hit[2])] += hit[5]
            impulse[u + int(hit[2])] += hit[6]
        first, then = system.J @ v, system.J @ (v + (system.J.T @ impulse) / system.mass)
        normal, tangential = impulse[:u], impulse[u:]
        self.fastest = np.maximum(self.fastest, np.abs(after.v))
        speed = (np.abs(system.J) @ self.fastest).max()
        heaviest = 1 / np.diag(system.delassus)[:u][self.contact].min()
        size = np.abs(impulse).max() + 1e-6 * speed * heaviest
        worst.note("impulse", (-normal).max(initial=0.0) / size, where)
        worst.note("impulse", (np.abs(tangential) - system.friction * np.maximum(normal, 0.0)).max() / size, where)
        lost = 0.5 * ((v**2 - (v + (system.J.T @ impulse) / system.mass) ** 2) * system.mass).sum()
        there = 0.5 * (system.mass * self.fastest**2).sum()
        # Painleve's paradox: impulses without a collision, or after one, up to the accelerations of a moment
        numbers = hits[:, 2].astype(int)
        if len(np.unique(numbers)) < len(numbers) or (-first[numbers]).max() <= 1e-12 * speed:
            worst.jams += 1
            self._jump(v, after, impulse, self._moment(after, motion) / speed, where)
            worst.note("gain", -lost / there, where)
            return
        worst.note("gain", -lost / there, where)
        # impacts of one contact as good as at once end a collapse without rebound
        collapsed = after.time - self.last <= 10 * COLLAPSE * system.period
        # a gap near the engine's limit of what is closed may have counted as open
        gap = system.rest + system.J[:u] @ after.q
        surely = shut & ((after.state != OPEN) | (gap <= 0.1 * SIMULTANEOUS * system.play))
        # speeds after are sums of these terms, large where a block is wedged: a thousandth of theirs is speed enough
        terms = (np.abs(system.delassus) @ np.abs(impulse)).max()
        allowed = self._moment(after, motion) / speed
        rows, rates = np.r_[shut, shut & (system.friction > 0)], np.abs(system.J @ after.v)
        worst.note("round_off", np.sum(rows & (rates > 1e-11 * speed) & (rates < 1e-14 * terms)), where)
        caught = np.any(shut & (then[:u] > 1e-13 * speed) & (then[:u] < allowed * speed))
        self._jump(v, after, impulse, allowed if caught else 0.0, where)
        speed += 1e-3 * terms
        if system.two_phases:
            self._phases(first, impulse, (shut, surely), collapsed, (size, speed), where)
        else:
            self._newton(first, then, impulse, (shut, surely), collapsed, (size, speed), where)
        self.last[hits[:, 2].astype(int)] = after.time

    def _coulomb(self, impulse, then, closed, sizes, where) -> None:
        """Contacts do not approach after impulses; friction within its cone stops a slip, and is against one."""
        system, u, worst, (size, speed), (shut, surely) = self.system, self.u, self.worst, sizes, closed
        normal, tangential = impulse[:u], impulse[u:]
        beyond = np.abs(tangential) - system.friction * np.maximum(normal, 0.0)
        worst.note("impulse", (-normal).max(initial=0.0) / size, where)
        worst.note("impulse", beyond.max() / size, where)
        inside = shut & (system.friction > 0) & (beyond < -1e-9 * size)
        worst.note("newton", np.abs(then[u:][inside]).max(initial=0.0) / speed, where)
        worst.note("impulse", (tangential * then[u:])[shut].max(initial=0.0) / (size * speed), where)
        worst.note("newton", (-then[:u])[surely].max(initial=0.0) / speed, where)

    def _phases(self, first, impulse, closed, collapsed, sizes, where) -> None:
        """Poisson's law: of the impulses of compression, and of what expansion adds to them."""
        system, u, (size, speed), (shut, _) = self.system, self.u, sizes, closed
        compression = self.stepper.run.scratch.compression
        between = first + system.delassus @ compression
        self._coulomb(compression, between, closed, sizes, where)
        held = shut & (compression[:u] > 1e-9 * size)
        self.worst.note("newton", np.abs(between[:u][held]).max(initial=0.0) / speed, where)
        expansion, then = impulse - compression, first + system.delassus @ impulse
        self._coulomb(expansion, then, closed, sizes, where)
        asked = np.where(collapsed, 0.0, system.restitution * compression[:u])
        judged = shut & (asked > 1e-6 * size)
        share = min((expansion[:u][judged] / asked[judged]).min(initial=1.0), 1.0)
        self.worst.reduced += share < 1.0 - 1e-6
        more = np.abs(expansion[:u] - share * asked)
        apart = shut & (then[:u] > 1e-9 * speed) & ~collapsed
        self.worst.note("newton", more[apart].max(initial=0.0) / size, where)

    def _newton(self, first, then, impulse, closed, collapsed, sizes, where) -> None:
        """Newton's law in Moreau's form."""
        system, u, worst, (size, speed), (shut, surely) = self.system, self.u, self.worst, sizes, closed
        self._coulomb(impulse, then, closed, sizes, where)
        target, pushes = system.restitution * np.maximum(-first[:u], 0.0), shut & (impulse[:u] > 1e-9 * size)
        first_hit = np.argmax(np.where(pushes, target, -1.0))
        if pushes[first_hit] and then[first_hit] < target[first_hit] - 1e-9 * speed:
            # one share of all coefficients: with more the impact would bring energy, or a wedged block has no solution
            target = target * max(then[first_hit] / target[first_hit], 0.0)
            worst.reduced += 1
        judged = (surely | pushes) & ~collapsed
        short = target - then[:u]
        if judged[pushes].all():
            worst.note("newton", short[judged].max(initial=0.0) / speed, where)
            worst.note("newton", np.abs(short[pushes]).max(initial=0.0) / speed, where)

    def _moment(self, now: Moment, motion: Motion) -> float:
        """Speed that counts as chatter."""
        acceleration = np.abs(self.system.J) @ (motion.terms @ motion.size(motion.start(now)))
        return 200 * CHATTER * self.system.period * acceleration.max()

    def _energy(self, moment: Moment) -> float:
        system = self.system
        pressed = np.isfinite(system.spring) & (moment.state < OPEN)
        shift = (system.rest + system.J[: self.u] @ moment.q)[pressed]
        return float(
            0.5 * (system.spring[pressed] * shift**2).sum()
            + 0.5 * (system.tangential * (system.elongation @ moment.q) ** 2).sum()
            + 0.5 * (system.mass * moment.v**2)[: len(moment.v) - len(system.tangential)].sum()
            + 0.5 * moment.q @ system.stiffness @ moment.q
            - system.weight @ moment.q
        )

    def _ledger(self, after: Moment, where: str) -> None:
        system, change = self.system, after.ledger - self.initial.ledger
        flowed = np.abs(change[:5]).sum() + 0.5 * (system.mass * self.fastest**2).sum()
        flowed += np.abs(system.weight * after.q).sum()
        self.flowed = max(self.flowed, flowed)
        closed = self._energy(after) - self._energy(self.initial) - change[0] + change[1:5].sum()
        # round-off of where a stiff spring rests grows with its stiffness over the structure's; as a force it works
        soft = np.diag(system.stiffness)[np.diag(system.stiffness) > 0].min(initial=np.inf)
        stiff = system.spring[np.isfinite(system.spring)].max(initial=0.0)
        wrong = np.finfo(float).eps * stiff * max(stiff / soft, 1.0) * system.play[self.contact].max(initial=0.0)
        noise = wrong * self.speed * (after.time - self.initial.time) if stiff else 0.0
        self.worst.note("ledger", max(abs(closed) - noise, 0.0) / self.flowed, where)


def check_laws(
    seed: int, longest: int = LONGEST, law: str | dict = "newton", data: dict | None = None
) -> tuple[Worst | None, int]:
    """Check a random scene with a contact law, or that of other tables.

    Returns the largest violations, None if it has no start, and the code of its end.
    """
    given = tables(seed) | {"contact": law if isinstance(law, dict) else {"law": law}} if data is None else data
    try:
        scene = scene_of(given)
        checker = Checker(scene, f"seed {seed}")
    except InputError:
        return None, DONE
    return checker.run(longest), checker.stepper.code


def laws_of(first: int, count: int, longest: int = LONGEST, law: str | dict = "newton") -> tuple[Worst, Counter[int]]:
    """Check so many scenes. Returns the largest violations and how runs ended that gave up, by their codes."""
    largest, ends, seed = Worst(), Counter(), first
    while largest.scenes < count:
        worst, code = check_laws(seed, longest, law)
        if worst is not None:
            largest.merge(worst)
            ends[int(code)] += code not in (DONE, EVENT_BUDGET)
        seed += 1
    return largest, +ends


# --- mirror images


def positions(stepper: Stepper, times: np.ndarray, unique: bool = False) -> np.ndarray:
    """Coordinates (t, N) of a run at increasing times; fewer if it ends before, or `unique` impacts do."""
    stepper.settle()
    before, found = stepper.moment(), []
    friction, motions = stepper.run.system.friction, Motions(stepper.run.system)
    for _ in range(LONGEST):
        hits = stepper.step() if len(found) < len(times) else None
        if hits is None:
            break
        if unique and np.count_nonzero(friction[hits[:, 2].astype(int)]) > 2:
            times = times[times < stepper.moment().time]
        after = stepper.moment()
        while len(found) < len(times) and times[len(found)] <= after.time:
            motion = motions.of(before)
            z = expm(motion.matrix * (times[len(found)] - before.time)) @ motion.start(before)
            found.append(z[: motion.n])
        before = after
    return np.reshape(found, (len(found), len(before.q)))


def image_parts(seed: int, data: dict | None = None) -> int:
    """Compare a random scene, or that of other tables, with its mirror image at points in time. Returns at how many.

    Up to where scenes with other masses, by PERTURBATION, have parted from it; there the image may be as far from it.
    A chatter may end a flight earlier or later, and an impact of many contacts with friction may have several
    solutions: there the comparison ends, too.
    """
    data = tables(seed) if data is None else data
    try:
        steppers = [Stepper(scene_of(each)) for each in (data, mirrored(data), *map(_perturbed(data), (1, -1)))]
    except InputError:
        return 0
    system = steppers[0].run.system
    times = np.linspace(0.0, 2.0 * system.period, 2 * PLACES + 1)
    one, image, *near = (positions(stepper, times, unique=True) for stepper in steppers)
    place, sign = _image_of(system, steppers[1].run.system)
    count = min(map(len, (one, image, *near)))
    size = np.maximum(np.abs(one).max(), np.abs(one).max(axis=0)) + 1e-3
    spread = np.max([np.abs((other[:count] - one[:count]) / size).max(axis=1) for other in near], axis=0)
    spread = np.maximum.accumulate(spread)
    apart = np.abs((sign * image[:count, place] - one[:count]) / size).max(axis=1)
    compared = int(np.argmax(spread > PARTED)) if np.any(spread > PARTED) else count
    for k in range(compared):
        assert apart[k] <= max(10.0 * spread[k], 10 * CHATTER), (
            f"apart by {apart[k]:.3g} at {times[k]:.6g} (seed {seed})"
        )
    return compared


def _perturbed(data: dict):
    def other(sign: int) -> dict:
        share = 1.0 + sign * PERTURBATION
        dampers = [damper | {"mass": damper["mass"] * share**k} for k, damper in enumerate(data["damper"], 1)]
        cavities = [cavity | {"gap": cavity["gap"] * share**2} for cavity in data["cavity"]]
        return data | {"damper": dampers, "cavity": cavities}

    return other


def _image_of(system: System, image: System) -> tuple[np.ndarray, np.ndarray]:
    """Place in the mirror image of every coordinate, and its sign there: bodies are counted from the other end."""
    place, sign = np.arange(len(system.mass)), -np.ones(len(system.mass))
    for k, x in enumerate(system.along):
        partner = len(system.along) - 1 - k
        many = 3 if system.tilt[k] >= 0 else 1
        place[x : x + many] = image.along[partner] + np.arange(many)
        if many == 3:
            sign[x + 1] = 1.0
    return place, sign


def main(first: int = 0, count: int = 200, law: str = "newton") -> None:
    """Print the largest violations and the seeds of what fails."""
    largest, seed, failed = Worst(), first, []
    while largest.scenes < count:
        try:
            worst, code = check_laws(seed, law=law)
        except AssertionError as error:
            worst, code = Worst(scenes=1), DONE
            failed.append(str(error))
        if worst is not None:
            largest.merge(worst)
            if code not in (DONE, EVENT_BUDGET):
                failed.append(f"code {code} (seed {seed}) at step {worst.steps}")
        seed += 1
    print(*(f"{field.name} {getattr(largest, field.name):.3g}" for field in fields(Worst)), sep="\n")
    print(*failed, sep="\n")
    print(len(failed), "failed")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:3]), *sys.argv[3:])
