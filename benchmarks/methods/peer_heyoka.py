"""heyoka: Taylor series of high order, compiled for the equations, with guaranteed event isolation (Biscani, Izzo 2021).

One integrator holds structure and bodies. Contacts are terminal events, after which a callback in Python goes on: it
changes the velocities by the restitution of a rigid wall, or switches spring and dashpot of a soft one, which let go
before they pull. Peaks are events of the response's velocity. Lengths and times are scaled to the gap and the
excitation, as heyoka's tolerance is that of the largest component.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from benchmarks.methods.peers import DEEPEST, PeerRun, one_restitution
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.response.restart import motion_of, start_of
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.system.assembly import Motion, assemble
from vanedamp.coupling.system.line_system import LineSystem, line_system
from vanedamp.files.toml_input import InputError

#: events per period after which a run is given up: impacts that follow each other ever faster
_MOST = 10_000


def run(scene: Scene, periods: int, setting: float, samples: int) -> PeerRun:
    """Run with the tolerance `setting`.

    Raises InputError for friction, for bodies that weight holds at a wall, for a motion that is prescribed, and for a
    restitution that depends on the speed.
    """
    one_restitution("heyoka", scene)
    whole = assemble(scene)
    system, motion = line_system(whole), motion_of(whole, start_of(scene, whole))
    if system.limit.any() or system.dampers:
        raise InputError("heyoka: this set-up has no friction, whose sticking is another system of equations")
    if system.of_bodies.weight.any() or not system.modes:
        raise InputError("heyoka: this set-up has no contact that stays closed, nor a structure without modes")
    return _Run(system, motion, setting).result(periods, samples)


class _Run:
    """An integrator of a system: coordinates over `size` and their rates by the angle of the excitation."""

    def __init__(self, system: LineSystem, motion: Motion, tolerance: float) -> None:
        import heyoka

        self.system, n = system, len(system.mass)
        rows = slice(system.friction_rows, None)
        self.length = float(system.free_travel[rows].min())
        moved = np.abs(system.J).max(axis=0, initial=0.0)
        self.size = self.length / np.where(moved > 0, moved, 1.0)
        #: gaps (r,) are clear @ u + rest, over the length
        self.clear, self.rest = system.J[rows] * self.size / self.length, system.rest[rows] / self.length
        self.response = system.response * self.size
        self.contact_events, self.peaks = 0, list[tuple[float, float]]()
        self.u, self.rate = (
            heyoka.make_vars(*(f"{name}{i}" for i in range(n))) for name in ("u", "v")
        )
        #: rows of soft contacts, each with a parameter: whether it is closed
        self.soft = np.flatnonzero(np.isfinite(system.spring[rows])).tolist()
        hits = [self._contact(r) for r in range(len(self.rest))]
        forces = [force for force, _, _ in hits]
        start = np.r_[motion.q[:n] / self.size, motion.v[:n] / self.size / system.omega]
        self.limit = 0
        self.integrator = heyoka.taylor_adaptive(
            [*zip(self.u, self.rate, strict=True), *zip(self.rate, self._accelerations(forces), strict=True)],
            start, pars=[float(self.clear[r] @ start[:n] + self.rest[r] < 0) for r in self.soft], tol=tolerance,
            t_events=[
                heyoka.t_event(guard, callback=callback, direction=heyoka.event_direction.negative)
                for _, guard, callback in hits
            ],
            nt_events=[heyoka.nt_event(_sum(self.response, self.rate), callback=self._peak())],
        )  # fmt: skip
        # views, made once: making one takes as long as an impact
        self.state, self.closed = self.integrator.state, self.integrator.pars

    def _contact(self, r: int) -> tuple[Any, Any, Callable[[Any, int], bool]]:
        """Return the force on row r over its stiffness and the length, its event function, and what an event does."""
        import heyoka

        system, row, n = self.system, self.system.friction_rows + r, len(self.system.mass)
        gap = _sum(self.clear[r], self.u) + float(self.rest[r])
        touched = np.flatnonzero(self.clear[r])
        if np.isinf(system.spring[row]):
            both = -(1 + system.restitution[row]) / system.delassus[row, row] * self.length
            jump = both * system.J[row] / system.mass / self.size
            pairs = [(n + int(j), float(self.clear[r, j]), float(jump[j])) for j in touched]
            moving = [(n + int(j), float(self.response[j])) for j in np.flatnonzero(self.response)]

            def impact(integrator: Any, _: int) -> bool:
                state, speed, before, after = self.state, 0.0, 0.0, 0.0
                for j, a in moving:
                    before += a * state[j]
                for j, clear, _jump in pairs:
                    speed += clear * state[j]
                for j, _clear, change in pairs:
                    state[j] += change * speed
                for j, a in moving:
                    after += a * state[j]
                if before * after < 0:  # a peak without a root of the velocity
                    self.peaks.append((integrator.time, float(self.response @ state[:n])))
                return self._goes_on()

            return heyoka.expression(0.0), gap, impact
        damped = float(system.dashpot[row] * system.omega / system.spring[row])
        push, place = -gap - damped * _sum(self.clear[r], self.rate), self.soft.index(r)
        closed = heyoka.par[place]

        def switch(_: Any, __: int) -> bool:
            self.closed[place] = 1.0 - self.closed[place]
            return self._goes_on()

        return closed * push, gap + closed * (push - gap), switch

    def _accelerations(self, forces: list[Any]) -> list[Any]:
        import heyoka

        system, omega = self.system, self.system.omega
        phases = [(heyoka.cos(float(k) * heyoka.time), heyoka.sin(float(k) * heyoka.time)) for k in system.order]
        found = []
        for i, unit in enumerate(system.mass * self.size * omega**2):
            terms = [float(-system.stiffness[i] / omega**2) * self.u[i]]
            terms.append(_sum(-system.damping[i] * self.size * omega / unit, self.rate))
            for load, (cosine, sine) in zip(system.load[:, i] / unit, phases, strict=True):
                terms += [float(load.real) * cosine, float(-load.imag) * sine]
            for r, force in enumerate(forces):
                row = system.friction_rows + r
                if np.isfinite(system.spring[row]) and system.J[row, i]:
                    terms.append(float(system.J[row, i] * system.spring[row] * self.length / unit) * force)
            found.append(heyoka.sum(terms) + float(system.weight[i] / unit))
        return found

    def _goes_on(self) -> bool:
        self.contact_events += 1
        return self.contact_events < self.limit

    def _peak(self) -> Callable[[Any, float, int], None]:
        response = self.response

        # a function: heyoka copies callbacks, and a method with its object
        def peak(integrator: Any, angle: float, _: int) -> None:
            integrator.update_d_output(angle)
            self.peaks.append((angle, float(response @ integrator.d_output[: len(response)])))

        return peak

    def result(self, periods: int, samples: int) -> PeerRun:
        """Run a number of periods."""
        per, n, self.limit = max(samples, 1), len(self.size), _MOST * periods
        grid = 2 * np.pi * np.arange(periods * per + 1) / per
        started = time.thread_time()
        *_, states = self.integrator.propagate_grid(grid)
        seconds = time.thread_time() - started
        if len(states) < len(grid):
            return PeerRun(Status.EVENT_BUDGET.value, np.zeros(0), np.zeros((0, 0)), 0.0, seconds)
        q = states[:, :n] * self.size
        x = np.abs(q @ self.system.response)
        peak = np.maximum(x[:-1].reshape(periods, per).max(axis=1), x[per::per])
        angles, values = np.array(self.peaks).reshape(-1, 2).T
        np.maximum.at(peak, np.minimum((angles / (2 * np.pi)).astype(int), periods - 1), np.abs(values))
        rigid = np.isinf(self.system.spring[self.system.friction_rows :])
        deep = float((-(states[:, :n] @ self.clear.T + self.rest)[:, rigid]).max(initial=0.0))
        status = Status.OK if deep <= DEEPEST else Status.PENETRATION
        sampled = (q[:-1] if samples else q[:0]) @ np.c_[self.system.response, self.system.J[: self.system.bodies].T]
        return PeerRun(status.value, peak, sampled, deep, seconds)


def _sum(factors: np.ndarray, terms: list[Any]) -> Any:
    """Return the sum of products, without those that are zero."""
    import heyoka

    return heyoka.sum([float(a) * term for a, term in zip(factors, terms, strict=True) if a])
