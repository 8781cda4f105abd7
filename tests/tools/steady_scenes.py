"""Random scenes whose steady state is hard to tell, run as a user would, and against runs 20 times as long.

    .venv/bin/python -m tests.tools.steady_scenes [FIRST [SCENES]]

Each seed is a scene of one of six kinds, in turn, with the default [time]. Its reference is a run 20 times as long, of
which the second half is evaluated. A scene that ends as `ok` is covered where

    |mean - reference| <= sqrt(confidence^2 + reference's confidence^2) + FLOOR mean.

Printed are each scene as it is done and, for each kind, scenes, those said to be ok, those covered, the largest
relative error of the ok ones, the periods of the longest run, and the time of the judgement relative to that of the
runs.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from vanedamp.coupling.response import evaluation
from vanedamp.coupling.response.response import Response
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.files.toml_input import validate
from vanedamp.rom.reduced import ReducedModel

#: lowest natural frequency of the structures, Hz, and their static displacement by the force, m
OWN, STATIC = 100.0, 1e-5
#: share of the mean within which two means are one
FLOOR = 1e-3
#: how many times as long the reference is
LONGER = 20
STIFFNESS = (2 * np.pi * OWN) ** 2


def sliders(draw: np.random.Generator, folder: Path) -> dict[str, Any]:
    """One to three sliders on a structure of ordinary damping."""
    scene = _structure(draw, zeta=_log(draw, 1e-3, 1e-2), detuning=0.03)
    count = int(draw.integers(1, 4))
    return _with_bodies(scene, draw, [_slider(draw) for _ in range(count)])


def blocks(draw: np.random.Generator, folder: Path) -> dict[str, Any]:
    """A block that may tilt."""
    scene = _structure(draw, zeta=_log(draw, 1e-3, 1e-2), detuning=0.03)
    body = _slider(draw) | {"shape": "block", "length": 4e-3, "height": 2e-3}
    body["tilt"] = float(draw.choice([0.0, 1e-5]))
    scene = _with_bodies(scene, draw, [body])
    scene["cavity"][0]["play"] = 2e-5
    return scene | {"gravity": {"orientation_deg": float(draw.choice([0.0, 90.0]))}}


def absorbers(draw: np.random.Generator, folder: Path) -> dict[str, Any]:
    """A body on a spring, hardly damped or well, near the frequency of the structure or of the excitation."""
    scene = _structure(draw, zeta=_log(draw, 5e-4, 5e-3), detuning=0.03)
    own = 2 * np.pi * (scene["excitation"]["frequency"] if draw.random() < 0.5 else OWN * draw.uniform(0.95, 1.05))
    body = _slider(draw) | {"friction": 0.0}
    body |= {"stiffness": body["mass"] * own**2, "dashpot": 2 * body["mass"] * own * _log(draw, 1e-5, 3e-2)}
    return _with_bodies(scene, draw, [body], reach=100.0)


def tracks(draw: np.random.Generator, folder: Path) -> dict[str, Any]:
    """A ball that rolls in a trough and is tuned to an engine order (docs/examples/self_tuning.toml)."""
    return {
        "structure": {
            "model": "rigid", "mass": 0.1, "stiffness": 6e5, "damping_ratio": _log(draw, 1e-3, 1e-2),
            "centrifugal_stiffness": 0.15,
        },
        "rotation": {"rpm": draw.uniform(5400.0, 6800.0)},
        "excitation": {"engine_order": 4, "force": _log(draw, 0.3, 3.0)},
        "cavity": [{"name": "c", "gap": _log(draw, 1e-4, 1e-3), "play": 1e-4, "radius": 0.42}],
        "damper": [
            {
                "cavity": "c", "shape": "disc", "radius": 0.004, "mass": 2e-3, "inertia": 1.28e-8,
                "friction": draw.uniform(0.1, 0.5), "restitution": draw.uniform(0.5, 0.9),
                "track_radius": 0.0179487 * draw.uniform(0.95, 1.05),
            }
        ],
    }  # fmt: skip


def light(draw: np.random.Generator, folder: Path) -> dict[str, Any]:
    """One or two sliders on a structure with next to no damping."""
    scene = _structure(draw, zeta=_log(draw, 1e-5, 5e-4), detuning=3e-3)
    bodies = [_slider(draw, _log(draw, 2e-4, 2e-2)) for _ in range(int(draw.integers(1, 3)))]
    return _with_bodies(scene, draw, bodies, reach=60.0)


def coupled(draw: np.random.Generator, folder: Path) -> dict[str, Any]:
    """Two or three close modes whose damping couples them, with or without a body."""
    count = int(draw.integers(2, 4))
    own = 2 * np.pi * OWN * (1 + np.r_[0.0, np.sort(draw.uniform(1e-3, 2e-2, count - 1))])
    share = draw.uniform(0.5, 1.0, count)
    damping = 2 * own[0] * _log(draw, 2e-4, 5e-3) * (np.outer(share, share) + np.eye(count) * _log(draw, 1e-4, 1e-2))
    rows = {"tip": draw.uniform(0.5, 1.0, count), "floor": draw.uniform(0.3, 1.0, count)}
    model = ReducedModel.from_matrices(np.eye(count), np.diag(own**2), rows, damping=damping)
    file = folder / f"coupled_{draw.integers(2**40)}.h5"
    model.save(file)
    frequency = OWN * (1 + draw.uniform(-5e-3, 2.5e-2))
    scene = {
        "structure": {"model": "rom", "file": str(file)},
        "excitation": {"frequency": frequency, "force": STIFFNESS * STATIC, "at": "tip"},
        "contact": {"law": "compliant", "stiffness": 1e3 * STIFFNESS},
    }
    if draw.random() < 0.5:
        return scene
    scene = _with_bodies(scene, draw, [_slider(draw)])
    scene["cavity"][0]["floor"] = "floor"
    return scene


KINDS: tuple[Callable[[np.random.Generator, Path], dict[str, Any]], ...] = (
    sliders, blocks, absorbers, tracks, light, coupled,
)  # fmt: skip


def scene_of(seed: int, folder: Path) -> Scene:
    """Return the scene of a seed; folder: for the files that it names."""
    kind = KINDS[seed % len(KINDS)]
    return validate(Scene, kind(np.random.default_rng(seed), folder), f"seed {seed}")


def _structure(draw: np.random.Generator, zeta: float, detuning: float) -> dict[str, Any]:
    frequency = OWN * (1 + draw.uniform(-detuning, detuning))
    return {
        "structure": {"model": "rigid", "mass": 1.0, "stiffness": STIFFNESS, "damping_ratio": zeta},
        "excitation": {"frequency": frequency, "force": STIFFNESS * STATIC},
    }


def _slider(draw: np.random.Generator, mass: float | None = None) -> dict[str, Any]:
    mass = _log(draw, 2e-3, 5e-2) if mass is None else mass
    friction = 0.0 if draw.random() < 0.3 else draw.uniform(0.05, 0.4)
    return {"cavity": "c", "mass": mass, "friction": friction, "restitution": draw.uniform(0.5, 0.9)}


def _with_bodies(
    scene: dict[str, Any], draw: np.random.Generator, bodies: list[dict[str, Any]], reach: float = 30.0
) -> dict[str, Any]:
    """Return the scene with bodies in one cavity, whose gap is up to some `reach` static displacements."""
    return scene | {"cavity": [{"name": "c", "gap": STATIC * _log(draw, reach, 20 * reach)}], "damper": bodies}


def _log(draw: np.random.Generator, low: float, high: float) -> float:
    return float(np.exp(draw.uniform(np.log(low), np.log(high))))


class Outcome(NamedTuple):
    """A scene's run and its reference, with the time of both and of the judgement of the first, s."""

    run: Response
    reference: Response
    seconds: float
    judged: float

    @property
    def error(self) -> float:
        """Error of the mean, relative to the reference's."""
        return abs(self.run.amplitude_mean - self.reference.amplitude_mean) / max(self.reference.amplitude_mean, 1e-300)

    @property
    def covered(self) -> bool:
        """Whether the confidence of the mean covers the reference, which has one of its own."""
        widths = [response.amplitude_mean_confidence or 0.0 for response in (self.run, self.reference)]
        allowed = np.hypot(*widths) + FLOOR * self.run.amplitude_mean
        return bool(abs(self.run.amplitude_mean - self.reference.amplitude_mean) <= allowed)


def outcome_of(seed: int) -> Outcome:
    """Run the scene of a seed and, if it ends as ok, its reference."""
    with tempfile.TemporaryDirectory() as folder:
        scene = scene_of(seed, Path(folder))
        began = time.perf_counter()
        with _clock() as judged:
            run = simulate(scene)
        seconds = time.perf_counter() - began
        if run.status != "ok":
            return Outcome(run, run, seconds, judged[0])
        periods = LONGER * run.periods
        longer = {"time": {"periods": periods, "transient": periods // 2}, "solver": {"max_events": 10**9}}
        return Outcome(run, simulate(validate(Scene, scene.to_dict() | longer, "x")), seconds, judged[0])


@contextmanager
def _clock() -> Any:
    """Give the time, s, that the judgement of runs takes from here on."""
    spent, own = [0.0], (evaluation.judge, evaluation.Transient)

    def clocked(part: Callable[..., Any]) -> Callable[..., Any]:
        def call(*arguments: Any) -> Any:
            began = time.perf_counter()
            try:
                return part(*arguments)
            finally:
                spent[0] += time.perf_counter() - began

        return call

    evaluation.judge, evaluation.Transient = (clocked(part) for part in own)
    try:
        yield spent
    finally:
        evaluation.judge, evaluation.Transient = own


def main(first: int = 0, scenes: int = 300) -> None:
    """Print a line for each scene as it is done, then the table."""
    found: dict[str, list[Outcome]] = {kind.__name__: [] for kind in KINDS}
    for seed in range(first, first + scenes):
        kind, outcome = KINDS[seed % len(KINDS)].__name__, outcome_of(seed)
        found[kind].append(outcome)
        run, told = outcome.run, "" if outcome.covered else "NOT COVERED, "
        print(
            f"{seed} {kind}: {run.status}, {run.amplitude_mean:.5g} +- {run.amplitude_mean_confidence or 0:.2g} m, "
            f"reference {outcome.reference.amplitude_mean:.5g}, {told}{run.periods} periods "
            f"in {outcome.seconds:.3g} s, judged in {outcome.judged:.2g} s", flush=True,
        )  # fmt: skip
    print("| kind | scenes | ok | covered | largest error of ok | longest run | judgement |")
    print("|---|---|---|---|---|---|---|")
    for kind, outcomes in [*found.items(), ("all", [outcome for several in found.values() for outcome in several])]:
        ok = [outcome for outcome in outcomes if outcome.run.status == "ok"]
        if not outcomes:
            continue
        print(
            f"| {kind} | {len(outcomes)} | {len(ok)} | {sum(outcome.covered for outcome in ok)} | "
            f"{max((outcome.error for outcome in ok), default=0.0):.3f} | "
            f"{max(outcome.run.periods for outcome in outcomes)} | "
            f"{sum(outcome.judged for outcome in outcomes) / sum(outcome.seconds for outcome in outcomes):.1%} |"
        )


if __name__ == "__main__":
    main(*(int(argument) for argument in sys.argv[1:]))
