"""Time stepping of planar bodies: converges to the exact engine, with both solvers of its contacts."""

from typing import Literal

import numpy as np
import pytest
from pydantic.dataclasses import dataclass

from tests.tools.planar import planar_scene, run_planar, still_table, witness
from vanedamp.coupling.response.evaluation import residual
from vanedamp.coupling.response.records import EXCITATION, FRICTION, IMPACT_LOSS, STORED, VISCOUS
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.scene.registration import register
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.waveform import Waveform
from vanedamp.files.toml_input import STRICT, InputError, validate

BLOCK = {"shape": "block", "length": 0.02, "height": 0.01, "mass": 1.3}
#: scene, and what multiplies the step in the bound of the error in place, m/s: 4 times the speeds that end a flight
#: within a step; the sliding disc has no impacts, and only its end of slip within a step
FIRST_ORDER = {
    "rocks": (still_table(20.0), [BLOCK | {"friction": 0.45, "tilt": 1e-4, "restitution": 0.0, "height": 0.04}], 0.02),
    "thrown": (
        still_table(50.0),
        [BLOCK | {"friction": 0.3, "restitution": 0.6, "lift": 3e-4, "velocity": 0.3, "tilt": 2e-4, "tilt_rate": 0.02}],
        1.2,
    ),
    "rolls": (
        still_table(5.0), [{"shape": "disc", "radius": 0.01, "mass": 0.7, "friction": 0.2, "velocity": 0.3}], 3e-4
    ),
    "face to face": (
        still_table(50.0),
        [
            BLOCK | {"friction": 0.3, "restitution": 0.5, "position": -4e-4, "velocity": 0.2, "tilt": 1e-4},
            BLOCK | {"friction": 0.3, "restitution": 0.5, "position": 1e-4, "velocity": -0.1, "lift": 2e-4},
        ],
        1.2,
    ),
}  # fmt: skip


def imbalance(run, periods):
    return residual(run.records.ledger[: periods + 1], run.records.parts[: periods + 1])


@pytest.mark.parametrize("name", FIRST_ORDER)
def test_first_order_to_the_exact_engine(name):
    table, bodies, slope = FIRST_ORDER[name]
    scene = planar_scene(table, *bodies, gap=10.0 if name == "rolls" else 2e-3, play=1e-3)
    exact = run_planar(scene, 1)
    assert exact.status is Status.OK
    reach = np.abs(exact.system.J).max(axis=0)  # by which a coordinate moves a contact
    for steps in (4000, 16000):
        run, status = witness(scene, 1, steps)
        assert status is Status.OK
        error = np.abs((run.motion.q - exact.state.q) * reach).max()
        assert error <= slope / table["excitation"]["frequency"] / steps
        assert imbalance(run, 1) <= 1e-9  # theta = 1/2: midpoint rules leave out nothing
        lost, expected = (ended.records.ledger[1, [FRICTION, IMPACT_LOSS]].sum() for ended in (run, exact))
        assert lost == pytest.approx(expected, rel=1e-2)


def vane(shape, periods, body=None, **excitation):
    """Figure 9, reference/2, at f/f1 = 1.005, with a slider or with a block."""
    unit, mass, stiffness = 7e-5, 0.15696, 3.6046e7
    omega = float(np.sqrt(stiffness / mass))
    block = {"shape": "block", "length": 6.88e-3, "height": 4.8e-3} if shape == "block" else {}
    damper = {"cavity": "c", "mass": 0.02 * mass, "friction": 0.4, "restitution": 0.7}
    data = {
        "structure": {"model": "rigid", "mass": mass, "stiffness": stiffness, "damping_ratio": 0.002},
        "excitation": {"frequency": 1.005 * omega / (2 * np.pi), "resonance_amplitude": unit} | excitation,
        "cavity": [{"name": "c", "gap": 0.5 * unit} | ({"play": 2e-4} if block else {})],
        "damper": [damper | block | (body or {})],
        "initial": {"velocity": 0.5 * unit * omega}, "time": {"periods": periods, "transient": 0},
    }  # fmt: skip
    return validate(Scene, data, "scene"), unit


def test_the_steady_amplitude_of_a_block_is_that_of_the_exact_engine():
    """An independent program finds 0.103, the exact engine 0.104. Chaos: means of 700 periods scatter by 2 %.

    The block begins off the floor: steps take two corners that hit within one as one face, and keep a block flat on
    the floor that has come to lie there.
    """
    scene, unit = vane("block", 1200, {"lift": 8e-5, "tilt": 2e-3})
    run, status = witness(scene, 1200, 400)
    assert status is Status.OK
    mean = run.records.peak[500:1200].mean() / unit
    assert mean == pytest.approx(0.1045, rel=0.05)
    assert mean == pytest.approx(run_planar(scene, 1200).records.peak[500:1200].mean() / unit, rel=0.05)
    outcome = run.outcome()
    assert 0.0 < outcome.penetration < 0.05
    assert outcome.counters["steps"] == 1200 * 400
    assert imbalance(run, 1200) <= 1e-9


@register
@dataclass(frozen=True, config=STRICT)
class Halves(Waveform):
    """1 in the first half of the period, -1 in the second, 0 where it jumps."""

    shape: Literal["halves"] = "halves"

    def values(self, angle):
        return np.sign(np.round(np.sin(angle), 9))


@pytest.mark.parametrize(
    "excitation", [{}, {"harmonic": [{"order": 2, "amplitude": 0.5}]}, {"waveform": {"shape": "halves"}}]
)
def test_both_solvers_move_a_slider_alike(excitation):
    """In a step with an impact, wall and floor act along one line: they share the force between them differently."""
    scene, _ = vane("slider", 20, **excitation)
    (one, status), (other, same) = (
        witness(scene, 20, 400, samples=4, contacts=contacts) for contacts in ("exact", "gauss_seidel")
    )
    assert status is same is Status.OK
    records, others = one.records, other.records
    assert records.impacts.sum() > 20
    for name in ("peak", "section", "samples", "harmonic", "momentum", "square", "parts", "impacts", "collided"):
        mine, theirs = getattr(records, name), getattr(others, name)
        np.testing.assert_allclose(mine, theirs, rtol=1e-9, atol=1e-9 * np.abs(theirs).max())
    mine, theirs = (
        np.column_stack([ledger[:, [EXCITATION, VISCOUS, STORED]], ledger[:, [FRICTION, IMPACT_LOSS]].sum(axis=1)])
        for ledger in (records.ledger, others.ledger)
    )
    np.testing.assert_allclose(mine, theirs, rtol=1e-9, atol=1e-9 * np.abs(theirs).max())
    mine, theirs = (np.concatenate(run.chunks) for run in (one, other))
    assert len(mine) == len(theirs) > 0


@pytest.mark.parametrize("law", ["newton", "poisson", "compliant"])
def test_both_solvers_move_blocks_alike(law):
    """Pivots and iteration share no line. Corners that share friction in several ways part a few runs."""
    contact = {"law": law} | ({"stiffness": 1e5} if law == "compliant" else {})
    agreed, rubbing, impacts = 0, 0, 0
    for seed in range(20):
        scene = random_scene(seed)
        given = {f"damper.{k}.restitution": max(body.restitution, 0.1) for k, body in enumerate(scene.damper)}
        scene = scene.replace(given).replace({"contact": contact})
        (one, status), (other, same) = (
            witness(scene, 1, 2000, samples=40, contacts=contacts) for contacts in ("exact", "gauss_seidel")
        )
        assert status is same is Status.OK
        if np.abs(one.records.samples - other.records.samples).max() <= 1e-9 * 1e-3:
            agreed += 1
            rubbing += scene.damper[0].friction > 0.0
            impacts += one.records.impacts.sum()
    assert agreed >= 16
    assert rubbing >= 10
    assert impacts > 100


def random_scene(seed):
    """One or two blocks or discs in a small cavity, on a table or on an oscillator."""
    draw = np.random.default_rng(seed)
    frequency = 20.0
    if draw.random() < 0.3:
        data = still_table(frequency, amplitude=10 ** draw.uniform(-5, -3.3))
    else:
        stiffness = (2 * np.pi * frequency) ** 2 * draw.uniform(0.7, 1.4)
        data = {
            "structure": {"model": "rigid", "mass": 1.0, "stiffness": stiffness, "damping_ratio": 0.01},
            "excitation": {"frequency": frequency, "resonance_amplitude": 5e-4},
            "initial": {"velocity": draw.uniform(-0.05, 0.05)},
        }  # fmt: skip
    number, disc = int(draw.integers(1, 3)), draw.random() < 0.35
    shared = {"friction": max(draw.uniform(-0.1, 0.6), 0.0), "restitution": max(draw.uniform(-0.15, 0.9), 0.0)}
    bodies = []
    for place in range(number):
        size = {"shape": "disc", "radius": 0.005}
        if not disc:
            size = {"shape": "block", "length": draw.uniform(0.005, 0.015), "height": draw.uniform(0.005, 0.01)}
            size["tilt"] = draw.uniform(-2e-3, 2e-3)
        bodies.append(
            size | shared | {
                "mass": draw.uniform(0.02, 0.2), "velocity": draw.uniform(-0.05, 0.05),
                "position": (6e-4 * place - 3e-4) * draw.uniform(0.5, 1.0),
                "lift": max(draw.uniform(-2e-5, 8e-5), 0.0), "lift_velocity": draw.uniform(-0.02, 0.02),
                "tilt_rate": draw.uniform(-0.5, 0.5),
            }
        )  # fmt: skip
    return planar_scene(data, *bodies, gap=1e-3, play=3e-4)


def test_random_scenes_move_as_in_the_exact_engine():
    """In half a period, with some 40 impacts or up to 500; a few scenes multiply an error by a hundred in that time."""
    samples, steps, errors = 100, 16000, []
    for seed in range(30):
        scene = random_scene(seed)
        exact = run_planar(scene, 1, samples=samples)
        run, status = witness(scene, 1, steps, samples)
        assert status is exact.status is Status.OK
        parts = np.abs(run.records.samples - exact.records.samples)[: samples // 2] / 1e-3
        errors.append(parts.max())
        assert imbalance(run, 1) <= 1e-9
    step = 0.1 / (20.0 * steps) / 1e-3  # way at 0.1 m/s, as a share of the gap
    assert np.quantile(errors, 0.5) <= step
    assert np.quantile(errors, 0.8) <= 10 * step


def test_gives_up_on_overlap():
    fast = {"shape": "disc", "radius": 0.01, "mass": 1.0, "velocity": 1.0, "restitution": 0.0}
    run, status = witness(planar_scene(still_table(1.0), fast, gap=0.1), 1, 8)
    assert status is Status.PENETRATION
    assert run.outcome().penetration > 0.1


def test_friction_up_to_the_paradox():
    """A sliding block on its leading corner has one motion below mu = (4 a^2 + b^2)/(3 a b); beyond, it is refused."""
    a, b = 0.01, 0.02
    critical = (4 * a * a + b * b) / (3 * a * b)
    rod = {
        "shape": "block", "length": 2 * a, "height": 2 * b, "mass": 1.0, "friction": 0.8 * critical,
        "velocity": 1.0, "restitution": 0.0, "tilt": -1e-4,
    }  # fmt: skip
    scene = planar_scene(still_table(10.0), rod, gap=100.0, play=10.0)
    exact, (run, status) = run_planar(scene, 1), witness(scene, 1, 1000)
    assert status is Status.OK and exact.status is Status.OK
    np.testing.assert_allclose(run.motion.q, exact.state.q, rtol=1e-3)
    with pytest.raises(InputError, match=f"below {critical:.4g}"):
        run_planar(scene.replace({"damper.0.friction": 1.001 * critical}), 1)
