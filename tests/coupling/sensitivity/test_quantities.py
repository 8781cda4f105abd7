"""Every quantity that has derivatives: values are those of responses, derivatives those of differences of runs."""

import math

import numpy as np
import pytest

import vanedamp as vd
from tests.coupling.sensitivity.test_figures import TABLES
from tests.tools.differences import quantities_of
from tests.tools.rings import Chain
from vanedamp.coupling.quantities.quantity import evaluated, table
from vanedamp.coupling.scene.paths import number_at
from vanedamp.coupling.sensitivity.sensitivity_record import NOT_IN_DERIVATIVES
from vanedamp.coupling.tangents.dual import Dual

SHORT = TABLES | {"time": {"periods": 5, "transient": 2}, "initial": {"displacement": 0.1}}
WEAR = {"wear": {"rate": 2e-13, "impact_rate": 3e-9, "impact_exponent": 1.3, "area": 1e-4}}
PAIR = {"young": 2e11, "radius": 0.02, "yield_strength": 4e8}
SPHERE = {"contact": {"law": "newton", "pair": PAIR}}
LINE = {"contact": {"law": "newton", "pair": PAIR | {"radius": 0.05, "width": 0.01, "depth": 0.02}}}
#: a block that rocks, on a floor that it leaves
BLOCK = SHORT | {
    "cavity": [{"name": "c", "gap": 0.5, "play": 0.3}], "gravity": {"acceleration": 0.04},
    "time": {"periods": 2, "transient": 0},
    "damper": [{"cavity": "c", "shape": "block", "mass": 0.08, "restitution": 0.3, "friction": 0.2, "length": 0.4,
                "height": 0.5, "lift": 0.1, "tilt": 0.05, "tilt_rate": 0.04}],
}  # fmt: skip
#: a body that a pull along its cavity presses to a wall, and with it the structure from its place
PULLED = SHORT | {"gravity": {"acceleration": 3.0, "orientation_deg": 60.0}}


def ring(folder):
    chain = Chain(sectors=5, damping_ratio=0.01, coupling=2e7)
    frequency = float(np.sqrt(chain.squares([0])[0]) / (2 * np.pi))
    return {
        "structure": {"model": "ring", "file": chain.saved(folder)},
        "excitation": {"frequency": frequency, "force": 40.0, "at": "tip", "wave": 0},
        "cavity": [
            {"name": "c", "gap": 1e-4, "floor": "tip", "sectors": "all", "scatter": {"position": 0.5, "seed": 1}}
        ],
        "gravity": {"acceleration": 2000.0, "orientation_deg": 90.0},
        "damper": [{"cavity": "c", "mass": 0.05, "friction": 0.0, "restitution": 0.6}],
        "time": {"periods": 3, "transient": 1},
    }  # fmt: skip


CASES = {
    "wear": (SHORT | WEAR, ["damper.0.friction", "damper.0.mass", "wear.impact_exponent", "wear.area", "wear.rate"],
             ["wear_work_rate", "wear_volume_rate", "wear_depth_rate", "energy_share.friction", "impacts_per_period"]),
    "sphere": (SHORT | SPHERE, ["damper.0.mass", "cavity.c.gap", "contact.pair.young", "contact.pair.radius",
                                "contact.pair.yield_strength"],
               ["contact_force", "contact_pressure", "contact_utilisation", "impact_speed_max"]),
    "line": (SHORT | LINE, ["damper.0.restitution", "contact.pair.width", "contact.pair.young"],
             ["contact_force", "contact_pressure", "contact_utilisation"]),
    "deflected": (PULLED | WEAR, ["gravity.acceleration", "structure.stiffness", "damper.0.restitution"],
                  ["static_deflection", "amplitude_max_dynamic", "amplitude_mean_dynamic"]),
    "block": (BLOCK | WEAR, ["cavity.c.play", "damper.0.length", "excitation.force", "damper.0.tilt_rate"],
              ["tilt_max.0", "lift_share.0", "wall_impacts.0", "wear_work_rate"]),
    "ring": (ring, ["damper.0.mass", "cavity.c.gap"],
             ["sector_amplitude_mean.3", "sector_amplitude_max.0", "amplification", "localisation"]),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_derivatives_are_those_of_whole_runs(case, tmp_path):
    tables, paths, names = CASES[case]
    scene = vd.Scene.of(tables(tmp_path) if callable(tables) else tables, "scene")
    found = vd.sensitivity(scene, paths)
    assert found.status == "ok", found.note
    known = quantities_of(vd.simulate(scene))
    assert set(names) <= set(found.values)
    for name, value in found.values.items():
        if name in known:
            assert value == pytest.approx(known[name], rel=1e-9, abs=1e-12), name
    for j, path in enumerate(paths):
        value = number_at(scene.to_dict(), path)
        step = 2e-4 * abs(value)
        one, two, three = (
            [quantities_of(vd.simulate(scene.replace({path: value + way * k * step}))) for way in (1, -1)]
            for k in (1, 2, 3)
        )
        for name in found.values.keys() & known.keys():
            weights = zip((one, two, three), (45, -9, 1), strict=True)
            slope = sum(weight * (each[0][name] - each[1][name]) for each, weight in weights) / (60 * step)
            size = max(abs(slope), abs(known[name] / value), 1e-7 if name.startswith("lift") else 0.0)
            assert found.derivatives[name][j] == pytest.approx(slope, rel=1e-6, abs=2e-7 * size), (name, path)


def test_every_source_has_derivatives_or_a_reason(tmp_path):
    """What a quantity needs is given by some motion, or there is said why not."""
    given = set()
    for case in ("wear", "sphere", "block", "ring"):
        tables, paths, _ = CASES[case]
        scene = vd.Scene.of(tables(tmp_path) if callable(tables) else tables, "scene")
        values = vd.sensitivity(scene, paths[:1]).values
        given |= {need for name in values if (one := table().get(name.split(".")[0])) for need in one.needs}
    needed = {need for one in table().values() for need in one.needs}
    assert needed - given == set(NOT_IN_DERIVATIVES)
    assert all(NOT_IN_DERIVATIVES.values())


def test_where_bodies_begin_to_deflect_distances_have_no_derivative():
    """Level, nothing presses a slider along its cavity: peaks count from zero; at any tilt from the mean position."""
    found = vd.sensitivity(vd.Scene.of(SHORT, "scene"), ["gravity.orientation_deg", "damper.0.mass"])
    assert found.status == "ok" and "gravity.orientation_deg: bodies begin to deflect" in found.note
    for name in ("static_deflection", "amplitude_max_dynamic", "amplitude_mean_dynamic"):
        assert np.isnan(found.derivatives[name]).tolist() == [True, False], name
    assert np.isfinite(found.derivatives["amplitude_max"]).all()


def test_compliant_contacts_tell_no_hertzian_force():
    """Their largest force follows from how long they last."""
    tables = SHORT | {"contact": {"law": "compliant", "stiffness": 300.0, "pair": PAIR}}
    found = vd.sensitivity(vd.Scene.of(tables, "scene"), ["damper.0.mass"])
    assert found.status == "ok" and "amplitude_mean" in found.values
    assert not any(name.startswith("contact_") for name in found.values)


FORMULAS = {
    "add": lambda a, b: a + 2.0 + b, "subtract": lambda a, b: 3.0 - a - b, "multiply": lambda a, b: 2.0 * a * b,
    "divide": lambda a, b: 1.0 / a + a / b / 2, "power": lambda a, b: a**b + a**2,
    "negative": lambda a, b: -a * abs(-b),
    "root": lambda a, b: np.sqrt(np.maximum(a * b, 0.0)), "hypot": lambda a, b: np.hypot(a, -b),
    "angle": lambda a, b: np.arctan2(0.0 - a, b),
    "complex": lambda a, b: ((a + 1j * b) * np.conjugate(a * 1j - b)).real,
    "imaginary": lambda a, b: (np.float64(2.0) * (a + 1j * b) * (a + 1j * b)).imag,
    "stack": lambda a, b: (np.stack([a, b], axis=-1) / np.where(a > 0.0, a, np.nan)[None]).sum(),
    "largest": lambda a, b: max([a, b]) + sum([a, b]) + np.stack([a, b], axis=-1).max(),
    "mean": lambda a, b: (np.stack([a, b], axis=-1) ** 2).mean(),
}  # fmt: skip


@pytest.mark.parametrize("name", FORMULAS)
def test_plain_numpy_works_on_numbers_with_derivatives(name):
    """f(a + h u, b + h v) by central differences."""
    formula, (a, b), turns = FORMULAS[name], np.array([1.3, 0.7]), np.array([[0.5, -1.0], [2.0, 0.3]])
    found = formula(Dual(a, turns[0]), Dual(b, turns[1]))
    step = 1e-6
    for j in range(2):
        ahead, back = (formula(*(np.float64(x) for x in (a, b) + way * step * turns[:, j])) for way in (1, -1))
        assert found.turns[j] == pytest.approx((ahead - back) / (2 * step), rel=1e-8)
    assert found.value == pytest.approx(formula(np.float64(a), np.float64(b)), rel=1e-14)


def test_the_tables_formulas_run_on_numbers_with_derivatives():
    """Of sums that a number changes by their own values each: a power of it."""
    one = lambda value: Dual(value, [value])  # noqa: E731
    sums = {"square": one(6.0), "counted": 2, "period": one(0.5), "harmonic": one(0.2 - 0.1j)}
    found = evaluated(sums)
    assert math.isclose(found["amplitude_rms"].value, math.sqrt(6.0)) and found["amplitude_rms"].turns[0] == 0.0
    assert found["amplitude_harmonic"].turns[0] == pytest.approx(0.0, abs=1e-15)
