"""Random sweeps of scenes that run as one, cut into tasks at random, against single runs bit for bit.

`.venv/bin/python -m tests.tools.random_sweeps [FIRST [COUNT]]` runs numbered sweeps and prints those that differ.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple
from unittest import mock

import numpy as np

from tests.tools.scene_strategies import model_file, stressed_file
from vanedamp.coupling.model_order.choices import NOTHING
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.sweep import worker
from vanedamp.coupling.sweep.worker import Task, TaskResult, run_points
from vanedamp.files.toml_input import validate

#: frequencies over that of the scene at which one of its harmonics rounds to another order, and extremes
TRAPS = (0.5, 1.5, 2.5, 2 / 3, 4 / 3, 5 / 6, 7 / 6, 1e-3, 1e3, 1e6, 1e40, 1e-40)


class RandomSweep(NamedTuple):
    """A scene, values of its axes by path and point, and whether the points are linked."""

    scene: Scene
    points: list[dict[str, float]]
    linked: bool


def random_sweep(seed: int) -> RandomSweep:
    """Return a sweep of some 12 points over one to four numbers that have columns."""
    rng = np.random.default_rng([seed, 49])
    tables, linked = _tables(rng), bool(rng.random() < 0.4)
    tables |= _kept(np.random.default_rng([seed, 50]), tables)
    tables |= _in_plane(np.random.default_rng([seed, 51]), tables)
    tables |= _stressed(np.random.default_rng([seed, 52]), tables)
    scene = validate(Scene, tables, f"random sweep {seed}")
    drawn = dict(_axes(rng, scene))
    paths = rng.permutation(list(drawn))[: rng.integers(1, 5)].tolist()
    count = int(rng.integers(6, 16))
    columns = {path: [float(drawn[path]()) for _ in range(count)] for path in paths}
    return RandomSweep(scene, [{path: columns[path][k] for path in paths} for k in range(count)], linked)


def _between(rng: np.random.Generator, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def _tables(rng: np.random.Generator) -> dict[str, Any]:
    """Return tables of a scene in natural units: one or two bodies, elements, harmonics, every structure and law."""
    model, bodies = str(rng.choice(["rigid", "rigid", "rom", "prescribed"])), int(rng.integers(1, 4))
    shared = bodies > 1 and rng.random() < 0.4
    names = ["c0"] * bodies if shared else [f"c{k}" for k in range(bodies)]
    gaps = {name: _between(rng, 0.3, 3.0) for name in names}
    places = np.sort(rng.uniform(-0.4, 0.4, bodies)) if shared else rng.uniform(-0.4, 0.4, bodies)
    tables: dict[str, Any] = {
        "structure": {
            "rigid": {"model": model, "mass": 1.0, "stiffness": 1.0, "damping_ratio": _between(rng, 2e-3, 0.1)},
            "rom": {"model": model, "file": model_file(int(rng.integers(3)), int(rng.integers(2, 5)))},
            "prescribed": {"model": model, "displacement_amplitude": 1.0},
        }[model],
        "excitation": {"frequency": 1 / (2 * np.pi)} | ({} if model == "prescribed" else {"force": 0.05}),
        "gravity": {"acceleration": float(rng.choice([0.0, 0.1]))},
        "cavity": [{"name": name, "gap": gap} for name, gap in gaps.items()],
        "damper": [
            {
                "cavity": name, "mass": _between(rng, 0.01, 0.2), "friction": float(rng.choice([0.0, 0.2])),
                "restitution": rng.uniform(0.2, 0.9), "position": place * gaps[name],
            }
            for name, place in zip(names, places, strict=True)
        ],
        "time": {"periods": 8, "transient": 3} if rng.random() < 0.8 else {},
        "solver": {"max_events": int(rng.choice([40, 2000]))},
    }  # fmt: skip
    if model == "rom":
        tables["excitation"]["at"] = "one"
        for cavity in tables["cavity"]:
            cavity |= {"floor": "one"}
    if model != "prescribed" and rng.random() < 0.5:
        orders = rng.permutation([2, 3, 5])[: rng.integers(1, 3)].tolist()
        tables["excitation"]["harmonic"] = [{"order": k, "amplitude": 0.4, "phase": 30.0} for k in orders]
    if model == "rigid" and rng.random() < 0.3:
        tables["friction_damper"] = [{"normal_force": 0.1, "friction": 0.3}]
        if rng.random() < 0.5:
            tables["friction_damper"][0]["stiffness"] = 0.5
    if rng.random() < 0.3:
        tables["contact"] = {"law": "compliant", "stiffness": 100.0}
    return tables


def _kept(rng: np.random.Generator, tables: dict[str, Any]) -> dict[str, Any]:
    """Return tables, in half of the sweeps, of what is kept of a run, and of how it ends."""
    found: dict[str, Any] = {}
    if rng.random() < 0.15:
        found["wear"] = {"rate": 1e-3, "impact_rate": 1e-3, "impact_exponent": rng.choice([1.0, 1.3]), "area": 1.0}
    if rng.random() < 0.15 and "contact" not in tables:
        pair = {"radius": 1.0, "young": 1e4, "poisson": 0.3, "yield_strength": 100.0}
        found["contact"] = {"law": "newton", "pair": pair}
    if rng.random() < 0.15:
        tolerance = float(rng.choice([1e-3, 0.05, 0.3]))
        found["time"] = {"periods": int(rng.choice([90, 250])), "steady": "auto", "tolerance": tolerance}
    if rng.random() < 0.15:
        found["sweep"] = {"sections": int(rng.integers(1, 12))}
    return found


def _in_plane(rng: np.random.Generator, tables: dict[str, Any]) -> dict[str, Any]:
    """Return tables, in a third of the sweeps, that let bodies move in the plane: blocks, discs, two-phase impacts."""
    if rng.random() > 0.35:
        return {}
    laws = [{"law": "poisson"}, {"law": "newton"}, {"law": "compliant", "stiffness": 100.0}]
    names = [cavity["name"] for cavity in tables["cavity"]]
    kinds = dict(zip(names, rng.choice(["slider", "block", "disc"], len(names), p=[0.3, 0.5, 0.2]), strict=True))
    bodies = []
    for body in tables["damper"]:
        kind = kinds[body["cavity"]]
        shape = {
            "slider": {}, "block": {"shape": "block", "length": rng.uniform(0.5, 2.0), "height": rng.uniform(0.3, 1.5)},
            "disc": {"shape": "disc", "radius": rng.uniform(0.2, 1.0)},
        }[str(kind)]  # fmt: skip
        bodies.append(body | shape)
    plays = [cavity | {"play": _between(rng, 0.01, 0.3)} for cavity in tables["cavity"]]
    gravity = {"acceleration": float(rng.choice([0.02, 0.1]))}
    law = tables.get("contact", {}) if "pair" in tables.get("contact", {}) else laws[rng.integers(3)]
    return {"damper": bodies, "cavity": plays, "gravity": gravity, "contact": law}


def _stressed(rng: np.random.Generator, tables: dict[str, Any]) -> dict[str, Any]:
    """Return tables, in most sweeps of reduced models, with hot spots."""
    if tables["structure"]["model"] != "rom" or rng.random() < 0.3:
        return {}
    return {"structure": tables["structure"] | {"file": stressed_file(tables["structure"]["file"])}}


def _axes(rng: np.random.Generator, scene: Scene) -> Iterator[tuple[str, Any]]:
    """Yield paths and what draws their values."""
    frequency, gap = scene.frequency, scene.cavity[0].gap
    yield "damper.0.friction", lambda: rng.choice([0.0, 0.1, 0.3])
    yield "damper.restitution", lambda: rng.uniform(0.0, 1.0)
    yield "damper.0.velocity", lambda: rng.uniform(-1.0, 1.0)
    yield "damper.0.position", lambda: rng.uniform(-0.6, 0.6) * gap  # some beyond the wall
    yield "cavity.gap", lambda: gap * _between(rng, 0.1, 10.0)
    yield "damper.0.mass", lambda: rng.choice([0.03, 0.1])
    if scene.structure.model == "rigid":
        yield "initial.velocity", lambda: rng.uniform(-1.0, 1.0)
        yield "structure.stiffness", lambda: scene.structure.stiffness * rng.uniform(0.8, 1.2)
    if scene.friction_damper:
        yield "friction_damper.0.normal_force", lambda: _between(rng, 0.01, 1.0)
        yield "friction_damper.friction", lambda: rng.choice([0.0, 0.3])
    if scene.structure.model != "prescribed":
        yield "excitation.force", lambda: _between(rng, 1e-4, 10.0)

        def near() -> float:
            return frequency * (float(rng.choice(TRAPS)) if rng.random() < 0.3 else _between(rng, 0.5, 2.0))

        yield "excitation.frequency", near


def run_cut(drawn: RandomSweep, cuts: Sequence[Sequence[int]]) -> TaskResult:
    """Run the points in tasks of these places, one after the other; linked ones go on from each other."""
    first = run_points(drawn.scene, NOTHING, [], Task([]))
    values, texts, final = (
        np.full((len(drawn.points), first.values.shape[1]), np.nan),
        [("", "")] * len(drawn.points),
        None,
    )
    for places in cuts:
        task = Task(places, drawn.linked, final)
        found = run_points(drawn.scene, NOTHING, [drawn.points[place] for place in places], task)
        values[list(places)], final = found.values, found.final
        for place, text in zip(places, found.texts, strict=True):
            texts[place] = text
    return TaskResult(values, texts, final)


def random_cuts(rng: np.random.Generator, drawn: RandomSweep) -> list[list[int]]:
    """Cut the points into tasks at random, in any order where they are not linked."""
    places = np.arange(len(drawn.points)) if drawn.linked else rng.permutation(len(drawn.points))
    at = np.sort(rng.choice(np.arange(1, len(places)), rng.integers(0, min(5, len(places) - 1)), replace=False))
    return [part.tolist() for part in np.split(places, at)]


def one_by_one(drawn: RandomSweep) -> TaskResult:
    """Run each point by itself."""
    with mock.patch.object(worker, "kind_of", lambda *_: None):
        return run_cut(drawn, [range(len(drawn.points))])


def same(one: TaskResult, other: TaskResult) -> bool:
    """Whether two results are the same bit for bit."""
    finals = [found.final and found.final.to_list() for found in (one, other)]
    return (
        one.texts == other.texts and np.array_equal(one.values, other.values, equal_nan=True) and finals[0] == finals[1]
    )


def differing(seed: int) -> list[list[list[int]]]:
    """Return the cuts in which a random sweep is not what its points are one by one: of whole, two others, whole."""
    drawn, rng = random_sweep(seed), np.random.default_rng([seed, 1])
    alone, whole = one_by_one(drawn), [list(range(len(drawn.points)))]
    cuts = [whole, random_cuts(rng, drawn), random_cuts(rng, drawn), whole]
    return [each for each in cuts if not same(alone, run_cut(drawn, each))]


if __name__ == "__main__":
    first, count = (int(word) for word in (sys.argv[1:] + ["0", "100"][len(sys.argv) - 1 :])[:2])
    found = {seed: bad for seed in range(first, first + count) if (bad := differing(seed))}
    for seed, bad in found.items():
        print(seed, *bad, sep="\n   ")
    print(f"{count} sweeps, {len(found)} differ")
