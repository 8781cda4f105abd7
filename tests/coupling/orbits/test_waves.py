"""Travelling waves of a tuned ring: on one sector's account against whole periods and the long run."""

from dataclasses import replace

import numpy as np
import pytest

import vanedamp as vd
from tests.tools.rings import Chain, LumpedDisk
from vanedamp.coupling.orbits.borders import first_point
from vanedamp.coupling.orbits.conditions import Peak
from vanedamp.coupling.orbits.continuation import BranchPath
from vanedamp.coupling.orbits.curve import CurvePoint
from vanedamp.coupling.orbits.newton import find_orbit as newton_orbit
from vanedamp.coupling.orbits.newton import solve
from vanedamp.coupling.orbits.orbits import find_orbit, orbits
from vanedamp.coupling.orbits.period_map import period_map
from vanedamp.coupling.orbits.problem import OrbitProblem
from vanedamp.coupling.orbits.waves import of_waves
from vanedamp.coupling.scene.orbit import Orbit as Table
from vanedamp.files.toml_input import InputError
from vanedamp.rom.in_memory import file_of
from vanedamp.rom.interface import InterfaceCoordinate
from vanedamp.rom.ring.reduction import reduce_ring


def ring(sectors, order, periods=600, detuned=0.0, **orbit):
    """Chains of three masses to the ground, coupled at their feet, with a body at each tip, under an engine order."""
    n, w = 3 * sectors, (2 * np.pi * 500) ** 2 * 0.1
    K = np.zeros((n, n))
    for s in range(sectors):
        foot = 3 * s
        K[foot, foot] += w
        for a, b, k in ((foot, foot + 1, 6 * w), (foot + 1, foot + 2, 6 * w), (foot, (foot + 3) % n, 0.02 * w)):
            K[[a, b], [a, b]] += k
            K[[a, b], [b, a]] -= k
    K[0, 0] += detuned * w
    labels = {f"tip@{s}": 3 * s + 2 for s in range(sectors)}
    model = vd.ReducedModel.from_matrices(
        0.1 * np.eye(n), K, labels, damping_ratio=0.002, directions={label: [1, 0, 0] for label in labels}
    )
    return vd.Scene.of({
        "structure": {"model": "rom", "file": file_of(model)},
        "excitation": {
            "frequency": 1.002 * float(model.natural_frequencies_hz[0]), "at": "tip@0",
            "load": [
                {"at": f"tip@{s}", "force": 3.0, "phase": -360.0 * order * s / sectors} for s in range(sectors)
            ],
        },
        "cavity": [{"name": f"c@{s}", "gap": 2e-4, "floor": f"tip@{s}"} for s in range(sectors)],
        "damper": [{"cavity": f"c@{s}", "mass": 0.002, "friction": 0.2, "restitution": 0.5} for s in range(sectors)],
        "time": {"periods": periods, "transient": periods // 2},
        "orbit": {"wave": True} | orbit,
    }, "scene")  # fmt: skip


def test_the_wave_is_the_long_run_and_the_orbit_of_whole_periods():
    scene = ring(5, 1, periods=1500)
    response = vd.simulate(scene)
    wave = find_orbit(scene, response.final)
    whole = newton_orbit(period_map(scene), wave.map.state_of(response.final))
    assert response.classification == "periodic-1" and wave.status == whole.status == "ok"
    largest = np.abs(whole.state).max()
    assert np.abs(wave.state - whole.state).max() < 1e-10 * largest
    assert np.abs(wave.state - wave.map.state_of(response.final)).max() < 1e-8 * largest
    assert wave.stable and whole.stable and wave.neutral == whole.neutral == 0
    size = np.abs(whole.derivative).max()
    assert np.abs(wave.derivative - whole.derivative).max() < 1e-8 * size
    assert np.allclose(np.abs(wave.multipliers), np.abs(whole.multipliers), rtol=0.0, atol=1e-6)
    assert wave.amplitude_mean == pytest.approx(whole.amplitude_mean, rel=1e-10)
    assert wave.impacts_per_period == whole.impacts_per_period == pytest.approx(response.impacts_per_period)


@pytest.mark.parametrize("sectors, order, times", [(5, 1, 5), (5, 2, 5), (6, 5, 6), (6, 2, 3), (6, 3, 2), (6, -1, 6)])
def test_a_part_of_a_period_with_its_sectors_shifted_commutes_with_the_period(sectors, order, times):
    scene = ring(sectors, order)
    along = period_map(scene)
    wave, symmetry = replace(along, wave=True, earlier=[]), along.travelling
    assert symmetry.times == times and symmetry.part == 1 / times
    # any motion, not only a wave
    state = along.linear_orbit() + 0.1 * along.scale * np.random.default_rng(0).normal(size=len(along.scale))
    one, other = along(wave(state, False).state, False), wave(along(state, False).state, False)
    assert np.abs(one.state - other.state).max() < 1e-9 * np.abs(state).max()
    assert len(wave(state, False).crossings) <= len(along(state, False).crossings) / times + sectors
    part, first = wave(state), np.eye(len(state))[0]
    step = 1e-7 * np.abs(state).max()
    moved = wave(state + step * first, False).state - wave(state - step * first, False).state
    assert np.allclose(
        moved / (2 * step), part.derivative[:, 0], rtol=1e-4, atol=1e-4 * np.abs(part.derivative[:, 0]).max()
    )


@pytest.mark.parametrize("changed", [
    {"cavity.1.gap": 2.1e-4}, {"damper.2.mass": 0.0021}, {"damper.0.restitution": 0.6},
    {"excitation.load.1.phase": -71.0}, {"cavity.1.name": "c1", "damper.1.cavity": "c1"},
])  # fmt: skip
def test_scenes_without_a_wave(changed):
    scene = ring(5, 1).replace(changed)
    with pytest.raises(InputError, match=r"orbit.wave: a wave travels over equal sectors"):
        find_orbit(scene)


def ring_scene(path, sectors, order, periods):
    """A scene that names its cavity and its body once."""
    chain = Chain(sectors=sectors, damping_ratio=0.01)
    chain.ring().save(path)
    return vd.Scene.of({
        "structure": {"model": "ring", "file": str(path)},
        "excitation": {
            "frequency": float(np.sqrt(chain.squares([order])[0]) / (2 * np.pi)), "force": 25.0, "at": "tip",
            "wave": order,
        },
        "cavity": [{"name": "c", "gap": 1e-4, "floor": "tip", "sectors": "all"}],
        "damper": [{"cavity": "c", "mass": 0.01, "friction": 0.2, "restitution": 0.3}],
        "time": {"periods": periods, "transient": periods // 2}, "orbit": {"wave": True},
    }, "scene")  # fmt: skip


def test_a_wave_of_a_ring_scene(tmp_path):
    """The orbit is that of whole periods."""
    scene = ring_scene(tmp_path / "ring.h5", 5, 2, 600)
    final = vd.simulate(scene).final
    wave, whole = find_orbit(scene, final), find_orbit(scene.replace({"orbit.wave": False}), final)
    assert wave.status == whole.status == "ok" and wave.stable and whole.stable
    assert np.abs(wave.state - whole.state).max() < 1e-8 * np.abs(whole.state).max()
    assert wave.impacts_per_period == whole.impacts_per_period


SLIPS = {"between": ["along", "along@+1"], "normal": ["out", "out@+1"], "friction": 0.3, "preload": 2.0,
         "normal_stiffness": 1e6, "sectors": "all"}  # fmt: skip
BLADES = {
    "rigid along": {"joint": [SLIPS]},
    "with springs along": {"joint": [SLIPS | {"tangential_stiffness": 5e5}]},
    "friction dampers": {"friction_damper": [
        {"at": "along", "to": "along@+1", "normal_force": 2.0, "friction": 0.3, "stiffness": 5e5, "sectors": "all"}
    ]},
}  # fmt: skip


@pytest.mark.parametrize("kind", BLADES)
def test_a_wave_of_joints_is_the_long_run_and_the_orbit_of_whole_periods(tmp_path, kind):
    """Between neighbours of a ring; where they stick, it is the linear motion."""
    points = [
        InterfaceCoordinate(name, "tip", axis, "node") for name, axis in (("along", (0, 1, 0)), ("out", (1, 0, 0)))
    ]
    reduce_ring(LumpedDisk(5).sector(), points, 12).save(tmp_path / "ring.h5")
    scene = vd.Scene(
        structure={"model": "ring", "file": str(tmp_path / "ring.h5"), "modes": 20}, **BLADES[kind],
        excitation={"frequency": 440.0, "force": 10.0, "at": "along", "wave": 1},
        time={"periods": 1000, "transient": 900}, orbit={"wave": True, "start": "linear"},
    )  # fmt: skip
    response = vd.simulate(scene)
    wave = find_orbit(scene, response.final)
    whole = newton_orbit(period_map(scene), wave.map.state_of(response.final))
    assert wave.status == whole.status == "ok" and wave.map.travelling.times == 5
    assert wave.amplitude_mean == pytest.approx(response.amplitude_mean, rel=1e-8)
    assert wave.amplitude_mean == pytest.approx(whole.amplitude_mean, rel=1e-10)
    assert response.energy["friction"] > 0.01 * response.energy["excitation"]
    size = np.abs(whole.derivative).max()
    assert np.abs(wave.derivative - whole.derivative).max() < 1e-5 * size
    stuck = find_orbit(scene.replace({"excitation.force": 0.1}))
    assert stuck.status == "ok" and stuck.iterations <= 1 and stuck.passage.sequence == ()


def test_a_wave_whose_opposite_sectors_have_events_at_one_instant(tmp_path):
    """Of an even number of sectors: the long run is the reference; multipliers do not decide stability."""
    scene = ring_scene(tmp_path / "ring.h5", 4, 1, 200)
    response = vd.simulate(scene)
    wave = find_orbit(scene, response.final)
    assert (response.classification, wave.status) == ("periodic-1", "ok")
    assert wave.passage.status == "coincident" and not wave.stable
    reached = wave.map.state_of(response.final)
    assert np.abs(wave.state - reached).max() < 1e-4 * np.abs(reached).max()
    assert wave.amplitude_mean == pytest.approx(response.amplitude_mean, rel=1e-4)
    whole = find_orbit(scene.replace({"orbit.wave": False}), response.final)
    assert (whole.status, whole.passage.status, whole.stable) == ("ok", "coincident", False)
    assert np.abs(wave.state - whole.state).max() < 1e-11 * np.abs(whole.state).max()


def test_mistuned_rings_and_loads_in_phase_have_no_wave():
    assert period_map(ring(5, 1, detuned=1e-6)).travelling is None
    assert period_map(ring(5, 5)).travelling is None
    assert period_map(ring(5, 1)).travelling is not None


def test_a_wave_takes_one_period_and_is_followed_alone():
    with pytest.raises(InputError, match="wave: one takes a period, and is followed alone"):
        ring(5, 1, switch=True)
    branches = orbits(ring(5, 1, periods=1500))
    assert len(branches.branches) == 1 and len(branches.branches[0].parameter) == 1


def test_a_branch_of_waves_is_that_of_the_long_run_and_of_orbits_of_whole_periods(tmp_path):
    scene = ring_scene(tmp_path / "ring.h5", 5, 2, 600)
    table = {"parameter": "excitation.force", "to": 24.0, "step": 0.5, "max_step": 1.0, "max_points": 3}
    (branch,) = orbits(scene.replace({f"orbit.{name}": value for name, value in table.items()})).branches
    assert branch.stable.all() and not branch.undetermined.any() and branch.end == "max_points (3) reached"
    force = float(branch.parameter[-1])
    response = vd.simulate(scene.replace({"excitation.force": force}))
    assert branch.amplitude_mean[-1] == pytest.approx(response.amplitude_mean, rel=1e-7)
    assert branch.impacts_per_period[-1] == response.impacts_per_period
    whole = newton_orbit(period_map(scene, "excitation.force").at(force), branch.state[-1])
    assert np.abs(whole.state - branch.state[-1]).max() < 1e-10 * np.abs(whole.state).max()
    assert np.abs(branch.multipliers[-1]) == pytest.approx(np.abs(whole.multipliers), abs=1e-6)
    # over a section amid a part it comes home: to the next sector
    section, state = of_waves(whole.map).later(whole.state, 0.13)
    home, state = section.later(state, section.length - 0.13)
    assert home.begin == 0.0 and np.abs(state - whole.state).max() < 1e-11 * np.abs(state).max()


@pytest.mark.slow
def test_an_impact_passes_the_start_of_a_part_and_one_of_another_sector_its_end(tmp_path):
    """The branch goes on, to orbits of whole periods."""
    scene = ring_scene(tmp_path / "ring.h5", 5, 2, 600)
    along, begin = period_map(scene, "excitation.force"), 0.0524171
    section, state = of_waves(along).later(find_orbit(scene).state, begin)
    problem, table = OrbitProblem.along(replace(section, earlier=[]), 24.951, -0.005), {"from": 24.951, "to": 24.946}
    found = solve(problem, problem.pack(state, 24.951), problem.row())
    path = BranchPath(
        Table(**table, step=0.3, min_step=0.1, max_step=1.0, max_points=9), CurvePoint(problem, found, problem.row())
    )
    while not path.end:
        path.advance()
    branch = path.branch
    (passes,) = [point for point in branch.special if "at the start of the period" in point.note]
    assert "c@1.right.1, turns 1 left begins, impact c@4.right.4, turns 4 left ceases" in passes.note
    force = float(branch.parameter[-1])
    home = section.at(force).later(branch.state[-1], section.length - begin)[1]
    whole = newton_orbit(along.at(force), home)
    assert force < passes.parameter < 24.951 and np.abs(whole.state - home).max() < 1e-10 * np.abs(home).max()


def test_a_wave_without_contact_is_an_orbit(tmp_path):
    wave = find_orbit(ring_scene(tmp_path / "ring.h5", 5, 2, 50).replace({"excitation.force": 1e-3}))
    assert wave.status == "ok" and wave.passage.sequence == ()


@pytest.mark.slow
def test_a_border_of_waves_is_that_of_orbits_of_whole_periods(tmp_path):
    """A peak over the force: the condition on whole periods of all sectors has the same point."""
    scene = ring_scene(tmp_path / "ring.h5", 3, 1, 800)
    own = scene.excitation.frequency
    low, high = (0.9891289894 - 1e-5) * own, (0.9891289894 + 1.2e-5) * own
    track = {"parameter": "excitation.force", "to": 25.1, "kinds": ["peak"], "max_points": 2}
    table = {"to": high, "step": 0.2, "max_step": 0.5, "min_step": 0.01, "max_points": 20, "track": track}
    tables = {f"orbit.{name}": value for name, value in table.items()}
    scene = scene.replace({"excitation.frequency": low} | tables)
    (border,) = orbits(scene).borders
    assert border.second[0] == 25.0 < border.second[1] and (border.stable_orbits == 1).all()
    whole = period_map(scene, second="excitation.force")
    paths, origin, span = (
        ("excitation.frequency", "excitation.force"),
        np.array([low, 25.0]),
        np.array([high - low, 0.1]),
    )
    problem = OrbitProblem(whole, paths, origin, span)
    y = problem.pack(border.state[1], float(border.parameter[1]), float(border.second[1]))
    found = first_point(Peak(problem, 0, np.eye(problem.size + 1)[-1]), y + 1e-3 * problem.row(-2))
    assert problem.numbers(found.y)[0] == pytest.approx(border.parameter[1], rel=1e-8)
    values = np.linalg.eigvals(problem.derivative(found.passage))
    assert np.abs(border.multipliers[1]) == pytest.approx(np.sort(np.abs(values))[::-1], abs=1e-5)
