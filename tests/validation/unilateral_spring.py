"""Two masses and a unilateral spring, example 03 of NLvib: periodic orbits of the engine's period map by shooting."""

from __future__ import annotations

import tempfile
from functools import lru_cache
from pathlib import Path

import numpy as np
from scipy.optimize import minimize_scalar, root

from tests.tools.closed_form_scenes import scene
from tests.validation.page import Figure, case
from vanedamp.coupling.orbits.period_map import PeriodMap, period_map
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.simulation import simulate
from vanedamp.coupling.system.assembly import assemble
from vanedamp.rom.reduced import ReducedModel

STIFFNESS = np.array([[1.0, -1.0], [-1.0, 2.0]])
DAMPING = 0.03 * STIFFNESS
FORCE, SPRING, GAP = 0.1, 100.0, 1.0
# the ground is a heavy body: it yields by some 1e-8 of the motion, and round-off of the flow grows with its mass
_GROUND, _HALF_GAP = 1e8, 10.0


class Chain:
    """ground ~ mass 2 - mass 1 | gap, spring ~ ground: NLvib's chain; states are (x1, x2, x1', x2')."""

    def __init__(self, folder: str) -> None:
        self.file = str(Path(folder) / "chain.h5")
        labels = {"first": [1.0, 0.0], "second": [0.0, 1.0]}
        ReducedModel.from_matrices(np.eye(2), STIFFNESS, labels, damping=DAMPING).save(self.file)
        self._at = lru_cache(4)(self._map)

    def _map(self, omega: float) -> tuple[PeriodMap, np.ndarray]:
        """The map over a period of the force FORCE sin(omega t) on the second mass, rows of x1 and x2 in the modes."""
        data = scene(
            structure={"model": "rom", "file": self.file},
            excitation={"frequency": omega / (2 * np.pi), "force": FORCE, "at": "second"},
            gravity={"acceleration": 0.0},
            cavity=[{"name": "c", "gap": 2 * _HALF_GAP, "floor": "first"}],
            damper=[{"cavity": "c", "mass": _GROUND, "position": GAP - _HALF_GAP}],
            contact={"law": "compliant", "stiffness": SPRING},
            time={"periods": 1, "transient": 0},
        )
        system = assemble(data)
        return period_map(data), np.array([system.floor[0, :2], system.of_structure.response])

    def start(self, omega: float, state: np.ndarray) -> RestartState:
        """The state of the engine's run, with the ground where it belongs."""
        modal = np.linalg.solve(self._at(omega)[1], state.reshape(2, 2).T)
        slip, speed = np.array([GAP - _HALF_GAP - state[0]]), np.array([-state[2]])
        return RestartState(modal[:, 0], modal[:, 1], slip, speed, np.zeros(0), np.full(2, 2 * _HALF_GAP))

    def run(self, omega: float, state: np.ndarray) -> np.ndarray:
        """The state a period later, by the engine."""
        walked, rows = self._at(omega)
        passage = walked(walked.state_of(self.start(omega, state)), derivative=False)
        assert passage.status == "ok"
        final = walked.restart_of(passage.state)
        return np.concatenate([rows @ final.displacement, rows @ final.velocity])

    def orbit(self, omega: float, guess: np.ndarray) -> np.ndarray:
        """The state at the start of a periodic orbit near a guess."""
        found = root(lambda state: self.run(omega, state) - state, guess, tol=1e-12)
        assert np.abs(found.fun).max() < 1e-9
        return found.x

    def follow(self, omegas: np.ndarray, guess: np.ndarray) -> np.ndarray:
        """The orbit at the last of these frequencies, each found from the one before."""
        for omega in omegas:
            guess = self.orbit(omega, guess)
        return guess

    def settled(self, omega: float, periods: int = 200) -> np.ndarray:
        """The state after some periods from rest."""
        state = np.zeros(4)
        for _ in range(periods):
            state = self.run(omega, state)
        return state

    def multipliers(self, omega: float, state: np.ndarray, step: float = 1e-5) -> np.ndarray:
        """Floquet multipliers: eigenvalues of the period map's Jacobian, by central differences."""
        pairs = [(self.run(omega, state + step * e), self.run(omega, state - step * e)) for e in np.eye(4)]
        return np.linalg.eigvals(np.array([(up - down) / (2 * step) for up, down in pairs]).T)

    def motion(self, omega: float, state: np.ndarray, samples: int) -> np.ndarray:
        """(samples, 2) displacements of both masses over a period."""
        response = simulate(self._at(omega)[0].scene, samples_per_period=samples, start=self.start(omega, state))
        assert response.status == "ok"
        first = GAP - _HALF_GAP - response.body_displacement[:samples, 0]
        return np.column_stack([first, response.displacement[:samples]])


def a_rms(coefficients: np.ndarray) -> float:
    """NLvib's a_rms from cosine and sine coefficients, the mean among them: the root of half the sum of squares."""
    return float(np.sqrt(0.5 * np.sum(coefficients**2)))


def sampled_rms(chain: Chain, omega: float, state: np.ndarray, samples: int = 4096) -> float:
    """a_rms of the first mass's motion: the mean's square counts half."""
    first = chain.motion(omega, state, samples)[:, 0]
    return float(np.sqrt(0.5 * first.mean() ** 2 + first.var()))


def harmonic_balance(omega: float, harmonics: int, motion: np.ndarray) -> float:
    """a_rms of the first mass by harmonic balance with alternating frequency and time, from a motion (samples, 2)."""
    samples = len(motion)
    angles = 2 * np.pi * np.arange(samples) / samples
    waves = [np.ones(samples)]
    for order in range(1, harmonics + 1):
        waves += [np.cos(order * angles), np.sin(order * angles)]
    basis = np.array(waves)
    analysis = basis * np.r_[1.0, np.full(2 * harmonics, 2.0)][:, None] / samples
    linear = np.zeros((2 * len(basis), 2 * len(basis)))
    linear[:2, :2] = STIFFNESS
    for order in range(1, harmonics + 1):
        at = slice(4 * order - 2, 4 * order + 2)
        elastic, viscous = STIFFNESS - (order * omega) ** 2 * np.eye(2), order * omega * DAMPING
        linear[at, at] = np.block([[elastic, viscous], [-viscous, elastic]])
    load = np.zeros(len(linear))
    load[5] = FORCE
    unknowns = (analysis @ motion).ravel()
    for _ in range(50):
        overlap = basis.T @ unknowns[::2] - GAP
        residual, jacobian = linear @ unknowns - load, linear.copy()
        residual[::2] += analysis @ (SPRING * np.maximum(overlap, 0.0))
        jacobian[::2, ::2] += analysis @ (SPRING * (overlap > 0.0)[:, None] * basis.T)
        change = np.linalg.solve(jacobian, residual)
        unknowns = unknowns - change
        if np.abs(change).max() < 1e-12:
            return a_rms(unknowns[::2])
    raise AssertionError("harmonic balance has not converged")


@case(
    "two masses and a unilateral spring",
    "NLvib, example 03 (Krack and Gross 2019), 21 harmonics; peak of its script as the port NLvib-py reports it",
    "tests/validation/test_published_contact.py::test_orbit_of_nlvib_is_left_where_it_is_unstable",
)
def unilateral_spring() -> list[Figure]:
    """The peak is published of the harmonic balance; the example tells which of its orbits are unstable."""
    with tempfile.TemporaryDirectory() as folder:
        chain = Chain(folder)
        stable = chain.orbit(0.635, chain.settled(0.635))
        low = chain.follow(np.linspace(0.635, 0.6, 8), stable)
        state = chain.follow(np.linspace(0.635, 0.7541, 15), stable)
        found = minimize_scalar(
            lambda omega: -sampled_rms(chain, omega, chain.orbit(omega, state)),
            bounds=(0.7530, 0.7550), method="bounded", options={"xatol": 1e-6},
        )  # fmt: skip
        motion, here = chain.motion(0.7541, state, 8192), sampled_rms(chain, 0.7541, state)
        critical = chain.multipliers(found.x, chain.orbit(found.x, state))
        return [
            Figure("peak a_rms of the first mass", "0.98093", -found.fun, 2e-3),
            Figure("its frequency, rad/s", "0.7541", found.x, 5e-4),
            Figure("a_rms at 0.7541 rad/s, harmonic balance here", "0.98093",
                   harmonic_balance(0.7541, 21, motion[::8]), 1e-3),
            Figure("a_rms at 0.7541 rad/s, against 161 harmonics", harmonic_balance(0.7541, 161, motion), here, 2e-6),
            Figure("multiplier at the peak (\"beyond period doubling\")", "< -1", float(critical.real.min())),
            Figure("largest multiplier at 0.635 rad/s (\"stable\")", "< 1",
                   float(np.abs(chain.multipliers(0.635, stable)).max())),
            Figure("largest multiplier at 0.6 rad/s (\"beyond Neimark-Sacker\")", "> 1",
                   float(np.abs(chain.multipliers(0.6, low)).max())),
        ]  # fmt: skip
