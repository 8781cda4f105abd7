"""Points that differ in numbers run as one: bit for bit what they are one by one."""

from __future__ import annotations

import dataclasses
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from tests.tools.rings import Chain
from tests.tools.tiers import cases
from vanedamp.coupling.model_order.choices import NOTHING
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.sweep import alike, worker
from vanedamp.coupling.sweep.sweep import sweep
from vanedamp.coupling.sweep.worker import Task, run_points
from vanedamp.files.toml_input import validate

_RIGID = {
    "structure": {"model": "rigid", "mass": 1.0, "stiffness": 1e4, "damping_ratio": 0.01},
    "excitation": {"frequency": 15.9, "force": 2.0},
    "cavity": [{"name": "c", "gap": 6e-3}, {"name": "d", "gap": 8e-3}],
    "damper": [
        {"cavity": "c", "mass": 0.05, "friction": 0.1, "restitution": 0.6},
        {"cavity": "d", "mass": 0.04, "friction": 0.2, "restitution": 0.5},
    ],
    "time": {"periods": 60, "transient": 20},
}
_ONE = _RIGID | {"cavity": _RIGID["cavity"][:1], "damper": _RIGID["damper"][:1]}
_STEEL = {"radius": 5e-2, "young": 2e11, "poisson": 0.3, "yield_strength": 9e8}
_RNG = np.random.default_rng(3)
_POINTS = {
    "frequencies": (_ONE, [{"excitation.frequency": f} for f in np.linspace(14.0, 18.0, 12)]),
    "everything": (
        _RIGID,
        [
            dict(zip(
                ("excitation.frequency", "excitation.force", "cavity.c.gap", "damper.friction", "damper.1.restitution",
                 "damper.0.position", "initial.velocity"), values, strict=True,
            ))
            for values in _RNG.uniform([14, 1, 2e-3, 0, 0, -8e-4, -1], [18, 4, 8e-3, 0.3, 0.9, 8e-4, 1], (25, 7))
        ],
    ),
    "an open length": (_ONE | {"time": {}}, [{"excitation.frequency": f} for f in (15.0, 15.9, 16.4)]),
    "one number slow": (
        _ONE, [{"damper.mass": m, "cavity.c.gap": g} for m in (0.05, 0.2) for g in (1e-3, 4e-3, 1.0)],
    ),
    "compliant": (
        _RIGID | {"contact": {"law": "compliant", "stiffness": 1e5}},
        [{"cavity.gap": g, "excitation.frequency": f} for g in (2e-3, 5e-3) for f in (15.0, 16.0, 17.0)],
    ),
    "Jenkins, stop, harmonics": (
        _RIGID | {
            "friction_damper": [{"normal_force": 2.0, "friction": 0.3, "stiffness": 1e4}],
            "stop": [{"side": "right", "gap": 9e-3, "restitution": 0.4}],
            "excitation": _RIGID["excitation"] | {"harmonic": [{"order": 3, "amplitude": 0.3, "phase": 20.0}]},
        },
        [{"excitation.frequency": f, "damper.friction": m} for f in (15.2, 15.9, 16.3) for m in (0.0, 0.2)],
    ),
    "friction dampers": (
        _RIGID | {
            "friction_damper": [
                {"normal_force": 2.0, "friction": 0.3, "stiffness": 1e4}, {"normal_force": 1.0, "friction": 0.1},
            ],
        },
        [
            {"friction_damper.0.normal_force": n, "friction_damper.friction": m, "excitation.frequency": f}
            for n in (0.5, 2.0, 4.0) for m in (0.0, 0.2, 0.4) for f in (15.2, 16.3)
        ],
    ),
    "a body in flight, a structure that friction holds": (
        _ONE | {
            "damper": [{"cavity": "c", "mass": 0.05, "position": 2e-3}],
            "friction_damper": [{"normal_force": 2.0, "friction": 0.3}],
        },
        [{"excitation.force": f} for f in (0.1, 0.2)],
    ),
    "with and without friction": (_ONE, [{"damper.0.friction": m} for m in (0.0, 0.1, 0.0, 1e-10, 0.3)]),
    "few events": (_ONE | {"solver": {"max_events": 40}}, [{"excitation.frequency": f} for f in (15.0, 15.9, 16.4)]),
    "rows that begin spread": (
        _ONE | {"damper": [{"cavity": "c", "mass": 0.02, "friction": 0.1, "restitution": 0.6}] * 3},
        [{"cavity.c.gap": g, "damper.1.position": x} for g in (2e-3, 4.1e-3, 6e-3) for x in (-7e-4, 0.0, 3e-4)],
    ),
    "until the mean is known": (
        _ONE | {"time": {"periods": 700, "steady": "auto", "tolerance": 0.003}},
        [{"excitation.frequency": f, "cavity.c.gap": g} for f in (15.0, 15.9, 16.4) for g in (1e-3, 3e-3)],
    ),
    "worn": (
        _RIGID | {"wear": {"rate": 1e-13, "impact_rate": 1e-12, "impact_exponent": 1.2, "area": 1e-6}},
        [{"excitation.frequency": f, "damper.friction": m} for f in (15.2, 15.9, 16.3) for m in (0.0, 0.2, 0.3)],
    ),
    "worn, on springs": (
        _RIGID | {"wear": {"rate": 1e-13, "impact_rate": 1e-12},
                  "contact": {"law": "compliant", "stiffness": 1e5}},
        [{"excitation.frequency": f, "cavity.gap": g} for f in (15.2, 16.3) for g in (2e-3, 4e-3)],
    ),
    "rounded contacts": (
        _RIGID | {"contact": {"law": "newton", "pair": _STEEL}},
        [{"excitation.frequency": f, "damper.1.restitution": e} for f in (15.2, 15.9) for e in (0.2, 0.8)],
    ),
    "pulled along": (
        _RIGID | {"gravity": {"orientation_deg": 60.0}}, [{"cavity.c.gap": g} for g in (2e-3, 4e-3, 6e-3)],
    ),
}  # fmt: skip


def _alone(monkeypatch, scene, points, task):
    with monkeypatch.context() as patch:
        patch.setattr(worker, "kind_of", lambda *_: None)
        return run_points(scene, NOTHING, points, task)


@pytest.mark.parametrize(
    ("linked", "kept"),
    cases(ALONG := [(False, {}), (True, {}), (False, {"sections": 50}), (True, {"sections": 50})], fast=ALONG[1:3]),
    ids=["apart", "linked", "apart-sections", "linked-sections"],
)
@pytest.mark.parametrize("name", _POINTS)
def test_points_run_as_one_are_those_run_one_by_one(name, linked, kept, monkeypatch):
    tables, points = _POINTS[name]
    scene, task = validate(Scene, tables | {"sweep": kept}, "scene"), Task(range(len(points)), linked)
    one_by_one, runs = _alone(monkeypatch, scene, points, task), []
    run = worker.simulate
    monkeypatch.setattr(worker, "simulate", lambda *args, **options: runs.append(1) or run(*args, **options))
    found = run_points(scene, NOTHING, points, task)
    np.testing.assert_array_equal(found.values, one_by_one.values)
    assert found.texts == one_by_one.texts
    if not linked:
        assert len(runs) == 0
    assert (found.final is None) == (one_by_one.final is None) == (not linked or name == "few events")
    if found.final is not None:
        assert found.final.to_list() == one_by_one.final.to_list()


def test_points_of_a_ring_are_those_run_one_by_one(tmp_path, monkeypatch):
    chain = Chain(sectors=6, damping_ratio=0.01)
    resonance = float(np.sqrt(chain.squares([2])[0]) / (2 * np.pi))
    tables = {
        "structure": {"model": "ring", "file": chain.saved(tmp_path), "mistuning": {"stiffness": {"std": 0.02}}},
        "excitation": {"frequency": resonance, "force": 25.0, "at": "tip", "wave": 2},
        "cavity": [{"name": "c", "gap": 1e-4, "floor": "tip", "sectors": "all"}],
        "damper": [{"cavity": "c", "mass": 0.01, "friction": 0.2, "restitution": 0.6}],
        "time": {"periods": 60, "transient": 20},
    }
    points = [{"excitation.frequency": f * resonance, "cavity.c.gap": g} for g in (5e-5, 1e-4) for f in (0.98, 1.01)]
    scene, task, runs, run = validate(Scene, tables, "scene"), Task(range(len(points))), [], worker.simulate
    one_by_one = _alone(monkeypatch, scene, points, task)
    monkeypatch.setattr(worker, "simulate", lambda *args, **options: runs.append(1) or run(*args, **options))
    found = run_points(scene, NOTHING, points, task)
    np.testing.assert_array_equal(found.values, one_by_one.values)
    assert found.texts == one_by_one.texts and not runs


def test_files_that_have_changed_are_read_again(tmp_path, monkeypatch):
    """A model, and the deviations of its sectors, under the names that they had."""
    file, deviations = Chain(sectors=6, damping_ratio=0.01).saved(tmp_path), tmp_path / "deviations.csv"
    tables = {
        "structure": {"model": "ring", "file": file, "mistuning": {"stiffness": {"file": str(deviations)}}},
        "excitation": {"frequency": 5.0, "force": 25.0, "at": "tip", "wave": 2},
        "cavity": [{"name": "c", "gap": 1e-4, "floor": "tip", "sectors": "all"}],
        "damper": [{"cavity": "c", "mass": 0.01, "friction": 0.2, "restitution": 0.6}],
        "time": {"periods": 30, "transient": 20},
    }
    points, found = [{"excitation.frequency": f} for f in (5.0, 5.2)], []
    for size, stiffness in ((0.01, 1.0), (0.02, 1.0), (0.02, 1.1)):
        rows = [f"{sector},{size * (-1) ** sector}" for sector in range(6)]
        deviations.write_text("\n".join(["sector,deviation", *rows]), encoding="utf-8")
        chain = Chain(sectors=6, damping_ratio=0.01)
        dataclasses.replace(chain, stiffness=stiffness * chain.stiffness).saved(tmp_path)
        scene = validate(Scene, tables, "scene")
        found.append(run_points(scene, NOTHING, points, Task(range(2))).values)
        np.testing.assert_array_equal(found[-1], _alone(monkeypatch, scene, points, Task(range(2))).values)
    assert not np.array_equal(found[0], found[1]) and not np.array_equal(found[1], found[2])


def test_a_point_beyond_a_wall_is_refused_as_by_itself(monkeypatch):
    scene = validate(Scene, _RIGID | {"sweep": {"sections": 6}}, "scene")
    points = [{"damper.0.position": x} for x in (0.0, 1e-3, 3.1e-3, -2e-3)]
    task = Task(range(4))
    found, one_by_one = run_points(scene, NOTHING, points, task), _alone(monkeypatch, scene, points, task)
    np.testing.assert_array_equal(found.values, one_by_one.values)
    assert found.texts == one_by_one.texts
    assert "position: 0.0031 lies outside" in found.texts[2][0]


def test_runs_after_a_refused_point_are_those_by_themselves(monkeypatch):
    """A place is bounded by a gap: compiled code refuses one point between others, which know nothing of it."""
    scene, calls = validate(Scene, _ONE | {"sweep": {"sections": 6}}, "scene"), []
    pairs = [(6e-3, 9e-4), (4e-3, -5e-4), (2e-3, 2.5e-3), (3e-3, 2e-4), (2e-3, -2e-3), (5e-3, 1e-3)]
    points, task = [{"cavity.c.gap": gap, "damper.0.position": x} for gap, x in pairs], Task(range(6))
    one_by_one, run = _alone(monkeypatch, scene, points, task), worker._run
    monkeypatch.setattr(worker, "_run", lambda *args: calls.append(args[1]) or run(*args))
    found = run_points(scene, NOTHING, points, task)
    np.testing.assert_array_equal(found.values, one_by_one.values)
    assert found.texts == one_by_one.texts
    assert calls == [points[2], points[4]]


def test_a_worker_keeps_the_last_kind(monkeypatch):
    scene, made = validate(Scene, _ONE, "scene"), []
    kind = alike.SceneBatch
    monkeypatch.setattr(alike, "SceneBatch", lambda *given: made.append(1) or kind(*given))
    alike._KEPT.kinds.clear()
    first = run_points(scene, NOTHING, _POINTS["frequencies"][1], Task(range(12)))
    again = run_points(validate(Scene, _ONE, "scene"), NOTHING, _POINTS["frequencies"][1], Task(range(12)))
    assert len(made) == 1
    np.testing.assert_array_equal(first.values, again.values)


def test_values_in_the_way_of_a_column_leave_points_to_themselves(monkeypatch):
    scene = validate(Scene, _ONE, "scene")
    points = [{"gravity.orientation_deg": a, "excitation.force": f} for a in (0.0, 40.0) for f in (1.0, 2.0)]
    found, one_by_one = (
        run_points(scene, NOTHING, points, Task(range(4))),
        _alone(monkeypatch, scene, points, Task(range(4))),
    )
    np.testing.assert_array_equal(found.values, one_by_one.values)
    assert found.texts == one_by_one.texts


def test_a_critically_damped_structure_is_refused_as_by_itself(monkeypatch):
    tables = _ONE | {"structure": _ONE["structure"] | {"damping_ratio": 1.0}}
    scene, points, task = validate(Scene, tables, "scene"), _POINTS["frequencies"][1], Task(range(12))
    found, one_by_one = run_points(scene, NOTHING, points, task), _alone(monkeypatch, scene, points, task)
    assert found.texts == one_by_one.texts
    assert found.texts[0][0].startswith("error: InputError: structure: the mode of 15.9155 Hz is critically damped")


def test_threads_do_not_share_what_they_keep():
    """Many threads sweep the same scene at once: each point is what it is by itself."""
    tables = _ONE | {"sweep": {"excitation.frequency": {"start": 15.0, "stop": 16.5, "num": 200}}}
    scene = validate(Scene, tables, "scene")
    with ThreadPoolExecutor(4) as threads:
        found = sweep(scene, threads)
    alone = sweep(scene)
    assert (found.status == alone.status).all()
    np.testing.assert_array_equal(found.amplitude_mean, alone.amplitude_mean)
