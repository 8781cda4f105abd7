"""Amplitudes of every sector of a ring are those of its motion: closed form, independent integrator, all methods."""

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from tests.reference.integrator import integrate, quadrature
from tests.tools.rings import Chain
from tests.tools.tiers import cases
from vanedamp.coupling.response.by_sector import response_by_sector
from vanedamp.coupling.response.evaluation import Outcome
from vanedamp.coupling.response.event_log import rows_of_line
from vanedamp.coupling.response.records import new_records
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.coupling.system.assembly import assemble
from vanedamp.coupling.system.sectors import unrolled
from vanedamp.files.toml_input import validate
from vanedamp.rom.ring.deviations import Deviations

#: whose highest mode is 9 times as fast as the lowest: impacts excite what samples miss
CHAIN = Chain(sectors=5, damping_ratio=0.01, coupling=2e7)
LOWEST = float(np.sqrt(CHAIN.squares([0])[0]) / (2 * np.pi))
PERIODS, DROPPED = 6, 2


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    return CHAIN.saved(tmp_path_factory.mktemp("ring"))


def scene(file, **changes):
    tables = {
        "structure": {"model": "ring", "file": file},
        "excitation": {"frequency": LOWEST, "force": 40.0, "at": "tip", "wave": 0},
        "cavity": [
            {"name": "c", "gap": 1e-4, "floor": "tip", "sectors": "all", "scatter": {"position": 0.5, "seed": 1}}
        ],
        "damper": [{"cavity": "c", "mass": 0.05, "friction": 0.0, "restitution": 0.6}],
        "time": {"periods": PERIODS, "transient": DROPPED},
    }
    return validate(Scene, tables, "scene").replace({path.replace("__", "."): value for path, value in changes.items()})


#: along their cavities the bodies pull the structure from its place: amplitudes count from there
PULL = {"gravity": {"acceleration": 2000.0, "orientation_deg": 90.0}}


def of_sectors(reference, model, frequency):
    """Displacements (N, ...) of the sectors at times (...), by the rows of the model."""
    rows = np.array([model.row(f"tip@{sector}") for sector in range(CHAIN.sectors)])
    return lambda time: np.tensordot(rows, reference.states(np.minimum(time, reference.time))[0], 1)


def largest(x, times, values):
    """Largest of x(t), of which some values are given: the highest of these, and those next to them, refined."""
    found = [values.max()]
    for place in np.flatnonzero(values[:-1] + values[1:] > 2 * values.max() - 2e-3 * np.abs(values.max())):
        low, high = times[place : place + 2]
        options = {"xatol": 1e-7 * (high - low)}
        found.append(-minimize_scalar(lambda t: -x(t), bounds=(low, high), method="bounded", options=options).fun)
    return max(found)


@pytest.mark.parametrize(
    "changes",
    cases(
        [{}, PULL, {"contact": {"law": "poisson"}}, {**PULL, "contact": {"law": "poisson"}}],
        fast=[PULL, {"contact": {"law": "poisson"}}],
    ),
    ids=["sliders", "sliders pulled", "two phases", "two phases pulled"],
)
def test_amplitudes_of_sectors_are_those_of_an_independent_integrator(file, changes):
    """The integrator's own steps, sampled densely and at impacts, each maximum refined.

    Poisson's law is that of the engine for planar bodies; single impacts without friction are Newton's as well. Chaos
    parts any two ways after some more periods.
    """
    made = scene(file, **changes)
    model = CHAIN.ring().model(None)
    data = unrolled(made).to_dict() | {"structure": {"model": "rom", "file": "none"}, "contact": {"law": "newton"}}
    reference = integrate(validate(Scene, data, "scene"), PERIODS, model)
    assert reference.time * made.frequency == pytest.approx(PERIODS)
    x, hits = of_sectors(reference, model, made.frequency), np.array([event.time for event in reference.events])
    assert len(hits) > 50
    heights = np.empty((CHAIN.sectors, PERIODS - DROPPED, 2))
    for period in range(DROPPED, PERIODS):
        begin, end = np.array([period, period + 1]) / made.frequency
        times = np.union1d(np.linspace(begin, end, 2000), hits[(hits > begin) & (hits < end)])
        for sector, values in enumerate(x(times)):
            heights[sector, period - DROPPED] = [
                largest(lambda t, k=sector, way=way: way * x(np.array([t]))[k, 0], times, way * values)
                for way in (1.0, -1.0)
            ]
    times, weights = quadrature(reference.solution, 2 * np.pi * DROPPED, 2 * np.pi * PERIODS)
    omega = 2 * np.pi * made.frequency
    static = x(times / omega) @ weights / (2 * np.pi * (PERIODS - DROPPED)) if "gravity" in changes else np.zeros(5)
    peak = np.maximum(heights[..., 0] - static[:, None], heights[..., 1] + static[:, None])
    response = simulate(made)
    found = response.sectors
    assert response.energy_residual < 1e-10
    assert found.amplitude_mean == pytest.approx(peak.mean(axis=-1), rel=1e-8)
    assert found.amplitude_max == pytest.approx(peak.max(axis=-1), rel=1e-8)
    assert response.static_deflection == pytest.approx(static[0], rel=1e-8, abs=1e-15)
    if "gravity" in changes:
        assert abs(static).min() > 0.01 * peak.mean()


def test_linear_amplitudes_of_sectors_are_the_closed_form(tmp_path):
    """A mistuned chain under a wave of two orders: N complex equations, and a dense sum of both."""
    chain, deviations = Chain(sectors=5, damping_ratio=0.01), [0.02, -0.03, 0.01, 0.0, -0.02]
    chain.ring().save(tmp_path / "ring.h5")
    frequency = float(np.sqrt(chain.squares([1])[0]) / (2 * np.pi)) / 3
    harmonics = [{"order": 3, "amplitude": 0.1}]
    made = scene(
        str(tmp_path / "ring.h5"), cavity=[], damper=[], structure__mistuning={"stiffness": {"values": deviations}},
        excitation={"frequency": frequency, "force": 40.0, "at": "tip@3", "wave": 3, "harmonic": harmonics},
        time={"periods": 150, "transient": 140},
    )  # fmt: skip
    stiffness, mass = chain.matrices(Deviations(stiffness=tuple(deviations)))
    squares, shapes = np.linalg.eigh(stiffness / chain.mass)
    damping = chain.mass * shapes @ np.diag(2 * chain.damping_ratio * np.sqrt(squares)) @ shapes.T
    angle, sectors = np.linspace(0.0, 2 * np.pi, 200_001), np.arange(5)
    x = np.zeros((5, len(angle)))
    for order, share in ((1, 1.0), (3, 0.1)):
        omega = 2 * np.pi * frequency * order
        force = 40.0 * share * -1j * np.exp(-2j * np.pi * 3 * order * sectors / 5)
        wave = np.linalg.solve(stiffness - omega**2 * mass + 1j * omega * damping, force)
        x += (wave[:, None] * np.exp(1j * order * angle)).real
    expected, response = np.abs(x).max(axis=1), simulate(made)
    assert np.ptp(expected) > 0.1 * expected.max()
    assert response.sectors.amplitude_mean == pytest.approx(expected, rel=2e-9)
    assert response.sectors.amplitude_undamped == pytest.approx(expected, rel=2e-9)
    assert response.amplitude_mean == pytest.approx(expected[3], rel=2e-9)


@pytest.mark.parametrize("pull", [{}, PULL], ids=["level", "pulled"])
@pytest.mark.parametrize("method", ["exact", "moreau", "penalty", "cosim", "solve_ivp"])
def test_each_sector_has_the_amplitude_that_the_response_has_there(file, method, pull):
    steps = {} if method in ("exact", "solve_ivp") else {"steps_per_period": 400}
    made = scene(file, solver={"method": method, **steps}, time={"periods": 4, "transient": 1}, **pull)
    for sector in (0, 3):
        response = simulate(made.replace({"excitation.at": f"tip@{sector}"}))
        found = simulate(made).sectors
        assert found.amplitude_mean[sector] == pytest.approx(response.amplitude_mean_dynamic, rel=1e-12)
        assert found.amplitude_max[sector] == pytest.approx(response.amplitude_max_dynamic, rel=1e-12)
        assert (response.static_deflection != 0.0) == bool(pull)


@pytest.mark.parametrize(("wave", "force", "acceleration", "mass"), [(0, 40.0, 300.0, 0.05), (1, 400.0, 5000.0, 0.01)])
def test_motion_that_grows_at_a_resonance_without_damping_has_its_mean(tmp_path, wave, force, acceleration, mass):
    """Modes that the excitation drives grow while bodies rest at their walls; the mean of the response is that of
    its own antiderivatives."""
    chain = Chain(sectors=5, damping_ratio=1e-9, coupling=2e7)
    chain.ring().save(tmp_path / "ring.h5")
    frequency = float(np.sqrt(chain.squares([wave])[0]) / (2 * np.pi))
    made = scene(
        str(tmp_path / "ring.h5"), damper__0__mass=mass,
        excitation={"frequency": frequency, "force": force, "at": "tip", "wave": wave},
        gravity={"acceleration": acceleration, "orientation_deg": 90.0},
    )  # fmt: skip
    response = simulate(made)
    assert abs(response.static_deflection) > 1e-3 * response.amplitude_mean
    assert response.sectors.amplitude_mean[0] == pytest.approx(response.amplitude_mean_dynamic, rel=1e-12)


@pytest.mark.parametrize("time", [{}, {"steady": "auto", "tolerance": 0.05}, {"steady": "auto", "tolerance": 0.01}])
def test_runs_of_open_length_count_the_periods_that_the_response_counts(file, time):
    response = simulate(scene(file, time=time, damper__0__mass=0.01, **PULL))
    assert response.status is Status.OK and response.transient > 0
    assert response.sectors.amplitude_mean[0] == pytest.approx(response.amplitude_mean_dynamic, rel=1e-10)
    assert response.sectors.amplitude_max[0] == pytest.approx(response.amplitude_max_dynamic, rel=1e-10)


def test_a_run_that_ends_before_it_counts_has_no_sectors(file):
    response = simulate(scene(file, time={"periods": 40, "transient": 30}, solver={"max_events": 100}))
    assert response.status is Status.EVENT_BUDGET and response.sectors is None


def test_a_method_that_notes_no_sectors_has_none(file):
    made = unrolled(scene(file))
    system = assemble(made)
    records = new_records(system, 3, 0, outputs=True)
    assert records.outputs.shape == (4, 5, 3)
    run = Outcome(system, records, 3, 0, 0.0, {}, [], rows_of_line(system))
    assert response_by_sector(made, run, slice(0, 3)) is None
