"""A motion in 40 digits that passes given events in a given order, and its derivatives by differences of 1e-16.

Nothing is decided and nothing searched: names of events say which function of the state vanishes
next and what changes there. Equations of motion are set up from the scene's numbers, constraints as a whole matrix.
Structures are rigid, or prescribed (then bodies move relative to them).
"""

from __future__ import annotations

import itertools

import mpmath as mp
import numpy as np

from tests.reference.exact_scene import dashpots, exact_scene
from tests.reference.multiprecision import exponential
from vanedamp.coupling.scene.scene import Scene

DIGITS, STEP = 40, mp.mpf(10) ** -16


class FixedSequence:
    """The scene's equations; restitution: the law of the speed in place of Newton's."""

    def __init__(self, scene: Scene, restitution=None) -> None:
        self.scene, self.prescribed = scene, scene.structure.model == "prescribed"
        self.restitution = restitution
        bodies = scene.damper
        self.moving = 0 if self.prescribed else 1
        self.n = self.moving + len(bodies)
        self.mass = [mp.mpf(m) for m in ([] if self.prescribed else [scene.structure.mass])]
        self.mass += [mp.mpf(body.mass) for body in bodies]
        self.springs = [i for i, damper in enumerate(scene.friction_damper) if damper.stiffness is not None]
        self.omega = 2 * mp.pi * mp.mpf(scene.excitation.frequency)
        self.shares = scene.excitation.shares
        self.rows = self._rows()
        self.width = 2 * self.n + len(self.springs)

    def _rows(self):
        """name -> (functional of q, constant, restitution)."""
        scene, rows = self.scene, {}

        def slip(body):
            row = mp.zeros(1, self.n)
            row[self.moving + body] = 1
            if self.moving:
                row[0] = -1
            return row

        for i, _ in enumerate(scene.damper):
            rows[str(i)] = (slip(i), 0, None)
        for i, _ in enumerate(scene.friction_damper):
            row = mp.zeros(1, self.n)
            row[0] = 1
            rows[f"casing.{i}"] = (row, 0, None)
        for cavity in scene.cavity:
            inside = [i for i, body in enumerate(scene.damper) if body.cavity == cavity.name]
            half = mp.mpf(cavity.gap) / 2
            rows[f"{cavity.name}.left.{inside[0]}"] = (slip(inside[0]), half, scene.damper[inside[0]].restitution)
            rows[f"{cavity.name}.right.{inside[-1]}"] = (-slip(inside[-1]), half, scene.damper[inside[-1]].restitution)
            for i, j in itertools.pairwise(inside):
                mean = mp.sqrt(mp.mpf(scene.damper[i].restitution) * mp.mpf(scene.damper[j].restitution))
                rows[f"{cavity.name}.body.{i}"] = (slip(j) - slip(i), 0, mean)
        for i, stop in enumerate(scene.stop):
            row = mp.zeros(1, self.n)
            row[0] = -1 if stop.side == "right" else 1
            rows[f"stop.{i}"] = (row, mp.mpf(stop.gap), stop.restitution)
        return rows

    def limit(self, name):
        if name.startswith("casing"):
            damper = self.scene.friction_damper[int(name.split(".")[1])]
            return mp.mpf(damper.friction) * mp.mpf(damper.normal_force)
        body = self.scene.damper[int(name)]
        normal = self.scene.gravity.components(np.zeros(3))[1] * body.mass
        return mp.mpf(body.friction) * mp.mpf(normal if body.normal_load is None else body.normal_load)

    def generator(self, states, contact):
        """Generator of (q, q', elongations, 1, cosines, sines) and the forces (rows at rest) as functionals of it.

        states: name -> "left", "right", "rest" or "spring"; contact: (stiffness, {name: dashpot}) of compliant ones.
        """
        n, e = self.n, len(self.shares)
        size = self.width + 1 + 2 * e
        loads = mp.zeros(n, size)
        structure, gravity = self.scene.structure, self.scene.gravity.components(np.zeros(3))[0]
        if not self.prescribed:
            loads[0, 0] -= mp.mpf(structure.stiffness)
            loads[0, n] -= mp.mpf(structure.viscous)
        for h, (order, share) in enumerate(self.shares.items()):
            cosine, sine = self.width + 1 + h, self.width + 1 + e + h
            # amplitude sin(order w t + phase) = Im(share exp(i order w t))
            if self.prescribed:
                level = mp.mpf(structure.displacement_amplitude) * (order * self.omega) ** 2
                forces = [mass * level for mass in self.mass]
            else:
                base = mp.mpf(self.scene.excitation.base_acceleration or 0)
                forces = [-mass * base for mass in self.mass]
                forces[0] += mp.mpf(self.scene.excitation.force or 0)
            for i, force in enumerate(forces):
                loads[i, sine] += force * mp.mpf(share.real)
                loads[i, cosine] += force * mp.mpf(share.imag)
        for i in range(self.moving, n):
            loads[i, self.width] += self.mass[i] * mp.mpf(gravity)
        rest = []
        for name, state in states.items():
            row, constant, _ = self.rows[name]
            force = mp.zeros(1, size)
            if state == "rest":
                rest.append(name)
                continue
            if state == "spring" and name.startswith("casing"):
                i = int(name.split(".")[1])
                at = 2 * n + self.springs.index(i)
                force[at] = -mp.mpf(self.scene.friction_damper[i].stiffness)
            elif state == "spring":
                stiffness, dashpots = contact
                for i in range(n):
                    force[i], force[n + i] = -stiffness * row[i], -dashpots[name] * row[i]
                force[self.width] = -stiffness * constant
            elif state in ("left", "right"):
                force[self.width] = self.limit(name) * (1 if state == "left" else -1)
            loads += row.T * force
        acceleration = mp.diag([1 / m for m in self.mass]) * loads
        forces = {}
        if rest:
            held = mp.matrix([list(self.rows[name][0]) for name in rest])
            inertia = held * mp.diag([1 / m for m in self.mass]) * held.T
            reaction = -mp.inverse(inertia) * (held * acceleration)
            acceleration += mp.diag([1 / m for m in self.mass]) * held.T * reaction
            forces = {name: reaction[i, :] for i, name in enumerate(rest)}
        whole = mp.zeros(size)
        for i in range(n):
            whole[i, n + i] = 1
            whole[n + i, :] = acceleration[i, :]
        for place, i in enumerate(self.springs):
            if states.get(f"casing.{i}") == "spring":
                for j in range(n):
                    whole[2 * n + place, n + j] = self.rows[f"casing.{i}"][0][j]
        for h, order in enumerate(self.shares):
            cosine, sine = self.width + 1 + h, self.width + 1 + e + h
            whole[cosine, sine], whole[sine, cosine] = -order * self.omega, order * self.omega
        return whole, forces

    def passage(self, state, crossings, states, contact=None):
        """Final state and derivative by differences: of (structure, rates, slips, slip rates, elongations).

        crossings: events of the one period, whose times are known to 1e-12 or so; states, contact: as in `generator`.
        """
        with mp.workdps(DIGITS):
            self._exponentials = {}
            given = [mp.mpf(float(value)) for value in state]
            k = len(given)
            final = self._end(given, crossings, states, contact)
            derivative = np.zeros((k, k))
            for j in range(k):
                ends = []
                for way in (1, -1):
                    moved = list(given)
                    moved[j] += way * STEP * self.unit[j]
                    ends.append(self._end(moved, crossings, states, contact))
                derivative[:, j] = [float((a - b) / (2 * STEP * self.unit[j])) for a, b in zip(*ends, strict=True)]
            return np.array([float(value) for value in final]), derivative

    def _absolute(self, state):
        n, b, m = self.n, len(self.scene.damper), self.moving
        place, rate = list(state[:m]), list(state[m : 2 * m])
        slip, speed = state[2 * m : 2 * m + b], state[2 * m + b : 2 * m + 2 * b]
        base, moving = (place[0], rate[0]) if m else (0, 0)
        q = [*place, *(s + base for s in slip), *rate, *(v + moving for v in speed), *state[2 * m + 2 * b :]]
        assert len(q) == 2 * n + len(self.springs)
        return q

    def _relative(self, q):
        n, m = self.n, self.moving
        base, moving = (q[0], q[n]) if m else (0, 0)
        slips, speeds = [x - base for x in q[m:n]], [v - moving for v in q[n + m : 2 * n]]
        return [*q[:m], *q[n : n + m], *slips, *speeds, *q[2 * n : self.width]]

    def _end(self, state, crossings, states, contact):
        e, states, now = len(self.shares), dict(states), mp.mpf(0)
        period = 2 * mp.pi / self.omega
        z = mp.matrix([*self._absolute(state), 1, *[1] * e, *[0] * e])
        nominal = mp.mpf(0)
        for number, crossing in enumerate([*crossings, None]):
            key = (number, tuple(sorted(states.items())))
            then = period if crossing is None else mp.mpf(crossing.time)
            if key not in self._exponentials:
                generator, forces = self.generator(states, contact)
                self._exponentials[key] = generator, forces, exponential(generator, then - nominal)
            generator, forces, power = self._exponentials[key]
            z = _shift(generator, power * z, nominal - now)
            if crossing is None:
                # the excitation is at its phase again, which events have moved by nothing
                return self._relative(list(z))
            z, late = self._to_event(crossing.name, states, generator, forces, contact, z)
            now, nominal = then + late, then
            self._change(crossing.name, states, z, contact)
        raise AssertionError

    def _to_event(self, names, states, generator, forces, contact, z):
        """State and time, after the nominal one, at which the first event of a name happens: by Newton's method."""
        verb, name = names.split(", ")[0].split(" ")[:2]
        row, constant, _ = self.rows[name]
        n, functional = self.n, mp.zeros(1, len(z))
        if verb == "impact" or (verb == "leaves" and states.get(name) == "lags"):
            for i in range(n):
                functional[i] = row[i]
            functional[self.width] = constant
        elif verb in ("turns", "sticks"):
            for i in range(n):
                functional[n + i] = row[i]
        elif verb in ("leaves", "lags") and states[name] == "spring":
            stiffness, dashpots = contact
            for i in range(n):
                functional[i], functional[n + i] = stiffness * row[i], dashpots[name] * row[i]
            functional[self.width] = stiffness * constant
        elif states[name] == "spring":
            i = int(name.split(".")[1])
            functional[2 * n + self.springs.index(i)] = mp.mpf(self.scene.friction_damper[i].stiffness)
            functional[self.width] = self.limit(name) * (-1 if names.split(", ")[0].endswith("right") else 1)
        else:
            functional = forces[name].copy()
            if verb == "slips":
                functional[self.width] += self.limit(name) * (1 if names.split(", ")[0].endswith("right") else -1)
        late = mp.mpf(0)
        for _ in range(4):
            step = -(functional * z)[0] / (functional * (generator * z))[0]
            z, late = _shift(generator, z, step), late + step
        return z, late

    def _change(self, names, states, z, contact):
        n = self.n
        hit = [part.split(" ")[1] for part in names.split(", ") if part.startswith("impact")]
        resting = [part.split(" ")[1] for part in names.split(", ") if part.startswith("rests")]
        for name in hit if contact is None else ():
            row, _, restitution = self.rows[name]
            velocity = mp.matrix([z[n + i] for i in range(n)])
            speed = (row * velocity)[0]
            if self.restitution is not None:
                restitution = self.restitution(-speed)
            restitution = 0 if name in resting else mp.mpf(restitution)
            inverse = mp.diag([1 / m for m in self.mass])
            velocity -= inverse * row.T * ((1 + restitution) * speed / (row * inverse * row.T)[0])
            for i in range(n):
                z[n + i] = velocity[i]
        for part in names.split(", "):
            verb, name, *way = part.split(" ")
            if verb == "impact" and contact is not None:
                states[name] = "spring"
            elif verb in ("turns", "slips"):
                states[name] = way[0]
            elif verb in ("sticks", "rests"):
                sprung = name.startswith("casing") and int(name.split(".")[1]) in self.springs
                states[name] = "spring" if sprung else "rest"
            elif verb == "lags":
                states[name] = "lags"
            elif verb == "leaves":
                states[name] = "open"
        if len(resting):  # a body at a wall that moves with its floor is held by it, not by friction
            for name in resting:
                states.pop(name.split(".")[-1], None) if states.get(name.split(".")[-1]) == "rest" else None

    @property
    def unit(self):
        """Units of differences: displacements of 1, rates of omega."""
        b, m = len(self.scene.damper), self.moving
        sizes = [1] * m + [self.omega] * m + [1] * b + [self.omega] * b + [1] * len(self.springs)
        return [mp.mpf(size) for size in sizes]


def along(scene, state, crossings, states, direction, law=None):
    """Derivative (k,) of the final state, from the same start, as numbers change together, by differences.

    direction: path -> change of its number per unit; law: scene with exact numbers -> law of the speed in place of
    Newton's.
    """
    with mp.workdps(DIGITS):
        start, ends = [mp.mpf(float(value)) for value in state], []
        for way in (1, -1):
            exact = exact_scene(scene, {path: way * STEP * change for path, change in direction.items()})
            sequence, contact = FixedSequence(exact, law and law(exact)), None
            if exact.contact.law == "compliant":
                contact = exact.contact.stiffness, dashpots(exact, sequence.rows, sequence.mass)
            sequence._exponentials = {}
            ends.append(sequence._end(start, crossings, states, contact))
        return np.array([float((a - b) / (2 * STEP)) for a, b in zip(*ends, strict=True)])


def _shift(generator, z, duration):
    """The state after a tiny duration, by Taylor's series."""
    term, total = z, z
    for power in range(1, 9):
        term = generator * term * (duration / power)
        total = total + term
    return total
