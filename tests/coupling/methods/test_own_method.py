"""A method from outside: this file is one, found by an entry point. Nothing of ours knows its name.

Leapfrog (Stoermer-Verlet, drift - kick - drift) with springs for contacts, of second order: Hairer, Lubich and Wanner
(2003).
"""

import math
import os
import re
import subprocess
import sys
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from typing import Literal

import numpy as np
import pytest

from benchmarks.methods import charts, figures
from benchmarks.methods.scenes import charted
from benchmarks.rows import Rows
from tests.commands.test_extensions import ROOT, install
from vanedamp.coupling.methods import Variant
from vanedamp.coupling.response import records as recs
from vanedamp.coupling.response.evaluation import Outcome
from vanedamp.coupling.response.event_log import rows_of_line
from vanedamp.coupling.response.recorder import cubic_extremum, record_section
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.response.restart import motion_of
from vanedamp.coupling.scene.contact_laws.compliant import damping_ratio
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.solver_options import SteppingOptions
from vanedamp.coupling.simulation import simulate
from vanedamp.coupling.sweep.sweep import sweep
from vanedamp.coupling.system.line_system import line_system
from vanedamp.files.extensions import ExtensionError
from vanedamp.files.toml_input import InputError, Positive, validate
from vanedamp.studies.jobs.budget import check_run

# -- the method

VARIANTS = (
    Variant("leapfrog", "#000000", "1"),
    Variant("leapfrog, hard walls", "#000000", "2", {"softness": 5.0}),
)


class Options(SteppingOptions):
    """softness: steps that a contact with a rigid wall lasts."""

    method: Literal["leapfrog"] = "leapfrog"
    softness: Positive = 20.0

    @property
    def seconds_per_period(self):
        """In plain Python."""
        return 50e-6 * self.steps_per_period


def begin(scene, system, records, events, start):
    """Return a run. Raises InputError for friction dampers with springs."""
    if np.isfinite(system.casing_spring).any():
        raise InputError("solver.method: leapfrog knows no springs of friction dampers; take another")
    return Leapfrog(system, line_system(system), start, scene.solver, records)


class Leapfrog:
    """A run."""

    def __init__(self, whole, system, start, options, records):
        self.whole, self.rows = whole, rows_of_line(whole)
        self.h, friction = system.period / options.steps_per_period, system.friction_rows
        spring, dashpot, reduced = system.spring.copy(), system.dashpot.copy(), 1 / np.diag(system.delassus)
        for r in np.flatnonzero(np.isinf(spring)):
            if r >= friction:
                spring[r] = reduced[r] * (np.pi / (options.softness * self.h)) ** 2
                dashpot[r] = 2 * damping_ratio(system.restitution[r]) * np.sqrt(spring[r] * reduced[r])
        self.slow = 2 * system.limit[:friction] / reduced[:friction] * self.h
        self.rigid = np.isinf(system.spring[friction:])
        self.system, self.options, self.records = system._replace(spring=spring, dashpot=dashpot), options, records
        size = len(system.mass)
        self.q, self.v = (part[:size] for part in motion_of(whole, start))
        half = 0.5 * self.h * system.damping
        self.back, self.solve = np.diag(system.mass) - half, np.linalg.inv(np.diag(system.mass) + half)
        self.ledger, self.deepest, self.period = np.zeros(len(recs.ENERGIES)), 0.0, 0
        self.pressed = np.zeros(len(system.J) - friction, bool)

    def advance_to(self, periods):
        """Continue to the end of so many periods."""
        steps, every = self.options.steps_per_period, self.records.samples_per_period
        if self.period == 0:
            self.section()
        while self.period < periods:
            for k in range(steps):
                if every and k % (steps // every) == 0:
                    slips = self.system.J[: self.system.bodies] @ self.q
                    self.records.samples[self.period * every + k * every // steps] = [self.response(k)[0], *slips]
                self.step(k)
            if not np.isfinite(self.q).all():
                return Status.DIVERGED
            if self.deepest > self.options.penetration:
                return Status.PENETRATION
            self.period += 1
            self.section()
            if self.records.impacts.sum() >= self.options.max_events:
                return Status.EVENT_BUDGET
        return Status.OK

    def step(self, k):
        """Drift half a step, kick, drift the other half."""
        system, records, h, p, friction = self.system, self.records, self.h, self.period, self.system.friction_rows
        before, q, v = self.response(k), self.q, self.v
        middle = q + 0.5 * h * v
        load = (system.phases(system.omega * (k + 0.5) * h) @ system.load).real
        displacement, speed = system.J @ middle + system.rest, system.J @ v
        gap, closing = displacement[friction:], speed[friction:]
        force = np.zeros(len(displacement))
        held = self.slow > 0
        share = np.clip(speed[:friction][held] / self.slow[held], -1, 1)
        force[:friction][held] = -system.limit[:friction][held] * share
        push = -system.spring[friction:] * gap - system.dashpot[friction:] * closing
        force[friction:] = np.where(gap < 0, np.maximum(push, 0), 0)
        kick = load + system.weight - system.stiffness * middle + system.J.T @ force
        self.v = self.solve @ (self.back @ v + h * kick)
        self.q = middle + 0.5 * h * self.v
        moved, rate = self.q - q, (self.q - q) / h
        rows = system.J @ moved
        self.ledger[recs.EXCITATION] += load @ moved
        self.ledger[recs.VISCOUS] += rate @ system.damping @ moved
        self.ledger[recs.FRICTION] -= force[:friction] @ rows[:friction]
        self.ledger[recs.CONTACT] -= force[friction:] @ rows[friction:] + self.pressing(self.q) - self.pressing(q)
        begun = (force[friction:] > 0) & ~self.pressed & (closing < 0)
        self.pressed = force[friction:] > 0
        records.impacts[p] += np.count_nonzero(begun)
        records.collided[p] += (0.5 * closing**2 / np.diag(system.delassus)[friction:])[begun].sum()
        if self.rigid.any():
            self.deepest = max(self.deepest, (-gap / system.play[friction:])[self.rigid].max())
        (x0, rate0, turn0), (x1, rate1, turn1) = before, self.response(k + 1)
        records.peak[p] = max(records.peak[p], abs(x1), abs(cubic_extremum(h, x0, x1, rate0, rate1)))
        records.square[p] += h * (x0 * x0 + x1 * x1) / 2
        records.harmonic[p] += h * (x0 * turn0 + x1 * turn1) / 2
        bodies = slice(system.modes, None)
        m0, m1 = system.mass[bodies] @ v[bodies], system.mass[bodies] @ self.v[bodies]
        records.momentum[p] += h * (m0 * turn0 + m1 * turn1) / 2

    def response(self, k):
        """Displacement, velocity and exp(-i omega t) at step k."""
        system, turns = self.system, self.system.phases(self.system.omega * k * self.h)
        x = system.response @ self.q + (turns @ system.table).real
        rate = system.response @ self.v + (turns @ (1j * system.frequency * system.table)).real
        return float(x), float(rate), complex(turns[0].conjugate())

    def pressing(self, q):
        """Energy of pressed contacts."""
        contacts = slice(self.system.friction_rows, None)
        gap = (self.system.J @ q + self.system.rest)[contacts]
        return 0.5 * self.system.spring[contacts] @ np.minimum(gap, 0) ** 2

    def section(self):
        """Record the start of a period."""
        record_section(self.whole, self.records, self.period, self.q, self.v, float(self.pressing(self.q)), self.ledger)

    def outcome(self):
        """What the run leaves behind."""
        impacts = int(self.records.impacts.sum())
        figures = {"impacts": impacts}
        return Outcome(self.whole, self.records, self.period, impacts, 0.1, figures, [], self.rows, self.deepest)

    def final(self):
        """None: no run begins with the state of another."""


# -- the tests

#: the error of steps may let elastic contacts make energy
CONVERGING = (Status.OK, Status.ENERGY)
DATA = {
    "structure": {"model": "rigid", "mass": 1.0, "stiffness": (2 * np.pi) ** 2, "damping_ratio": 0.02},
    "excitation": {"frequency": 1.1, "force": 3.0},
    "gravity": {"acceleration": 0.0},
    "cavity": [{"name": "c", "gap": 0.5}],
    "contact": {"law": "compliant", "stiffness": 60.0},
    "damper": [{"cavity": "c", "mass": 0.3, "velocity": 1.0}],
    "time": {"periods": 3, "transient": 0},
}


@pytest.fixture(autouse=True)
def installed(tmp_path, monkeypatch):
    """The method in a package that pip has installed."""
    install(tmp_path / "site", "acme_steps", f"[vanedamp.methods]\nleapfrog = {__name__}\n")
    monkeypatch.syspath_prepend(tmp_path / "site")


def scene(**tables):
    return validate(Scene, DATA | tables, "scene")


def leapfrog(**options):
    return {"method": "leapfrog"} | options


def states(response):
    return np.column_stack([response.section, response.slip, response.slip_velocity])


def test_converges_to_the_exact_engine_with_its_order():
    """Where a contact begins and ends, the force bends: the error there depends on where in a step, hence the means."""
    exact, steps = simulate(scene()), np.array([100, 200, 400])
    assert exact.impacts_per_period > 1

    def error(count):
        response = simulate(scene(solver=leapfrog(steps_per_period=count)))
        assert response.status in CONVERGING and response.counters == {"impacts": exact.counters["impacts"]}
        return (np.abs(states(response) - states(exact))[-1] / np.abs(states(exact)).max(axis=0)).max()

    errors = [np.mean([error(int(count) + 3 * i) for i in range(4)]) for count in steps]
    assert -np.polyfit(np.log(steps), np.log(errors), 1)[0] == pytest.approx(2, abs=0.3)
    assert errors[-1] < 1e-3


RIGID = {"contact": {"law": "newton"}, "damper": [{"cavity": "c", "mass": 0.1, "restitution": 0.7, "friction": 0.05}]}
RUBBING = RIGID | {"gravity": {"acceleration": 9.81}}


def test_runs_like_any_other_method():
    """Rigid walls, friction and samples: to the exact engine with a penalty's order 2/3, and the ledger closes."""
    exact = simulate(scene(**RUBBING), samples_per_period=20)

    def error(steps):
        response = simulate(scene(**RUBBING, solver=leapfrog(steps_per_period=steps)), samples_per_period=20)
        assert response.status is Status.OK and response.energy_residual < 1e-4
        assert response.counters["impacts"] > 4 and response.final is None
        assert response.energy["friction"] == pytest.approx(exact.energy["friction"], rel=0.1)
        return np.abs(response.displacement - exact.displacement).max() / exact.amplitude_max

    assert error(2000) < min(0.05, 0.5 * error(500))


def test_its_option_counts():
    soft, hard = (
        simulate(scene(**RIGID, solver=leapfrog(steps_per_period=400, softness=softness))) for softness in (80.0, 10.0)
    )
    assert soft.penetration > 4 * hard.penetration > 0


def test_goes_through_a_sweep_and_its_workers():
    """Over the method and its steps; workers find the method by its entry point, too."""
    axes = {"solver.method": ["exact", "leapfrog"], "cavity.c.gap": [0.4, 0.6]}
    found = sweep(scene(sweep=axes))
    for row, method in enumerate(axes["solver.method"]):
        for column, gap in enumerate(axes["cavity.c.gap"]):
            single = simulate(scene().replace({"solver.method": method, "cavity.c.gap": gap}))
            assert found.status[row, column] == single.status and single.status in CONVERGING
            assert found.amplitude_mean[row, column] == single.amplitude_mean
    assert found.amplitude_mean[1] == pytest.approx(found.amplitude_mean[0], rel=1e-3)
    refined = scene(solver=leapfrog(), sweep={"solver.steps_per_period": [100, 400], "solver.softness": [10.0]})
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        assert sweep(refined, pool).amplitude_mean.tolist() == sweep(refined).amplitude_mean.tolist()


def test_scene_keeps_what_was_given_and_nothing_else():
    made = scene(solver=leapfrog(softness=20.0))
    assert made.to_dict()["solver"] == {"method": "leapfrog", "max_events": 20_000_000, "softness": 20.0}
    assert made.replace({"solver.softness": None}).to_dict()["solver"] == scene(solver=leapfrog()).to_dict()["solver"]
    assert scene().to_dict()["solver"] == {"method": "exact", "max_events": 20_000_000}
    assert scene(solver={"method": "moreau", "steps_per_period": 1000}).replace(
        {"solver.method": "solve_ivp"}
    ).solver.steps_per_period == 1000  # fmt: skip


@pytest.mark.parametrize(
    ("solver", "message"),
    [
        (leapfrog(theta=0.5), r"scene: solver.theta: is for method moreau, not leapfrog$"),
        ({"method": "moreau", "softness": 5.0}, r"scene: solver.softness: is for method leapfrog, not moreau$"),
        (leapfrog(softnes=5.0), r"scene: solver.softnes: unknown key; did you mean 'softness'\?$"),
        (leapfrog(softness=-1.0), r"scene: solver.softness: should be greater than 0 \(got -1.0\)$"),
        ({"method": "leapfrg"}, r"scene: solver.method: should be 'exact', .* or 'leapfrog' \(got 'leapfrg'\)$"),
        ({"method": ["exact"]}, r"scene: solver.method: should be 'exact', .* or 'leapfrog'$"),
        ("leapfrog", r"scene: solver: expected a table, headed \[solver\]$"),
    ],
)  # fmt: skip
def test_wrong_options_are_refused_in_one_line(solver, message):
    with pytest.raises(InputError, match=message) as refused:
        scene(solver=solver)
    assert "\n" not in str(refused.value)


def test_what_it_cannot_do_is_refused():
    damper = {"normal_force": 1.0, "friction": 0.3, "stiffness": 1e3}
    with pytest.raises(InputError, match="leapfrog knows no springs"):
        simulate(scene(friction_damper=[damper], solver=leapfrog()))
    with pytest.raises(InputError, match="100 is no multiple of 7 samples"):
        simulate(scene(solver=leapfrog(steps_per_period=100)), samples_per_period=7)
    with pytest.raises(InputError, match=r"^continuation: is for solver.method exact, not leapfrog$"):
        simulate(scene(solver=leapfrog()), start=simulate(scene()).final)
    with pytest.raises(InputError, match=r"steps$"):
        # 50 us a step, 1e6 steps a period: 50 s
        check_run(scene(solver=leapfrog(steps_per_period=10**6), time={"periods": 10**6, "transient": 0}))


def test_appears_in_the_chart(tmp_path, monkeypatch):
    """Measured like ours, and drawn: in the legend with its own marks, beside all that did not fail."""
    effort = charts.Settings(1, (100, 200), (1e-4,), 1, 20, 60, 2, 1e5, 200, None, (), longest=math.inf)
    lossy = scene(damper=[DATA["damper"][0] | {"restitution": 0.9}])
    measured = charts.Chart("one body", lambda: lossy, True, effort)
    chart = measured.measure(Rows(tmp_path, "work-precision", {}, measured.rows()), 0)
    ours = {(point["method"], point["setting"]): point for point in chart["points"]}
    assert ours["leapfrog", 200]["status"] == "ok" and ours["leapfrog, hard walls", 100]["time"]["median"] > 0
    assert ours["leapfrog", 200]["error"] < 0.5 * ours["leapfrog", 100]["error"]
    drawn = []
    monkeypatch.setattr(figures, "save", lambda figure, path: drawn.append(figure))
    figures.work_precision_figure({"charts": {"one body": chart}}, tmp_path / "chart.png")
    legend = drawn[0].legends[0]
    labels = [text.get_text() for text in legend.get_texts()]
    assert set(labels) == {point["method"] for point in chart["points"] if point["status"] == "ok"}
    assert labels[0] == "exact engine" and {"leapfrog", "leapfrog, hard walls", "penalty, Newmark"} <= set(labels)
    handles = dict(zip(labels, legend.legend_handles, strict=True))
    assert handles["leapfrog"].get_marker() == "1" and handles["Moreau-Jean"].get_marker() == "o"


def test_a_taken_name_is_refused_and_leaves_ours_alone(tmp_path, monkeypatch):
    install(tmp_path / "twin", "acme_twin", f"[vanedamp.methods]\nmoreau = {__name__}\n")
    monkeypatch.syspath_prepend(tmp_path / "twin")
    assert simulate(scene(solver={"method": "moreau"})).status is Status.OK
    message = f"entry point moreau = {__name__} (vanedamp.methods): there is a method named moreau already"
    with pytest.raises(ExtensionError, match=re.escape(message)):
        charted()


def test_a_method_that_cannot_be_loaded_is_refused_in_one_line(tmp_path, monkeypatch):
    entries = "[vanedamp.methods]\nbroken = acme_broken.part\nempty = acme_broken\n"
    install(tmp_path / "broken", "acme_broken", entries, part__py="import no_such_package")
    monkeypatch.syspath_prepend(tmp_path / "broken")
    with pytest.raises(InputError, match=r"^scene: solver: .*cannot be loaded \(ModuleNotFoundError: .*\)$"):
        scene(solver={"method": "broken"})
    with pytest.raises(InputError, match=r"^scene: solver: .*is no method: lacks Options, begin, VARIANTS$"):
        scene(solver={"method": "empty"})


def test_scenes_load_no_kernels_but_those_of_their_method():
    code = (
        "import sys; from vanedamp.coupling.scene.scene import Scene; from vanedamp.files.toml_input import validate\n"
        f"made = validate(Scene, {DATA!r}, 'scene'); assert 'numba' not in sys.modules\n"
        "from vanedamp.coupling.simulation import simulate; simulate(made)\n"
        "print(*(name for name in sys.modules if name.startswith('vanedamp.coupling.')))"
    )
    shown = subprocess.run([sys.executable, "-c", code], cwd=ROOT, env=os.environ, capture_output=True, check=True)
    loaded = shown.stdout.decode().split()
    methods = {name for name in loaded if name.startswith("vanedamp.coupling.methods.")}
    assert methods == {"vanedamp.coupling.methods." + name for name in ("exact", "registry")}
    assert "vanedamp.coupling.engine.line.automaton" in loaded
    assert not [name for name in loaded if name.startswith("vanedamp.coupling.engine.plane")]
