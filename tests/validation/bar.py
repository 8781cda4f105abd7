"""An elastic bar against a rigid wall: waves in a reduced model."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from benchmarks.model_order.bar_on_wall import bounce
from tests.tools.closed_form_scenes import scene
from tests.tools.small_structures import rod
from tests.validation.page import Figure, case
from vanedamp.coupling.simulation import simulate
from vanedamp.rom.interface import Interface, InterfaceCoordinate
from vanedamp.rom.reduction import reduce
from vanedamp.rom.truncation import massless

# the engine takes no free structure and no wall but a body: a spring that is soft against the bar's stiffness, 1, and
# a body that is heavy against its mass, 1. They take some 1e-4 from the impulse.
_SPRING, _WALL = 1e-4, 1e4
_HALF_GAP = 50.0
# N/m of a spring between bar and wall, and (1 + s) exp(-s) = 1/2
_BUFFER, _ROOT = 50.0, 1.6783469900166608
MODES = (10, 20, 40, 80)


class Collision(NamedTuple):
    """A contact: its duration and mean force; while the first wave is under way the force's rms deviation, and the
    largest one of its mean over a tenth of the contact."""

    duration: float
    mean: float
    ripple: float
    drift: float


class Bar:
    """A bar of unit length, mass and stiffness, and so speed of sound, in a file of 201 coordinates."""

    def __init__(self, folder: str) -> None:
        matrices = rod(400, root=_SPRING)
        tip = [InterfaceCoordinate("tip", "tip", (1, 0, 0))]
        self.model = reduce(matrices, Interface.on_patches(matrices, tip), modes=200)
        self.file = str(Path(folder) / "bar.h5")
        self.model.save(self.file)

    def meet(self, modes: int, law: dict, expected: Callable[[np.ndarray], np.ndarray]) -> Collision:
        """The wall comes at unit speed to the bar at rest: the same collision, seen from the bar."""
        response = simulate(
            scene(
                structure={"model": "rom", "file": self.file, "modes": modes, "natural": True},
                excitation={"frequency": 0.25, "at": "tip"},
                gravity={"acceleration": 0.0},
                cavity=[{"name": "c", "gap": 2 * _HALF_GAP, "floor": "tip"}],
                damper=[{"cavity": "c", "mass": _WALL, "position": -_HALF_GAP, "velocity": -1.0}],
                contact=law,
                time={"periods": 1, "transient": 0},
            ),
            events=True,
            samples_per_period=8000,
        )
        begin, end = response.event_list
        assert (begin.kind, end.kind) == ("impact", "detach")
        flexibility = massless(self.model, modes).residual_flexibility
        assert flexibility is not None
        yields = flexibility[0, 0] + (1 / law["stiffness"] if "stiffness" in law else 0.0)
        within = (response.time > 0.0) & (response.time < min(end.time, 2.0))
        force = (-_HALF_GAP - response.body_displacement[within, 0]) / yields
        error = force - expected(response.time[within])
        window = np.full(400, 1 / 400)
        drift = np.abs(np.convolve(error, window, "valid")).max()
        ripple = np.sqrt(np.mean(error**2))
        return Collision(end.time, begin.impulse / end.time, float(ripple), float(drift))

    def on_a_wall(self, modes: int) -> Collision:
        """Without anything between: force one."""
        return self.meet(modes, {"law": "massless"}, np.ones_like)

    def on_a_spring(self, modes: int) -> Collision:
        """With a spring between: the bar is a dashpot of one to it until the wave comes back."""
        law = {"law": "compliant", "stiffness": _BUFFER, "residual": True}
        return self.meet(modes, law, lambda time: 1.0 - np.exp(-_BUFFER * time))


@case(
    "elastic bar against a rigid wall",
    "closed form (Saint-Venant): contact 2 L/c, force rho c S v",
    "tests/validation/test_published_contact.py::test_bar_converges",
)
def bar_on_a_wall() -> list[Figure]:
    with tempfile.TemporaryDirectory() as folder:
        bar = Bar(folder)
        found = {modes: bar.on_a_wall(modes) for modes in MODES}
    figures = [Figure(f"contact over L/c, {modes} modes", 2.0, found[modes].duration, 0.06 / modes) for modes in MODES]
    figures += [
        Figure(f"mean force over rho c S v, {modes} modes", 1.0, found[modes].mean, 0.1 / modes) for modes in MODES
    ]
    last = found[MODES[-1]]
    return [
        *figures,
        Figure("force, its mean over any tenth of the contact, 80 modes, worst", 0.0, last.drift, 0.04),
        Figure("force, rms deviation, 80 modes (it rings)", 0.0, last.ripple, 0.6),
    ]


@case(
    "the same with a spring of 50 E S/L between",
    "closed form: force 1 - exp(-50 c t/L) until 2 L/c, contact (2 + s/50) L/c, (1 + s) exp(-s) = 1/2",
    "tests/validation/test_published_contact.py::test_bar_converges",
)
def bar_on_a_spring() -> list[Figure]:
    with tempfile.TemporaryDirectory() as folder:
        bar = Bar(folder)
        found = {modes: bar.on_a_spring(modes) for modes in MODES}
    exact = 2.0 + _ROOT / _BUFFER
    figures = [
        Figure(f"contact over L/c, {modes} modes", exact, found[modes].duration, 0.5 / modes**2) for modes in MODES
    ]
    return figures + [
        Figure(f"force, rms deviation, {modes} modes", 0.0, found[modes].ripple, 20.0 / modes**2) for modes in MODES
    ]


@case(
    "bar that falls on a wall",
    "Doyen, Ern and Piperno (2011): two bounces take 16/3",
    "tests/benchmarks/model_order/test_model_order.py::test_massless_boundary_converges",
)
def falling_bar() -> list[Figure]:
    """Free modes in closed form on the massless boundary."""
    return [
        Figure(f"error of the period, {modes} modes", 0.0, bounce(modes, "massless").time, 0.03 / modes)
        for modes in (20, 60)
    ]
