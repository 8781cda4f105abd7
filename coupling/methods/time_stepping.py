"""Methods that take time steps, and solve_ivp: the same scene in, the same response out as of the exact engine.

`solver.method` chooses: "moreau" (methods.moreau), "penalty" (methods.central_difference, methods.newmark), "cosim"
(methods.cosimulation) and "solve_ivp" (methods.scipy_ivp.run).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from vanedamp.coupling.methods import equations_of_motion as sy
from vanedamp.coupling.methods.central_difference import explicit_matrix, march_explicit
from vanedamp.coupling.methods.cosimulation import cosimulation_matrices, march_cosimulation
from vanedamp.coupling.methods.moreau import march_moreau, moreau_matrices
from vanedamp.coupling.methods.newmark import march_newmark, newmark_matrices
from vanedamp.coupling.methods.penalty import with_penalty
from vanedamp.coupling.numerics.complementarity import new_problem
from vanedamp.coupling.response.evaluation import Outcome, Run
from vanedamp.coupling.response.records import new_records
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.system.assembly import assemble, initial_motion
from vanedamp.files.toml_input import InputError

_STATUS = {
    sy.DONE: Status.OK,
    sy.DIVERGED: Status.DIVERGED,
    sy.UNDECIDED: Status.UNDECIDED,
    sy.PENETRATION: Status.PENETRATION,
    sy.EVENT_BUDGET: Status.EVENT_BUDGET,
}

#: imbalance of the ledger above which a response is not to be used
_OPEN_LEDGER = 0.1
#: entries of the log of impacts between two looks at it
_LOG = 100_000

#: steps to the end of so many periods with this log; returns a code of methods.equations_of_motion
March = Callable[[np.ndarray, int], int]


class SteppedRun:
    """A run of a stepping method: matrices, motion and records."""

    def __init__(self, scene: Scene, events: bool, samples_per_period: int) -> None:
        self.system = assemble(scene)
        self.times = sy.time_grid(self.system, scene.solver.steps)
        self.motion = sy.start(self.system, initial_motion(scene, self.system))
        self.records = new_records(self.system, scene.time.simulated, samples_per_period)
        self.log = np.zeros((_LOG if events else 0, 6))
        self.chunks: list[np.ndarray] = []
        self.march = _march(scene, self)

    def advance_to(self, periods: int) -> Status:
        """Continue to the end of `periods`, or to what ends the run."""
        counters = self.motion.counters
        while True:
            # with a log, period by period, so that it can be emptied
            target = min(periods, int(counters[sy.PERIOD]) + 1) if len(self.log) else periods
            code = self.march(self.log, target)
            self.chunks.append(self.log[: counters[sy.LOGGED]].copy())
            counters[sy.LOGGED] = 0
            if code != sy.DONE:
                return _STATUS[code]
            if counters[sy.PERIOD] >= periods:
                break
        return Status.OK

    def outcome(self) -> Outcome:
        """What the run leaves behind."""
        counters = self.motion.counters
        numbers = {
            "impacts": int(counters[sy.IMPACTS]), "steps": int(counters[sy.STEPS]), "solves": int(counters[sy.SOLVES])
        }  # fmt: skip
        return Outcome(
            self.system, self.records, int(counters[sy.PERIOD]), numbers["impacts"], _OPEN_LEDGER, numbers,
            [chunk for chunk in self.chunks if len(chunk)], float(self.motion.deepest[0]),
        )  # fmt: skip


def begin_run(scene: Scene, events: bool, samples_per_period: int) -> Run:
    """A run of the scene's method, at time zero.

    Raises InputError for what the method cannot do, and where samples do not fall on steps.
    """
    if samples_per_period and scene.solver.steps % samples_per_period:
        raise InputError(
            f"solver.steps_per_period: {scene.solver.steps} is no multiple of {samples_per_period} samples a period"
        )
    if scene.solver.method == "solve_ivp":
        from vanedamp.coupling.methods.scipy_ivp.run import IvpRun

        return IvpRun(scene, events, samples_per_period)
    return SteppedRun(scene, events, samples_per_period)


def _march(scene: Scene, run: SteppedRun) -> March:
    solver, motion, records = scene.solver, run.motion, run.records
    deepest, budget, problem = solver.deepest, solver.max_events, new_problem(len(run.system.J))
    if solver.method == "moreau":
        theta = 0.5 if solver.theta is None else solver.theta
        matrices = moreau_matrices(run.system, run.times, theta)
        return lambda log, periods: march_moreau(
            run.system, run.times, motion, records, log, problem, *matrices, theta, periods, budget, deepest
        )
    run.system, slow = with_penalty(run.system, run.times, solver)
    if solver.method == "cosim":
        return _cosimulation(scene, run, slow)
    if solver.scheme in ("newmark", "hht"):
        alpha = (-0.1 if solver.alpha is None else solver.alpha) if solver.scheme == "hht" else 0.0
        implicit = newmark_matrices(run.system, run.times, alpha)
        if solver.slip_velocity is None:
            slow = np.zeros_like(slow)  # implicit: Coulomb's law as it is
        return lambda log, periods: march_newmark(
            run.system, run.times, motion, records, log, problem, *implicit, slow, periods, budget, deepest
        )
    inverse = explicit_matrix(run.system, run.times)
    return lambda log, periods: march_explicit(
        run.system, run.times, motion, records, log, inverse, slow, periods, budget, deepest
    )


def _cosimulation(scene: Scene, run: SteppedRun, slow: np.ndarray) -> March:
    solver = scene.solver
    substeps = solver.substeps or 10
    matrices = cosimulation_matrices(run.system, run.times, substeps)
    memory = np.zeros((3, 4 * run.system.modes + len(run.system.J)))
    gauss_seidel, hold = solver.exchange != "jacobi", 1 if solver.hold is None else solver.hold
    return lambda log, periods: march_cosimulation(
        run.system, run.times, run.motion, run.records, log, *matrices, memory, slow, gauss_seidel, hold,
        substeps, periods, solver.max_events, solver.deepest,
    )  # fmt: skip
