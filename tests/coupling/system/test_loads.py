"""Forces at several interface labels, with phases: a list, or a measured pattern, against closed forms."""

import cmath
import math
import os
from dataclasses import replace

import numpy as np
import pytest

from vanedamp.coupling.model_order.selection import select_model_order
from vanedamp.coupling.orbits.orbits import find_orbit
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.coupling.sweep.sweep import sweep
from vanedamp.coupling.system.linear_response import linear_responses
from vanedamp.coupling.system.resonance import chosen_resonance
from vanedamp.files.toml_input import InputError, validate
from vanedamp.rom.reduced import ReducedModel
from vanedamp.studies.optimisation.study import Study

BLADES, OWN, COUPLING, RATIO = 4, 2 * math.pi * 100.0, 0.3, 0.02
LABELS = [f"tip{k}" for k in range(BLADES)]
FREQUENCY = 104.0


def ring(tmp_path, mistuning=0.0):
    """Blades of 1 kg in a ring, each tied to its neighbours. Returns the structure's table and the model.

    mistuning: of the second blade, those of the others grow with the square of their number.
    """
    tie = COUPLING * OWN**2
    stiffness = np.diag(OWN**2 * (1 + mistuning * np.arange(BLADES) ** 2) + 2 * tie)
    for k in range(BLADES):
        stiffness[k, (k + 1) % BLADES] -= tie
        stiffness[k, (k - 1) % BLADES] -= tie
    rows = dict(zip(LABELS, np.eye(BLADES), strict=True))
    directions = {label: [0.0, 1.0, 0.0] for label in LABELS}
    model = ReducedModel.from_matrices(
        np.eye(BLADES), stiffness, rows, damping_ratio=RATIO, directions=directions, base_load=np.ones((BLADES, 3))
    )
    model.save(tmp_path / "ring.h5")
    return {"model": "rom", "file": str(tmp_path / "ring.h5")}, model


def travelling(diameters, force=2.0, order=1):
    """A wave that excites `diameters` nodal diameters: each blade that much later than the one before."""
    turn = 360.0 * diameters / BLADES
    return [{"at": label, "force": force, "phase": -k * turn, "order": order} for k, label in enumerate(LABELS)]


def scene(structure, load, periods=3, transient=0, excitation=None, **tables):
    data = {
        "structure": structure,
        "excitation": {"frequency": FREQUENCY, "at": "tip0", "load": load} | (excitation or {}),
        "gravity": {"acceleration": 0.0},
        "time": {"periods": periods, "transient": transient},
    } | tables
    if load is None:
        del data["excitation"]["load"]
    return validate(Scene, data, "scene")


def waves(model, loads, at="tip0"):
    """Complex amplitudes of the response by order, relative to a sine: the sum of receptances and forces."""
    found = {}
    for load in loads:
        order = load.get("order", 1)
        amplitude = cmath.rect(load["force"], math.radians(load.get("phase", 0.0)))
        wave = complex(model.frf([order * FREQUENCY], at, load["at"])[0]) * amplitude
        found[order] = found.get(order, 0.0) + wave
    return found


UNEVEN = [
    {"at": "tip0", "force": 2.0, "phase": 30.0}, {"at": "tip2", "force": 1.5, "phase": -100.0},
    {"at": "tip1", "force": 4.0, "phase": 70.0, "order": 3}, {"at": "tip0", "force": 1.0, "order": 3},
]  # fmt: skip
PATTERN = "at,order,force,phase_deg\n" + "".join(
    f"{load['at']},{load.get('order', 1)},{load['force']},{load.get('phase', 0.0)}\n" for load in UNEVEN
)
BODY = {
    "cavity": [{"name": "c", "gap": 5e-6, "floor": "tip1"}],
    "damper": [{"cavity": "c", "mass": 0.05, "restitution": 0.6, "friction": 0.1, "normal_load": 0.5}],
}


# -- without bodies: closed forms


def test_steady_response_is_the_sum_over_points_and_orders(tmp_path):
    structure, model = ring(tmp_path)
    response = simulate(scene(structure, UNEVEN, periods=420, transient=410))
    expected = waves(model, UNEVEN)
    assert response.status is Status.OK
    assert response.amplitude_harmonic == pytest.approx(abs(expected[1]), rel=1e-9)
    assert response.phase == pytest.approx(cmath.phase(expected[1]), abs=1e-9)
    rms = math.sqrt(sum(abs(wave) ** 2 for wave in expected.values()) / 2)
    assert response.amplitude_rms == pytest.approx(rms, rel=1e-9)
    assert response.energy_residual < 1e-10
    undamped, fixed = (
        curve.amplitude(np.array([FREQUENCY]))[0] for curve in linear_responses(scene(structure, UNEVEN))
    )
    assert undamped == pytest.approx(response.amplitude_max, rel=1e-9)
    assert fixed == pytest.approx(undamped, rel=1e-12)


@pytest.mark.parametrize("diameters", [0, 1, 2])
def test_a_travelling_wave_excites_its_nodal_diameters_only(tmp_path, diameters):
    """Of a tuned ring: every blade is an oscillator with omega_n^2 = omega^2 (1 + 2 c (1 - cos(2 pi n/N)))."""
    structure, _ = ring(tmp_path)
    squared = OWN**2 * (1 + 2 * COUPLING * (1 - math.cos(2 * math.pi * diameters / BLADES)))
    omega = 2 * math.pi * FREQUENCY
    receptance = 1 / (squared - omega**2 + 2j * RATIO * math.sqrt(squared) * omega)
    for k in (0, 1):
        curve, _ = linear_responses(scene(structure, travelling(diameters)).replace({"excitation.at": LABELS[k]}))
        assert curve.amplitude(np.array([FREQUENCY]))[0] == pytest.approx(2.0 * abs(receptance), rel=1e-9)
    late = simulate(scene(structure, travelling(diameters), 420, 410).replace({"excitation.at": "tip1"}))
    turned = cmath.phase(receptance * cmath.exp(-2j * math.pi * diameters / BLADES))
    assert cmath.exp(1j * late.phase) == pytest.approx(cmath.exp(1j * turned), abs=1e-8)


def test_a_pattern_in_a_file_is_the_list(tmp_path):
    """Its file lies beside the scene's; load_factor scales either."""
    structure, _ = ring(tmp_path)
    (tmp_path / "deep").mkdir()
    (tmp_path / "deep" / "pattern.csv").write_text(PATTERN)
    lines = [
        "[structure]", 'model = "rom"', 'file = "../ring.h5"', "[excitation]", f"frequency = {FREQUENCY}",
        'at = "tip0"', 'pattern = "pattern.csv"', "load_factor = 0.5", "[gravity]", "acceleration = 0.0",
        "[time]", "periods = 3", "transient = 0",
    ]  # fmt: skip
    (tmp_path / "deep" / "scene.toml").write_text("\n".join(lines))
    case = Scene.load(tmp_path / "deep" / "scene.toml")
    assert case.moved and str(tmp_path / "deep" / "pattern.csv") in case.files
    half = [load | {"force": load["force"] / 2} for load in UNEVEN]
    listed = simulate(scene(structure, half))
    assert np.abs(simulate(case).section - listed.section).max() <= 1e-12 * np.abs(listed.section).max()


def test_a_pattern_is_read_again_when_a_copy_has_its_time(tmp_path):
    """Copies and archives keep the time of a file."""
    structure, _ = ring(tmp_path)
    file = tmp_path / "pattern.csv"
    excitation = {"frequency": FREQUENCY, "at": "tip0", "pattern": str(file)}
    case = validate(Scene, {"structure": structure, "excitation": excitation}, "scene")
    forces = []
    for force in (1, 2):
        file.write_text(f"at,order,force,phase_deg\ntip0,1,{force},0\n")
        os.utime(file, (1e9, 1e9))
        forces.append(linear_responses(case)[0].amplitude(np.array([FREQUENCY]))[0])
    assert forces[1] == pytest.approx(2 * forces[0], rel=1e-12)


def test_one_load_at_the_response_is_the_force(tmp_path):
    structure, _ = ring(tmp_path)
    one = simulate(scene(structure, [{"at": "tip0", "force": 2.0}], **BODY))
    plain = simulate(scene(structure, None, excitation={"force": 2.0}, **BODY))
    assert one.section.tobytes() == plain.section.tobytes() and one.energy == plain.energy


def test_the_resonance_that_the_loads_reach(tmp_path):
    """resonance_amplitude scales all loads; those of two nodal diameters know no other resonance."""
    structure, _ = ring(tmp_path)
    case = scene(structure, travelling(2), excitation={"resonance_amplitude": 1e-3, "resonance_near": 100.0})
    natural = OWN / (2 * math.pi) * math.sqrt(1 + 4 * COUPLING)
    found = chosen_resonance(case)
    assert found.frequency == pytest.approx(natural, rel=1e-3)
    peak = linear_responses(case)[0].peak(80.0, 200.0)
    assert peak.amplitude == pytest.approx(1e-3, rel=1e-9)
    # 2 N on 1 kg, and omega_r^2 X = 2 N scale/(2 zeta sqrt(1 - zeta^2))
    scale = 1e-3 / found.flexibility
    own = (2 * math.pi * natural) ** 2
    assert scale == pytest.approx(1e-3 * own * 2 * RATIO * math.sqrt(1 - RATIO**2) / 2.0, rel=1e-9)
    with pytest.raises(InputError, match=r"^excitation.resonance_amplitude: the loads of order 1 excite no mode that"):
        linear_responses(case.replace({"excitation.load": travelling(2, order=2)}))


def test_the_resonance_that_the_loads_meet_along_an_engine_order(tmp_path):
    """Two nodal diameters of blades that stiffen with the speed: W^2 (4^2 - 0.5) = omega_2^2, at that height there."""
    _, model = ring(tmp_path)
    turning = replace(
        model, centrifugal_stiffness=0.5 * np.eye(BLADES), rotation_axis=np.array([0.0, 0.0, 1.0]),
        rotation_point=np.zeros(3), greatest_speed=400.0,
    )  # fmt: skip
    turning.save(tmp_path / "turning.h5")
    speed = OWN * math.sqrt((1 + 4 * COUPLING) / (4**2 - 0.5))
    excitation = {"engine_order": 4.0, "at": "tip0", "load": travelling(2), "resonance_amplitude": 1e-3}
    case = {
        "structure": {"model": "rom", "file": str(tmp_path / "turning.h5")}, "excitation": excitation,
        "rotation": {"speed": speed}, "time": {"periods": 2, "transient": 1},
        "sweep": {"rotation.speed": [0.6 * speed, speed, 1.3 * speed]},
    }  # fmt: skip
    found = sweep(validate(Scene, case, "scene"))
    # but for terms of the damping's square
    assert found.peaks["undamped_peak"] == pytest.approx(1e-3, rel=5 * RATIO**2)
    assert found.peaks["undamped_peak_frequency"] == pytest.approx(4 * speed / (2 * math.pi), rel=5 * RATIO**2)


# -- with a body


def test_every_method_takes_them(tmp_path):
    """Against solve_ivp over the first impacts, then Moreau-Jean's with decreasing steps."""
    structure, _ = ring(tmp_path, 0.02)
    case = scene(structure, UNEVEN, periods=2, **BODY)
    exact = simulate(case, samples_per_period=16)
    assert exact.counters["impacts"] >= 3 and exact.energy_residual < 1e-10
    other = simulate(case.replace({"solver": {"method": "solve_ivp", "rtol": 1e-11}}), samples_per_period=16)
    largest = np.abs(exact.displacement).max()
    assert np.abs(other.displacement - exact.displacement).max() < 1e-7 * largest
    assert other.attached_mass_fraction == pytest.approx(exact.attached_mass_fraction, rel=1e-5)
    errors = []
    for steps in (1000, 16000):
        stepped = simulate(case.replace({"solver": {"method": "moreau", "steps_per_period": steps}}))
        errors.append(np.abs(stepped.slip - exact.slip).max() / 5e-6)
    assert errors[1] < 0.01 and errors[1] < 0.2 * errors[0]


def test_a_body_in_a_tuned_ring(tmp_path):
    """One of two modes of a nodal diameter rests at the response: what feels it is the body that sticks there."""
    structure, _ = ring(tmp_path)
    case = scene(structure, travelling(1), periods=2, **BODY)
    exact = simulate(case, samples_per_period=16)
    other = simulate(case.replace({"solver": {"method": "solve_ivp", "rtol": 1e-11}}), samples_per_period=16)
    assert exact.status is Status.OK and exact.counters["impacts"] >= 3
    assert np.abs(other.displacement - exact.displacement).max() < 1e-7 * np.abs(exact.displacement).max()
    assert exact.energy_residual < 1e-10


def test_a_body_that_sticks_is_all_attached(tmp_path):
    """The mass on the response's own blade, while loads act on the others: F = omega^2 m X, whatever they are."""
    structure, _ = ring(tmp_path, 0.02)
    stuck = {
        "cavity": [{"name": "c", "gap": 1.0, "floor": "tip0"}],
        "damper": [{"cavity": "c", "mass": 0.05, "friction": 1.0, "normal_load": 1e6}],
    }
    loads = travelling(1)[1:]
    case = scene(structure, loads, periods=420, transient=410, **stuck)
    response = simulate(case)
    assert response.attached_mass_fraction == pytest.approx(1.0, rel=1e-9)
    assert response.amplitude_max == pytest.approx(linear_responses(case)[1].amplitude([FREQUENCY])[0], rel=1e-9)


def test_an_orbit_is_where_the_run_ends(tmp_path):
    structure, _ = ring(tmp_path)
    case = scene(structure, UNEVEN, orbit={"to": 105.0})
    orbit = find_orbit(case)
    settled = simulate(scene(structure, UNEVEN, periods=420, transient=410))
    assert orbit.amplitude_mean == pytest.approx(settled.amplitude_max, rel=1e-8)


def test_a_sweep_over_one_phase(tmp_path):
    structure, model = ring(tmp_path)
    loads = UNEVEN[:2]
    case = scene(structure, loads, 420, 410, sweep={"excitation.load.0.phase": [0.0, 45.0, 90.0]})
    found = sweep(case)
    for index, phase in enumerate((0.0, 45.0, 90.0)):
        expected = abs(waves(model, [loads[0] | {"phase": phase}, loads[1]])[1])
        assert found.amplitude_max[index] == pytest.approx(expected, rel=1e-8)
        assert found.amplitude_undamped[index] == pytest.approx(expected, rel=1e-9)


def test_the_number_of_modes_is_chosen_for_all_loads(tmp_path):
    """Two nodal diameters are the ring's last mode: only the whole model has it."""
    structure, _ = ring(tmp_path)
    chosen = select_model_order(scene(structure | {"modes": "auto", "tolerance": 1e-3}, travelling(2)))
    assert chosen.scene.structure.modes == BLADES


def test_a_study_scales_the_loads(tmp_path):
    ring(tmp_path)
    text = f"""
[structure]
model = "rom"
file = "ring.h5"
[excitation]
frequency = {FREQUENCY}
at = "tip0"
load_factor = 3.0
[[excitation.load]]
at = "tip1"
force = 2.0
[[cavity]]
name = "c"
gap = 1e-5
floor = "tip0"
[[damper]]
cavity = "c"
mass = 0.01
[optimise]
band = {{ start = 95.0, stop = 130.0, num = 3 }}
[optimise.variables]
mass_ratio = [0.01, 0.05]
gap_ratio = [0.1, 1.0]
bodies = 1
[optimise.tolerances]
excitation = 0.1
"""
    (tmp_path / "study.toml").write_text(text)
    study = Study.load(tmp_path / "study.toml")
    assert study.amplitude == pytest.approx(3.0 * study.resonance.flexibility, rel=1e-12)


# -- what is refused


@pytest.mark.parametrize(
    ("excitation", "message"),
    [
        ({"force": 1.0}, "excitation: give one of load and force"),
        ({"base_acceleration": 1.0}, "excitation: give one of load and base_acceleration"),
        ({"harmonic": [{"order": 2, "amplitude": 1.0}]}, "excitation: give one of load and harmonic"),
        ({"pattern": "p.csv"}, "excitation: give one of load and pattern"),
        ({"load_factor": 2.0, "resonance_amplitude": 1e-3}, "excitation: give one of load_factor and resonance_ampl"),
        ({"load": [{"at": "tip0", "force": 1.0}] * 2}, r"excitation: load\[1\]: order 1 at 'tip0' is given twice"),
        ({"load": [{"at": "tip0", "force": -1.0}]}, r"excitation.load\[0\].force: should be greater than or equal"),
        ({"load": [{"at": "tip0", "force": 1.0, "order": 0}]}, r"excitation.load\[0\].order: should be greater than 0"),
        ({"load": [{"force": 1.0}]}, r"excitation.load\[0\].at: missing"),
        ({"load": {"at": "tip0", "force": 1.0}}, "excitation.load: .*"),
        ({"load": [], "load_factor": 1.0}, "excitation: load_factor: is that of load or pattern"),
        ({"base_direction": [0, 1, 0]}, "excitation: base_direction: is that of base_acceleration"),
    ],
)  # fmt: skip
def test_wrong_tables(tmp_path, excitation, message):
    structure, _ = ring(tmp_path)
    with pytest.raises(InputError, match=f"^scene: {message}") as refused:
        scene(structure, travelling(1), excitation=excitation)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("key", ["load", "pattern"])
def test_other_structures_have_no_points(key):
    excitation = {"frequency": 1.0, key: [{"at": "tip", "force": 1.0}] if key == "load" else "p.csv"}
    rigid = {"model": "rigid", "mass": 1.0, "stiffness": 1.0, "damping": 0.1}
    table = {"model": "prescribed", "displacement_amplitude": 1e-3}
    for structure, remedy in ((rigid, "give force"), (table, "leave it out")):
        with pytest.raises(InputError, match=f"^scene: excitation.{key}: interface labels are .* points: {remedy}$"):
            validate(Scene, {"structure": structure, "excitation": excitation}, "scene")


def test_labels_that_cannot_be_pushed(tmp_path):
    structure, _ = ring(tmp_path)
    with pytest.raises(InputError, match=r"^excitation.load\[0\].at: no interface label 'tip9'; it has tip0, tip1"):
        simulate(scene(structure, [{"at": "tip9", "force": 1.0}]))
    rows = {"tip0": [1.0, 0.0], "turn": [0.0, 1.0]}
    model = ReducedModel.from_matrices(np.eye(2), 1e4 * np.eye(2), rows, damping_ratio=0.1, arms=np.array([0.0, 0.1]))
    model.save(tmp_path / "turn.h5")
    with pytest.raises(InputError, match=r"^excitation.load\[0\].*: 'turn' is a rotation"):
        simulate(scene({"model": "rom", "file": str(tmp_path / "turn.h5")}, [{"at": "turn", "force": 1.0}]))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (None, "{file}: no such file"),
        ("", "{file}: is empty; expected the header at,order,force,phase_deg, then rows"),
        ("at,order,force,phase_deg\n", "{file}: expected at least 1 row below the header, not 0"),
        ("at,order,force\n", "{file}: line 1: expected the header at,order,force,phase_deg, not at,order,force"),
        ("tip0,1,2.0,0\n", "{file}: line 1: expected the header at,order,force,phase_deg, not tip0,1,2.0,0"),
        ("at,order,force,phase_deg\ntip0,1,2.0\n", "{file}: line 2: expected 4 values, not 3"),
        ("at,order,force,phase_deg\ntip0,1,two,0\n", "{file}: line 2: force: expected a finite number (got 'two')"),
        ("at,order,force,phase_deg\ntip0,1,nan,0\n", "{file}: line 2: force: expected a finite number (got 'nan')"),
        ("at,order,force,phase_deg\ntip0,1.5,1,0\n", "{file}: line 2: order: expected a whole number above 0"),
        ("at,order,force,phase_deg\ntip0,1,-1,0\n", "{file}: line 2: force: expected 0 or more, its sign in phase_deg"),
        ("at,order,force,phase_deg\ntip0,1,1e300,0\n", "{file}: line 2: force: expected a number up to 1e+40"),
        ("at,order,force,phase_deg\ntip0,1e20,1,0\n", "{file}: line 2: order: expected a whole number up to 92233720"),
        ("at,order,force,phase_deg\n  # tip\n,1,1,0\n", "{file}: line 3: at: name an interface label"),
        ("at,order,force,phase_deg\n,1,1,0\n", "{file}: line 2: at: name an interface label"),
        ("at,order,force,phase_deg\n# tip\ntip0,1,1,0\ntip0,1,2,0\n",
         "excitation.pattern: {file}: line 4: order 1 at 'tip0' is given twice"),
        ("at,order,force,phase_deg\ntip9,1,1,0\n", "excitation.pattern: {file}: line 2: no interface label 'tip9'"),
    ],
)  # fmt: skip
def test_wrong_patterns(tmp_path, text, message):
    structure, _ = ring(tmp_path)
    file = tmp_path / "p.csv"
    if text is not None:
        file.write_text(text)
    with pytest.raises(InputError) as refused:
        simulate(scene(structure, None, excitation={"pattern": str(file)}))
    assert str(refused.value).startswith(message.format(file=file)) and "\n" not in str(refused.value)
