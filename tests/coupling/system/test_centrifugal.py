"""Bodies under centrifugal load: friction and pull by hand, and concave tracks whose frequency follows the speed."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import eigh

from tests.coupling.methods.test_planar_bodies import last, run_by
from tests.tools.planar import run_planar
from tests.tools.processes import ROOT
from vanedamp import InputError, ReducedModel, Scene
from vanedamp.coupling.model_order.selection import warnings_of
from vanedamp.coupling.response.records import FRICTION
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.simulation import simulate
from vanedamp.coupling.sweep.grid import grid
from vanedamp.coupling.system.assembly import assemble
from vanedamp.coupling.system.body_loads import body_loads, load_warnings
from vanedamp.coupling.system.linear_response import linear_responses
from vanedamp.coupling.system.modal_basis import basis_of
from vanedamp.files.toml_input import validate

SPEED, R, RHO, MASS = 100.0, 0.3, 0.02, 0.01
A, FRICTION_AT_TRACK = 0.004, 0.5
DISC = {"shape": "disc", "radius": A, "friction": FRICTION_AT_TRACK}
BALL = DISC | {"inertia": 0.4 * MASS * A**2}
PLACE = {"name": "c", "gap": 1.0, "play": 1.0, "radius": R + RHO}
TABLE = {"model": "prescribed", "displacement_amplitude": 1e-15}


def scene(*bodies, structure=None, cavity=None, **tables):
    """A scene that rotates, with one cavity; by default its structure stands still in the rotating frame."""
    data = {
        "structure": structure or TABLE, "excitation": {"engine_order": 2.0}, "rotation": {"speed": SPEED},
        "gravity": {"acceleration": 0.0},
        "cavity": cavity if isinstance(cavity, list) else [PLACE | (cavity or {})],
        "damper": [{"cavity": "c", "mass": MASS} | body for body in bodies], "time": {"periods": 1, "transient": 0},
    }  # fmt: skip
    return validate(Scene, data | tables, "scene")


def loads_of(made):
    return body_loads(made, basis_of(made))


def order_of(made, samples=64):
    """The engine order at which the body swings, by three samples of a sine, each 4 steps apart."""
    x = run_planar(made, 1, samples=samples).records.samples[:samples, 1]
    step = 4 * 2 * math.pi / (made.excitation.engine_order * samples)
    return math.acos((x[0] + x[8]) / (2 * x[4])) / step


# --- tracks


@pytest.mark.parametrize(
    ("body", "order"),
    [({}, math.sqrt(R / RHO)), (DISC, math.sqrt(2 * R / (3 * RHO))), (BALL, math.sqrt(5 * R / (7 * RHO)))],
    ids=["point", "rolling disc", "rolling ball"],
)
def test_a_body_on_a_track_is_tuned_to_an_engine_order(body, order):
    swinging = scene(body | {"track_radius": RHO, "position": 1e-4})
    for speed in (SPEED, 7 * SPEED):
        assert order_of(swinging.replace({"rotation.speed": speed})) == pytest.approx(order, rel=1e-9)


def test_gravity_swings_a_body_on_a_track_at_standstill():
    still = {"excitation": {"frequency": 10.0}, "rotation": {"speed": 0.0}, "gravity": {"acceleration": 9.81}}
    swinging = scene({"track_radius": RHO, "position": 1e-4}, **still)
    assert loads_of(swinging).track == pytest.approx([MASS * 9.81 / RHO], rel=1e-14)
    x = run_planar(swinging, 1, samples=64).records.samples[:64, 1]
    assert x[32] == pytest.approx(1e-4 * math.cos(math.sqrt(9.81 / RHO) * 0.05), abs=1e-13)


def test_a_track_moves_with_the_structure_and_the_gradient_stays_with_the_axis():
    """Natural frequencies of structure and body are those of the two coupled equations."""
    mass, stiffness = 0.2, 9e3
    structure = {"model": "rigid", "mass": mass, "stiffness": stiffness, "damping_ratio": 0.0}
    run = run_planar(scene({"track_radius": RHO, "position": 1e-4}, structure=structure), 1)
    track, gradient = MASS * SPEED**2 * (R + RHO) / RHO, MASS * SPEED**2
    matrix = [[stiffness + track, -track], [-track, track - gradient]]
    squares = eigh(matrix, np.diag([mass, MASS]), eigvals_only=True)
    (flow,) = run.flows.eigenvalue[run.flows.modes > 0]
    found = np.sort(flow.imag[1 : run.flows.modes[0]])
    np.testing.assert_allclose(found, np.sqrt(squares), rtol=1e-10)


def test_a_spring_is_softened_by_the_gradient():
    swinging = scene({"stiffness": 10 * MASS * SPEED**2, "position": 1e-4})
    assert order_of(swinging) == pytest.approx(3.0, rel=1e-9)


def test_the_gradient_is_felt_where_the_cavity_has_moved():
    """Absolute motion y = X sin(omega t) + s obeys y'' = W^2 y - N s/(m rho), from rest in the cavity."""
    reach, omega, square = 1e-5, 2 * SPEED, SPEED**2 * R / RHO
    run = run_planar(scene({"track_radius": RHO}, structure=TABLE | {"displacement_amplitude": reach}), 1, samples=8)
    t, natural = np.arange(8) * math.pi / (4 * omega), math.sqrt(square)
    forced = (omega**2 + SPEED**2) * reach / (square - omega**2)
    expected = forced * (np.sin(omega * t) - omega / natural * np.sin(natural * t))
    np.testing.assert_allclose(run.records.samples[:8, 1], expected, rtol=0, atol=1e-9 * reach)


@pytest.mark.parametrize(("share", "slips"), [(0.999, False), (1.001, True)])
def test_rolling_takes_friction(share, slips):
    """A solid disc that rolls needs a third of what the track brings back, of which friction has mu N."""
    limit = 3 * FRICTION_AT_TRACK * RHO * (R + RHO) / R
    run = run_planar(scene(DISC | {"track_radius": RHO, "position": share * limit}), 1)
    assert run.status is Status.OK
    lost = run.state.ledger[FRICTION]
    swing = MASS * SPEED**2 * R / RHO * limit**2
    assert bool(lost > 1e-9 * swing) == slips
    assert slips or abs(lost) < 1e-12 * swing


def test_bodies_side_by_side_on_a_track_press_on_each_other():
    loads = loads_of(scene(DISC | {"track_radius": RHO}, DISC | {"track_radius": RHO}))
    back = SPEED**2 * R / RHO * A
    np.testing.assert_allclose(loads.along, [back, -back], rtol=1e-12)


# --- load and pull


@pytest.mark.parametrize("shape", [{}, {"shape": "block", "length": 0.02, "height": 0.01}], ids=["slider", "block"])
@pytest.mark.parametrize(("share", "slips"), [(1 - 1e-6, False), (1.01, True)])
def test_a_body_slips_on_a_shaking_table_above_the_friction_of_the_centrifugal_load(shape, share, slips):
    mu, omega = 0.3, 2 * SPEED
    amplitude = share * mu * (R + RHO) * SPEED**2 / omega**2
    table = {"model": "prescribed", "displacement_amplitude": amplitude}
    response = simulate(scene(shape | {"friction": mu}, structure=table))
    assert response.status is Status.OK
    assert (response.energy["friction"] > 0.0) is slips
    if not slips:
        assert abs(response.slip[-1, 0]) < 1e-12 * amplitude


@pytest.mark.parametrize("shape", [{}, {"shape": "block", "length": 0.02, "height": 0.01}], ids=["slider", "block"])
def test_friction_stops_a_body_by_the_centrifugal_load(shape):
    mu, speed = 0.2, 1.5
    thrown = scene(shape | {"friction": mu, "velocity": speed})
    response = simulate(thrown)
    assert speed / (mu * SPEED**2 * (R + RHO)) < 2 * math.pi / (2 * SPEED)  # within the period
    assert response.slip[-1, 0] == pytest.approx(speed**2 / (2 * mu * SPEED**2 * (R + RHO)), rel=1e-9)


def test_an_inclined_cavity_pulls_the_body_to_its_left_wall():
    angle = math.radians(30.0)
    pulled = scene({"friction": 0.2}, cavity={"centrifugal_deg": 30.0}, excitation={"engine_order": 20.0})
    response = simulate(pulled)
    load = SPEED**2 * (R + RHO) * (math.sin(angle) - 0.2 * math.cos(angle))
    time = 2 * math.pi / (20 * SPEED)
    assert response.slip[-1, 0] == pytest.approx(-load * time**2 / 2, rel=1e-12)


def test_a_normal_load_of_its_own_needs_no_radius():
    made = scene({"friction": 0.3, "normal_load": 7.0}, cavity={"radius": None})
    assert assemble(made).holds[0] == pytest.approx(2.1, rel=1e-15)


AXIS, POINT = np.array([0.6, 0.0, 0.8]), np.array([0.1, -0.2, 0.05])
#: floors of three cavities: direction along, across, position
FLOORS = {
    "a": ([0.0, 1.0, 0.0], [-0.8, 0.0, 0.6], [0.5, -0.2, 0.1]),
    "b": ([0.8, 0.0, -0.6], [0.0, 1.0, 0.0], [0.0, -0.6, 0.3]),
    "c": ([0.6, 0.0, 0.8], [0.0, 1.0, 0.0], [0.0, -0.6, 0.3]),
}


def model(path, labels=None, **changes):
    """A reduced model of one mode that turns about an inclined axis, with three cavities that differ in direction."""
    directions = {label: floor[0] for label, floor in FLOORS.items()}
    directions |= {f"{label}.normal": floor[1] for label, floor in FLOORS.items()}
    fields = {
        "damping_ratio": 0.01, "directions": directions, "centrifugal_stiffness": [[0.0]], "rotation_axis": AXIS,
        "rotation_point": POINT, "greatest_speed": 2 * SPEED,
        "positions": np.array([FLOORS[label[0]][2] for label in directions]),
    } | changes  # fmt: skip
    made = ReducedModel.from_matrices([[1.0]], [[1e6]], {label: [1e-3] for label in labels or directions}, **fields)
    made.save(path)
    return {
        "structure": {"model": "rom", "file": str(path)},
        "excitation": {"engine_order": 2.0, "at": "a", "force": 1e-12},
        "cavity": [{"name": f"of {label}", "gap": 1.0, "play": 1.0, "floor": label} for label in FLOORS],
    }  # fmt: skip


def by_hand(label, height=0.0):
    """Pull along a cavity, load across it, and gradient, per mass."""
    along, across, place = (np.array(part) for part in FLOORS[label])
    arm = place + height * across - POINT
    load = -np.cross(SPEED * AXIS, np.cross(SPEED * AXIS, arm))
    return load @ along, load @ across, SPEED**2 * (1 - (along @ AXIS) ** 2)


def test_friction_and_pull_in_the_cavities_of_a_reduced_model(tmp_path):
    """Each cavity has its own place and direction; sliders are pressed on whatever floor there is."""
    tables = model(tmp_path / "rom.h5")
    bodies = [{"cavity": f"of {label}", "mass": MASS, "friction": 0.25} for label in FLOORS]
    system = assemble(scene(**tables, damper=bodies))
    for i, label in enumerate(FLOORS):
        along, across, _ = by_hand(label)
        rest = np.linalg.norm(np.cross(SPEED * AXIS, np.cross(SPEED * AXIS, np.array(FLOORS[label][2]) - POINT)))
        assert system.weight[1 + i] == pytest.approx(MASS * along, rel=1e-12, abs=1e-12)
        assert system.holds[i] == pytest.approx(0.25 * MASS * math.sqrt(rest**2 - along**2), rel=1e-12)
        if label != "a":  # whose load also has a part across the plane of motion: none
            assert abs(across) <= rest
    blocks = [body | {"shape": "block", "length": 0.02, "height": 0.01} for body in bodies]
    loads = loads_of(scene(**tables, damper=blocks))
    for i, label in enumerate(FLOORS):
        along, across, _ = by_hand(label, 0.005)
        assert (loads.along[i], loads.across[i]) == pytest.approx((along, -across), rel=1e-12, abs=1e-9)


@pytest.mark.parametrize("floor", [None, "floor"])
def test_a_body_stands_in_the_middle_between_its_walls(tmp_path, floor):
    """With or without a floor of its own, which may lie anywhere along the cavity."""
    places = {"left": [0.4, -0.03, 0.0], "right": [0.4, 0.05, 0.0], "floor": [0.4, 0.2, 0.0]}
    tables = model(
        tmp_path / "rom.h5", labels=places, positions=np.array(list(places.values())),
        directions={label: (0.0, 1.0, 0.0) for label in places},
        rotation_axis=[0.0, 0.0, 1.0], rotation_point=[0.0, 0.0, 0.0],
    )  # fmt: skip
    tables["excitation"]["at"] = "left"
    tables["cavity"] = [
        {"name": "c", "gap": 1e-3, "left": "left", "right": "right"} | ({"floor": floor} if floor else {})
    ]
    loads = loads_of(scene(**tables, damper=[{"cavity": "c", "mass": MASS, "friction": 0.1}]))
    assert loads.along[0] == pytest.approx(SPEED**2 * 0.01, rel=1e-12)
    assert loads.across[0] == pytest.approx(SPEED**2 * 0.4, rel=1e-12)


def test_a_load_across_the_plane_of_a_body_is_warned_of(tmp_path):
    """Blocks feel no wall beside their plane; sliders are pressed on whatever floor there is."""
    tables = model(tmp_path / "rom.h5")
    sort = {"cavity": "of b", "mass": MASS, "friction": 0.3}
    block = sort | {"shape": "block", "length": 0.02, "height": 0.01}
    arm = np.array(FLOORS["b"][2]) - POINT
    side = abs(np.cross(SPEED * AXIS, np.cross(SPEED * AXIS, arm)) @ np.cross(*np.array(FLOORS["b"][:2])))
    assert side < 1e-9  # the cavity lies in the plane of rotation
    assert "across the plane" not in warnings(**tables, damper=[block])
    inclined = sort | block | {"cavity": "of c"}
    arm = np.array(FLOORS["c"][2]) - POINT
    side = abs(np.cross(SPEED * AXIS, np.cross(SPEED * AXIS, arm)) @ np.cross(*np.array(FLOORS["c"][:2])))
    assert f"the load has {side:.3g} m/s^2 across the plane" in warnings(**tables, damper=[inclined])
    assert "across the plane" not in warnings(**tables, damper=[inclined | {"friction": 0.0}])
    assert "across the plane" not in warnings(**tables, damper=[sort | {"cavity": "of c"}])


def test_tracks_in_the_plane_of_rotation_and_along_the_axis(tmp_path):
    """Along the axis the centrifugal load has no gradient: the order is sqrt((R + rho)/rho)."""
    tables = model(tmp_path / "rom.h5")
    bodies = [{"cavity": f"of {label}", "mass": MASS, "track_radius": RHO} for label in ("b", "c")]
    loads = loads_of(scene(**tables, damper=bodies))
    for i, label in enumerate(("b", "c")):
        along, _, gradient = by_hand(label)
        arm = np.array(FLOORS[label][2]) - POINT
        pressed = math.sqrt(np.linalg.norm(SPEED**2 * (arm - (arm @ AXIS) * AXIS)) ** 2 - along**2)
        assert loads.track[i] == pytest.approx(MASS * pressed / RHO, rel=1e-12)
        assert loads.gradient[i] == pytest.approx(MASS * gradient, rel=1e-12, abs=1e-12)
    assert loads.gradient[1] == pytest.approx(0.0, abs=1e-12)


def test_gravity_counts_along_the_axis_only(tmp_path):
    tables = model(tmp_path / "rom.h5") | {"damper": [{"cavity": "of c", "mass": MASS}]}
    across = {"gravity": {"acceleration": 9.81, "direction": [0.8, 0.0, -0.6]}}
    along = {"gravity": {"acceleration": 9.81, "direction": [-0.6, 0.0, -0.8]}}
    pull = [loads_of(scene(**tables, **gravity)).along[0] for gravity in ({}, across, along)]
    assert pull[1] == pytest.approx(pull[0], abs=1e-12)
    assert pull[2] == pytest.approx(pull[0] - 9.81, rel=1e-12)


def test_the_self_tuning_damper_of_the_documentation():
    """Out of reach of its walls it absorbs the engine order at every speed, where a constant spring has one."""
    rolling = replace(Scene.load(ROOT / "docs" / "examples" / "self_tuning.toml"), sweep={})
    tables = rolling.replace({"cavity.trough.gap": 0.01}).to_dict()
    (body,) = tables["damper"]
    tuned = 2 * math.pi * 6100 / 60
    sprung = body | {"stiffness": body["mass"] * tuned**2 * (1 + 7 / 5 * 16)}
    del sprung["track_radius"]
    for rpm in (5700.0, 6100.0, 6500.0):
        amplitude = []
        for used in (body, sprung):
            made = validate(Scene, tables | {"damper": [used], "rotation": {"rpm": rpm}}, "scene")
            response = simulate(made)
            assert response.status is Status.OK
            undamped = float(linear_responses(made)[0].amplitude(np.array([made.frequency]))[0])
            amplitude.append(response.amplitude_harmonic / undamped)
        assert amplitude[0] < 1e-2
        assert (amplitude[1] < 1e-2) is (rpm == 6100.0)


# --- methods


@pytest.mark.parametrize(
    ("solver", "within"),
    [
        ({"method": "moreau", "steps_per_period": 10_000}, 2e-3),
        ({"method": "penalty", "steps_per_period": 100_000}, 2e-2),
        ({"method": "solve_ivp", "steps_per_period": 512}, 1e-7),
    ],
    ids=["moreau", "penalty", "solve_ivp"],
)
def test_other_methods_have_the_same_track(solver, within):
    """A disc that slides, then rolls on its track, in a cavity that moves: state after a period."""
    table = {"model": "prescribed", "displacement_amplitude": 1e-3}
    thrown = scene(DISC | {"friction": 0.1, "track_radius": RHO, "velocity": 0.5}, structure=table)
    exact = run_planar(thrown, 1)
    assert exact.status is Status.OK
    assert exact.state.ledger[FRICTION] > 0.0
    run, status = run_by(thrown, **solver)
    assert status is Status.OK
    q, v = last(run)
    np.testing.assert_allclose(q[0], exact.state.q[0], atol=within * 0.5 / (3 * SPEED))
    np.testing.assert_allclose(v[0], exact.state.v[0], atol=within * 0.5)


# --- what is refused, and what is warned of


def test_wrong_input_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"cavity\[0\].radius: missing"):
        scene({}, cavity={"radius": None})
    with pytest.raises(InputError, match=r"centrifugal_deg = 180; give normal_load or turn it to -90..90"):
        scene({"friction": 0.1}, cavity={"centrifugal_deg": 180.0})
    with pytest.raises(InputError, match="normal_load: on a track"):
        scene({"track_radius": RHO, "normal_load": 1.0})
    with pytest.raises(InputError, match="track_radius: beside shape"):
        scene({"shape": "auto", "length": 0.01, "height": 0.01, "track_radius": RHO})
    with pytest.raises(InputError, match=r"damper\[0\].track_radius: the body is pulled off its concave floor"):
        assemble(scene({"track_radius": RHO}, cavity={"centrifugal_deg": 180.0}))
    with pytest.raises(InputError, match="greater than 0"):
        scene({"track_radius": 0.0})
    body = {"damper": [{"cavity": "of a", "mass": MASS}]}
    with pytest.raises(InputError, match=r"cavity\[0\].radius: a reduced model has the places"):
        scene(
            **body,
            **(model(tmp_path / "a.h5") | {"cavity": [{"name": "of a", "gap": 1.0, "floor": "a", "radius": 1.0}]}),
        )
    for changes, fault in (
        ({"rotation_axis": None, "rotation_point": None}, "rotation: the reduced model knows no axis"),
        ({"positions": None}, r"cavity\[0\].floor: the reduced model knows no position of 'a'"),
        ({"directions": {}}, r"cavity\[0\].floor: the reduced model knows no direction of 'a'"),
    ):
        tables = model(tmp_path / "b.h5", **changes)
        with pytest.raises(InputError, match=fault):
            assemble(scene(**body, **tables))
        assemble(scene(**tables))


def warnings(*bodies, **tables):
    return " ".join(load_warnings(scene(*bodies, **tables)))


def test_what_is_left_out_is_warned_of_where_it_shows():
    narrow = {"gap": 1e-4, "play": 1e-4}
    quiet = {"cavity": narrow, "excitation": {"engine_order": 20.0}}
    assert warnings({"friction": 0.3}, {"track_radius": RHO}, **quiet) == ""
    assert warnings({"friction": 0.3}, **quiet, gravity={"acceleration": 31.0}) == ""
    assert "0.01 of the centrifugal" in warnings({"friction": 0.3}, **quiet, gravity={"acceleration": 33.0})
    # along a straight cavity, without friction: 1/order^2 of the inertia
    assert "is 0.012 of what else" in warnings({}, cavity=narrow, excitation={"engine_order": 9.0})
    assert warnings({"track_radius": RHO}, cavity=narrow, excitation={"engine_order": 9.0}) == ""
    assert "0.016 of the frequency" in warnings(
        {"track_radius": RHO}, cavity={"gap": RHO}, excitation={"engine_order": 9.0}
    )
    crossing = 2 * 20.0 * 2e-4 / (R + RHO)
    assert f"{crossing:.2g} of it" in warnings(
        {"friction": 0.3}, cavity={"gap": 4e-4}, excitation={"engine_order": 20.0}
    )
    outboard = {"gap": 4e-4, "play": 1e-4, "centrifugal_deg": 180.0}  # of a planar body: the ceiling presses it
    assert f"{crossing:.2g} of it" in warnings(
        DISC | {"friction": 0.3}, cavity=outboard, excitation={"engine_order": 20.0}
    )
    turning = {"gap": 1e-4, "rotation": 20.0}
    assert f"{20 * (R + RHO) / 400:.2g} of the body's inertia" in warnings(
        {}, cavity=turning, excitation={"engine_order": 20.0}
    )
    still = {"rotation": {"speed": 0.0}, "excitation": {"frequency": 10.0}}
    assert warnings({"friction": 0.3}, **still, gravity={"acceleration": 9.81}) == ""


def test_a_sweep_that_begins_at_standstill_warns_of_its_end():
    still = scene(
        {"friction": 0.3}, excitation={"frequency": 20.0}, rotation={"speed": 0.0}, gravity={"acceleration": 9.81}
    )
    swept = still.replace({"sweep": {"rotation.speed": [0.0, 2.0]}})
    assert warnings_of(still) == ()
    assert "gravity turns once a revolution" in " ".join(grid(swept).warnings)


def test_tables_of_other_commands_are_no_axes_of_a_sweep():
    made = scene({"friction": 0.3}, ramp={"from": 10.0, "to": 20.0, "rate": 1.0}, excitation={"frequency": 20.0})
    with pytest.raises(InputError, match=r"^sweep: ramp.rate changes no run of a sweep"):
        grid(made.replace({"sweep": {"ramp.rate": [1.0, 2.0]}}))
