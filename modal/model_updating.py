"""Model updating: moduli and support stiffnesses that bring natural frequencies to measured ones.

The stiffness is a sum of parts, K = sum p_j K_j, whose factors p_j start at one; `modal.elasticity.Solid` gives the
parts of a mesh, but any symmetric matrices do.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy import sparse
from scipy.optimize import least_squares, linear_sum_assignment

from vanedamp.files.errors import VanedampError
from vanedamp.files.store import frozen
from vanedamp.modal.correlation import LEAST_MAC, MeasuredShapes, Pairing, measured_mac, modal_assurance, pair_modes
from vanedamp.modal.eigen import solve_modes
from vanedamp.modal.kept_solutions import Arrays, Keep, not_kept
from vanedamp.modal.matrices import SystemMatrices
from vanedamp.modal.records.modes import Modes

#: factors stay between this and its inverse
LIMIT = 0.02
#: relative error of the measured frequencies for which deviations of the factors are given
FREQUENCY_ERROR = 1e-3
#: relative errors of a tuned frequency: scatter of measurements up to the first, a warning above the second, wrong
#: modes above the third
_SCATTER, _DOUBTFUL, _MISSED = FREQUENCY_ERROR, 0.01, 0.05
#: another pairing is better below this fraction of the sum of squared errors, or of squared logarithms of factors
_BETTER = 0.1
#: number of other pairings tried if the frequencies are not met
_PAIRINGS = 4
# further modes that are computed, so that a rising mode is not lost
_SPARE = 4
#: fraction of the stiffness that may be round-off of the assembly
_ROUND_OFF = 1e-12
# relative to the largest singular value of the sensitivities: below it, two factors have the same effect
_ALIKE = 1e-6


class TuningError(VanedampError):
    """Parts, targets or modes that determine no factors; the message names the argument and the remedy."""


@dataclass(frozen=True, eq=False)
class Tuning:
    """Factors on parts of the stiffness, and their effect on the frequencies.

    names          (p,) of the parts
    factors        (p,) on each part
    deviations     (p,) relative standard deviations of the factors if the measured frequencies err by 0.1 % each;
                   large values mean that these frequencies do not determine each factor
    target_hz      (n,) measured frequencies
    before_hz, after_hz   (n,) of the computed modes paired with them
    modes_before, modes_after  (n,) indices of these partners
    mac_before, mac_after      (n,) MAC with the measured shapes, or with the untuned modes where none were given
    sensitivities  (n, p) d log f / d log factor, after tuning: half the fraction of the strain energy in a part
    evaluations    eigenvalue problems solved
    matrices       the tuned system
    warnings       points to check: frequencies that are missed, another pairing with less change
    """

    names: tuple[str, ...]
    factors: np.ndarray
    deviations: np.ndarray
    target_hz: np.ndarray
    before_hz: np.ndarray
    after_hz: np.ndarray
    modes_before: np.ndarray
    modes_after: np.ndarray
    mac_before: np.ndarray
    mac_after: np.ndarray
    sensitivities: np.ndarray
    evaluations: int
    matrices: SystemMatrices
    warnings: tuple[str, ...] = ()


def sensitivities(
    modes: Modes, parts: Mapping[str, sparse.csr_array], indices: Sequence[int] | np.ndarray | None = None
) -> np.ndarray:
    """Return d log f_i / d log p_j = phi_i^T (p_j K_j) phi_i / (2 lambda_i), (n, p), of mass-normalised modes.

    parts are the p_j K_j. Fox and Kapoor (1968, AIAA J. 6): d lambda = phi^T dK phi, for modes of distinct frequencies.
    """
    chosen = np.arange(len(modes)) if indices is None else np.asarray(indices)
    shapes, eigenvalues = modes.shapes[chosen], modes.angular_frequencies[chosen] ** 2
    energies = [np.einsum("ij,ij->i", shapes, shapes @ matrix) for matrix in parts.values()]
    return np.column_stack(energies) / (2.0 * eigenvalues[:, None])


def tune(
    matrices: SystemMatrices,
    parts: Mapping[str, sparse.csr_array],
    target_hz: Sequence[float] | np.ndarray,
    measured: MeasuredShapes | None = None,
    modes: Sequence[int] | None = None,
    least_mac: float = LEAST_MAC,
    starts: int = 1,
    keep: Keep = not_kept,
) -> Tuning:
    """Find factors on parts of the stiffness that bring modes to target frequencies, by least squares in log f.

    parts      the parts that may change, name -> (N, N); the rest of the stiffness stays
    target_hz  (n,) measured frequencies
    measured   (n) measured shapes: every target belongs to the mode that pairs with its shape
    modes      (n,) or else the indices of the modes meant, of the untuned system; left out: the first n

    starts     where modes veer, frequencies can be met nearly by several sets of factors: 1 searches from the system as
               it is, more from as many further points between half and twice its factors, and the best is kept
    keep       of evaluations, from an interrupted call

    Least squares on the logarithms of the factors (Gauss-Newton in a trust region) with exact sensitivities; the modes
    are tracked by their MAC, so that they may cross. One factor on the whole stiffness leaves the shapes as they are:
    after one eigenvalue problem the rest is in closed form.

    Raises TuningError, also for frequencies that the tuned modes miss by more than 5 %, and where other modes would
    meet them far better, or with far less change of the factors unless `modes` are named. These come from the best
    assignment by relative distance of the frequencies, untuned and tuned.
    """
    problem = _Problem(matrices, dict(parts), np.asarray(target_hz, dtype=float), measured, modes, least_mac, keep)
    start = np.zeros(len(problem.parts))
    before = problem.at(start)
    problem.check_pairs(before)
    _check_rank(before.jacobian, problem)
    bound = -np.log(LIMIT)
    fit = _fit(problem, start, bound)
    for point in np.random.default_rng(0).uniform(-np.log(2.0), np.log(2.0), (starts - 1, start.size)):
        problem.follow_from_start()
        candidate = _fit(problem, point, bound)
        fit = candidate if candidate.cost < fit.cost else fit
    problem.follow_from_start()
    after = problem.at(fit.x)
    problem.check_pairs(after)
    stuck = np.flatnonzero(np.abs(fit.x) > 0.999 * bound)
    if stuck.size:
        name = list(problem.parts)[stuck[0]]
        raise TuningError(
            f"{name}: its factor runs to {np.exp(fit.x[stuck[0]]):.3g} and the frequencies still do not meet "
            f"{problem.target.tolist()} Hz; check which modes these belong to, and vary another part"
        )
    warnings = _doubts(problem, before, after, fit)
    spread = np.linalg.pinv(after.jacobian)
    return Tuning(
        names=tuple(problem.parts),
        factors=frozen(np.exp(fit.x)),
        deviations=frozen(FREQUENCY_ERROR * np.linalg.norm(spread, axis=1)),
        target_hz=frozen(problem.target),
        before_hz=frozen(before.frequencies),
        after_hz=frozen(after.frequencies),
        modes_before=frozen(before.indices, np.int64),
        modes_after=frozen(after.indices, np.int64),
        mac_before=frozen(before.mac),
        mac_after=frozen(after.mac),
        sensitivities=frozen(after.jacobian),
        evaluations=problem.evaluations,
        matrices=problem.system(fit.x),
        warnings=warnings,
    )


def _doubts(problem: _Problem, before: _State, after: _State, search: Any) -> tuple[str, ...]:
    """Return warnings about the pairing of a search's result. Raises TuningError for one that cannot be right."""
    miss = float(np.abs(np.expm1(after.residual)).max())
    alternative = None if problem.measured is not None else _other_pairing(problem, before, after, search, miss)
    if alternative is not None:
        meant, fit = alternative
        by = float(np.abs(np.expm1(fit.fun)).max())
        better = (
            f"modes: {meant.tolist()} meet the frequencies {_listed(problem.target)} Hz to {by:.2g} with factors "
            f"{_listed(np.exp(fit.x))}, modes {problem.meant.tolist()} to {miss:.2g} with {_listed(np.exp(search.x))}; "
            "say which modes they are, by `modes` or measured shapes"
        )
        if miss > _DOUBTFUL or problem.modes is None:
            raise TuningError(better)
        return (better,)
    if miss <= _DOUBTFUL:
        return ()
    misses = ", ".join(f"{error:+.1%}" for error in np.expm1(after.residual))
    missed = (
        f"target_hz: the tuned modes {after.indices.tolist()} lie at {_listed(after.frequencies)} Hz, off the measured "
        f"{_listed(problem.target)} Hz by {misses}"
    )
    if miss > _MISSED:
        raise TuningError(f"{missed}; check which modes these are, by measured shapes, or vary other parts")
    return (f"{missed}, more than measurements scatter",)


def _other_pairing(
    problem: _Problem, before: _State, after: _State, search: Any, miss: float
) -> tuple[np.ndarray, Any] | None:
    """Return other modes and the search for them, where they meet the frequencies far better or with far less change.

    With as many factors as frequencies, any modes may fit: then the change of the factors decides.
    """
    enough = len(problem.parts) == len(problem.target)
    if miss <= _SCATTER and not enough:
        return None
    tried = {tuple(problem.meant.tolist())}
    waiting = [problem.nearest(before.all_hz), problem.nearest(after.all_hz)]
    best: tuple[np.ndarray, Any] | None = None
    while waiting and len(tried) <= _PAIRINGS:
        meant = waiting.pop(0)
        if tuple(meant.tolist()) in tried:
            continue
        tried.add(tuple(meant.tolist()))
        trial = _Problem(
            problem.matrices, problem.parts, problem.target, None, meant.tolist(), problem.least, problem.keep
        )
        trial.scaled_from(before)
        fit = _fit(trial, np.zeros(search.x.size), -np.log(LIMIT))
        problem.evaluations += trial.evaluations
        waiting.append(trial.nearest(trial.at(fit.x).all_hz))
        if best is None or fit.cost < best[1].cost:
            best = meant, fit
    if best is None:
        return None
    meets = np.abs(np.expm1(best[1].fun)).max() <= _SCATTER
    less_change = meets and best[1].x @ best[1].x < _BETTER * (search.x @ search.x)
    if miss <= _SCATTER:
        return best if less_change else None
    return best if best[1].cost < _BETTER * search.cost else None


def _listed(values: np.ndarray) -> str:
    return ", ".join(f"{value:.6g}" for value in values)


def _fit(problem: _Problem, start: np.ndarray, bound: float) -> Any:
    return least_squares(
        lambda x: problem.at(x).residual, start, jac=lambda x: problem.at(x).jacobian, bounds=(-bound, bound),
        xtol=1e-10, ftol=1e-12, gtol=1e-12, max_nfev=50,
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class _State:
    """The paired modes at one set of factors; all_hz: (k,) frequencies of all computed modes."""

    all_hz: np.ndarray
    frequencies: np.ndarray
    indices: np.ndarray
    mac: np.ndarray
    residual: np.ndarray
    jacobian: np.ndarray

    def scaled(self, factor: float, modes: np.ndarray, target: np.ndarray) -> _State:
        """Return the state of some modes (n,) with the whole stiffness times a factor; target (n,): Hz."""
        all_hz = self.all_hz * np.sqrt(factor)
        whole, unchanged = np.full((len(modes), 1), 0.5), np.array_equal(modes, self.indices)
        mac = self.mac if unchanged else np.ones(len(modes))
        return _State(all_hz, all_hz[modes], modes, mac, np.log(all_hz[modes] / target), whole)


@dataclass(eq=False)
class _Followed:
    """The modes at one set of factors by which the next ones are paired; shapes: None until they are asked for."""

    point: np.ndarray
    indices: np.ndarray
    shapes: np.ndarray | None


@dataclass(eq=False)
class _Problem:
    """Residuals and Jacobian at logarithms of factors; keeps the last state, and follows the modes.

    Arguments: see `tune`; meant: (n,) the modes that the targets belong to, unless shapes say so.
    """

    matrices: SystemMatrices
    parts: dict[str, sparse.csr_array]
    target: np.ndarray
    measured: MeasuredShapes | None
    modes: Sequence[int] | None
    least: float
    keep: Keep = not_kept
    evaluations: int = 0
    _first: _State | None = None
    _point: np.ndarray | None = None
    _state: _State | None = None
    _origin: _Followed | None = None
    _followed: _Followed | None = None

    def __post_init__(self) -> None:
        self._check(self.modes)
        self.meant = np.arange(self.target.size) if self.modes is None else np.asarray(self.modes, dtype=int)
        self.count = min(int(self.meant.max()) + 1 + _SPARE, self.matrices.free.size)

    @cached_property
    def scales(self) -> bool:
        """Whether there is one factor, on the whole stiffness, up to round-off."""
        if len(self.parts) != 1:
            return False
        [matrix] = self.parts.values()
        remainder = abs(self.matrices.stiffness - matrix)
        return bool(remainder.max() <= _ROUND_OFF * abs(matrix).max())

    def scaled_from(self, untuned: _State) -> None:
        """Take the untuned state of other modes, where one factor scales all of them."""
        if self.scales:
            self._first = untuned.scaled(1.0, self.meant, self.target)

    def system(self, point: np.ndarray) -> SystemMatrices:
        """Return the matrices with these factors."""
        stiffness = self.matrices.stiffness
        for factor, matrix in zip(np.exp(point), self.parts.values(), strict=True):
            stiffness = stiffness + (factor - 1.0) * matrix
        return replace(self.matrices, stiffness=sparse.csr_array(stiffness))

    def at(self, point: np.ndarray) -> _State:
        """Return the state at logarithms of the factors; computed once for residual and Jacobian."""
        if self._state is None or self._point is None or not np.array_equal(point, self._point):
            self._state, self._point = self._evaluate(point), np.array(point)
        return self._state

    def check_pairs(self, state: _State) -> None:
        """Raise TuningError for a measured shape that no computed mode is like."""
        worst = int(np.argmin(state.mac))
        if self.measured is not None and state.mac[worst] < self.least:
            raise TuningError(
                f"measured: no computed mode pairs with target {worst} ({self.target[worst]:.6g} Hz), the best MAC is "
                f"{state.mac[worst]:.2g}; give shapes at more points, or leave this frequency out"
            )

    def follow_from_start(self) -> None:
        """Forget the modes followed so far; the next ones are paired with the untuned modes."""
        self._state, self._followed = None, self._origin

    def nearest(self, frequencies: np.ndarray) -> np.ndarray:
        """Return the modes (n,) whose frequencies (k,), Hz, lie nearest to the targets, each taken once."""
        above = np.maximum(frequencies, np.finfo(float).tiny)
        _, modes = linear_sum_assignment(np.log(self.target[:, None] / above) ** 2)
        return np.asarray(modes)

    def _evaluate(self, point: np.ndarray) -> _State:
        if self._first is not None:
            return self._first.scaled(float(np.exp(point[0])), self._first.indices, self.target)
        self.evaluations += 1
        shapes: np.ndarray | None = None  # not stored with earlier evaluations

        def solved() -> Arrays:
            nonlocal shapes
            modes = solve_modes(self.system(point), self.count)
            pairing = self._pair(modes)
            indices, mac = pairing.second, pairing.pair_mac
            shapes, frequencies = modes.shapes[indices], modes.frequencies_hz[indices]
            scaled = {n: f * k for f, (n, k) in zip(np.exp(point), self.parts.items(), strict=True)}
            if self.measured is None:
                origin = shapes if self._origin is None else self._shapes(self._origin)
                mac = np.diag(modal_assurance(origin, shapes, self.matrices.mass))
            residual, jacobian = np.log(frequencies / self.target), sensitivities(modes, scaled, indices)
            return asdict(_State(modes.frequencies_hz, frequencies, indices, mac, residual, jacobian))

        state = _State(**self.keep(solved))
        self._followed = _Followed(np.array(point), state.indices, shapes)
        self._origin = self._origin or self._followed
        if self.scales and not point.any():
            self._first = state
        return state

    def _shapes(self, modes: _Followed) -> np.ndarray:
        if modes.shapes is None:
            modes.shapes = solve_modes(self.system(modes.point), self.count).shapes[modes.indices]
        return modes.shapes

    def _pair(self, modes: Modes) -> Pairing:
        """Pair all targets (first) with computed modes (second), even where a search passes modes hard to pair."""
        if self.measured is not None:
            return pair_modes(measured_mac(modes, self.matrices, self.measured).T, least=0.0)
        followed = modes.shapes[self.meant] if self._followed is None else self._shapes(self._followed)
        return pair_modes(modal_assurance(followed, modes.shapes, self.matrices.mass), least=0.0)

    def _check(self, modes: Sequence[int] | None) -> None:
        count, size = self.target.size, self.matrices.size
        if count == 0 or self.target.ndim != 1 or not np.all(np.isfinite(self.target)) or self.target.min() <= 0.0:
            raise TuningError(f"target_hz: expected positive frequencies in Hz, not {self.target.tolist()}")
        if not self.parts or len(self.parts) > count:
            raise TuningError(
                f"parts: {len(self.parts)} factors ({', '.join(self.parts) or 'none'}) from {count} frequencies; "
                "name at least one part, and at most as many as frequencies"
            )
        for name, matrix in self.parts.items():
            if matrix.shape != (size, size):
                raise TuningError(f"{name}: shape {matrix.shape}, expected {(size, size)} as the stiffness")
        if self.measured is not None and len(self.measured) != count:
            raise TuningError(f"measured: {len(self.measured)} shapes for {count} target frequencies")
        if modes is not None and (len(set(modes)) != count or len(modes) != count or min(modes) < 0):
            raise TuningError(f"modes: expected {count} different indices from 0, one a target, not {list(modes)}")


def _check_rank(jacobian: np.ndarray, problem: _Problem) -> None:
    if not np.all(np.isfinite(jacobian)):
        raise TuningError("modes: a target belongs to a rigid mode, which no stiffness changes; choose others")
    names = list(problem.parts)
    largest = np.abs(jacobian).max(axis=0)
    if largest.min() < _ALIKE:
        raise TuningError(f"{names[int(largest.argmin())]}: does not change these frequencies; vary another part")
    singular = np.linalg.svd(jacobian / largest, compute_uv=False)
    if singular[-1] < _ALIKE * singular[0]:
        raise TuningError(f"parts: {', '.join(names)} change the frequencies in the same way; vary fewer of them")
