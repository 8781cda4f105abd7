"""Directions of cavities in space: what a body feels there of the base's motion and of gravity.

The structure is one mass on a spring that moves along y, and the base with it; a cavity at an angle to y feels the
cosine of both. Closed forms; events of two methods against each other.
"""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy import sparse

from tests.tools.input_files import CLUSTER, changed
from vanedamp.coupling.scene.excitation import Gravity
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.coupling.sweep.sweep import sweep
from vanedamp.files.toml_input import InputError, validate
from vanedamp.modal.matrices import Patch, SystemMatrices
from vanedamp.rom.reduced import ReducedModel
from vanedamp.studies.case.stages import assemble, interface, reduction
from vanedamp.studies.case.tables import Case, InterfaceTable

OMEGA = 2 * math.pi
MASS = 1.0


def at_angle(degrees):
    """Unit direction in the plane of y and z."""
    return (0.0, math.cos(math.radians(degrees)), math.sin(math.radians(degrees)))


def oscillator(path, frequency_ratio, angles, **changes):
    """Reduced model of unit mass along y, excitation 1 Hz; cavities "c0", ... at `angles` (degree) to y."""
    floors = {f"c{i}": [math.cos(math.radians(angle))] for i, angle in enumerate(angles)}
    values = {
        "damping_ratio": 0.02,
        "directions": {"y": (0.0, 1.0, 0.0)} | {f"c{i}": at_angle(angle) for i, angle in enumerate(angles)},
        "base_load": MASS * np.array([[0.0, 1.0, 0.0]]),
    } | changes
    stiffness = MASS * (OMEGA * frequency_ratio) ** 2
    ReducedModel.from_matrices([[MASS]], [[stiffness]], {"y": [1.0]} | floors, **values).save(path)
    return str(path)


def shaken(file, dampers, gap=100.0, **tables):
    """Bodies, the i-th in the cavity "c<i>", on a base that moves by 1 m at 1 Hz."""
    data = {
        "structure": {"model": "rom", "file": file},
        "excitation": {"frequency": 1.0, "base_acceleration": OMEGA**2, "at": "y"},
        "gravity": {"acceleration": 0.0},
        "cavity": [{"name": f"c{i}", "gap": gap, "floor": f"c{i}"} for i in range(len(dampers))],
        "damper": [{"cavity": f"c{i}", "mass": 0.1} | damper for i, damper in enumerate(dampers)],
        "time": {"periods": 3, "transient": 0},
    }
    return validate(Scene, data | tables, "scene")


@pytest.mark.parametrize("method", ["exact", "solve_ivp"])
@pytest.mark.parametrize("degrees", [0.0, 30.0, 90.0, 150.0])
def test_a_free_body_feels_the_base_along_its_cavity(degrees, method, tmp_path):
    """It stays where it is, so that it slips along its cavity by what base and structure move there."""
    file, share = oscillator(tmp_path / "rom.h5", 1.3, [degrees]), math.cos(math.radians(degrees))
    scene = shaken(file, [{"velocity": share * OMEGA}], solver={"method": method})
    response = simulate(scene, samples_per_period=16)
    slip = share * (np.sin(OMEGA * response.time) - response.displacement)
    np.testing.assert_allclose(response.body_displacement[:, 0], slip, atol=1e-6)
    assert response.energy_residual < 1e-6


def test_linear_curve_of_a_glued_body_at_an_angle(tmp_path):
    """A glued body adds m cos^2 to the mass that the base shakes."""
    share = math.cos(math.radians(30.0))
    scene = shaken(oscillator(tmp_path / "rom.h5", 1.3, [30.0]), [{}], time={"periods": 2, "transient": 0})
    found = sweep(scene.replace({"sweep": {"excitation.frequency": [0.7, 1.0, 1.4]}}))
    omega, natural = OMEGA * found.axes["excitation.frequency"], OMEGA * 1.3
    dynamic = natural**2 - (MASS + 0.1 * share**2) * omega**2 + 2j * 0.02 * natural * omega
    expected = OMEGA**2 * (MASS + 0.1 * share**2) / np.abs(dynamic)
    np.testing.assert_allclose(found.amplitude_fixed, expected, rtol=1e-9)


@pytest.mark.parametrize("gravity", [{"orientation_deg": 0.0}, {"direction": [0.0, 0.0, -2.0]}])
def test_cavities_of_several_directions_by_two_methods(gravity, tmp_path):
    """Impacts, sliding and sticking in three cavities, until chaos parts the methods; the ledger closes."""
    file = oscillator(tmp_path / "rom.h5", 1.1, [0.0, 35.0, 115.0])
    bodies = [{"friction": 0.2, "restitution": 0.6}, {"restitution": 0.8}, {"friction": 0.1, "restitution": 0.5}]
    scene = shaken(file, bodies, gap=1.0, gravity={"acceleration": 10.0} | gravity)
    exact, other = (
        simulate(scene.replace({"solver": {"method": method}}), events=True) for method in ("exact", "solve_ivp")
    )
    hits, others = (
        np.array([(e.time, e.damper, e.relative_velocity_before) for e in run.event_list if e.kind == "impact"])
        for run in (exact, other)
    )
    assert len(hits) > 10 and set(hits[:, 1]) == {0, 1, 2}
    np.testing.assert_allclose(hits[:10], others[:10], rtol=1e-6, atol=1e-6)
    assert exact.energy["excitation"] == pytest.approx(other.energy["excitation"], rel=1e-5)
    assert exact.energy_residual < 1e-10


def test_free_bodies_of_several_directions_balance(tmp_path):
    """Work of the base on bodies that fly freely, each along its own direction, and the momentum of all."""
    file = oscillator(tmp_path / "rom.h5", 1.1, [0.0, 60.0, 180.0])
    scene = shaken(
        file, [{"velocity": 0.3}, {"velocity": -1.0}, {}], gap=1e4, time={"periods": 7, "transient": 0},
        gravity={"acceleration": 2.0, "direction": [0.0, -1.0, 0.0]},
    )  # fmt: skip
    exact, other = (simulate(scene.replace({"solver": {"method": method}})) for method in ("exact", "solve_ivp"))
    assert exact.energy["excitation"] == pytest.approx(other.energy["excitation"], rel=1e-6)
    assert exact.energy_residual < 1e-12
    # no contact: the structure feels nothing of them
    assert exact.attached_mass_fraction == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("beyond", [-0.1, 0.1])
def test_a_body_slides_where_the_tangent_is_the_friction(beyond, tmp_path):
    """At rest below tan(angle) = mu; beyond, it slides down by g (sin - mu cos) t^2 / 2."""
    friction = 0.4
    degrees = math.degrees(math.atan(friction)) + beyond
    file = oscillator(tmp_path / "rom.h5", 1e4, [degrees])
    scene = shaken(
        file, [{"friction": friction}], excitation={"frequency": 1.0, "at": "y"},
        gravity={"acceleration": 10.0, "direction": [0.0, 0.0, -1.0]},
    )  # fmt: skip
    response = simulate(scene, samples_per_period=4)
    angle = math.radians(degrees)
    pull = 10.0 * (math.sin(angle) - friction * math.cos(angle)) if beyond > 0 else 0.0
    # the load's onset rings the structure at up to 0.4 N / (1 kg * 6.3e4 rad/s), which the body may take along for 3 s
    np.testing.assert_allclose(response.body_displacement[:, 0], -0.5 * pull * response.time**2, atol=2e-5)


def test_gravity_by_direction_is_gravity_by_angle():
    """The components of an angle from the floor's normal, whatever the length of the direction."""
    for degrees in (0.0, 30.0, 90.0, -60.0):
        angle = math.radians(degrees)
        by_direction = Gravity(direction=(0.0, -3.0 * math.sin(angle), -3.0 * math.cos(angle)))
        expected = Gravity(orientation_deg=degrees).components(np.zeros(3))
        assert by_direction.components(np.array([0.0, 1.0, 0.0])) == pytest.approx(expected, abs=1e-14)


UNKNOWN = "the reduced model knows no direction of '{}', which {} needs"


@pytest.mark.parametrize(
    ("model", "tables", "message"),
    [
        ({"directions": {"y": (0, 1, 0)}}, {}, UNKNOWN.format("c0", "excitation.base_acceleration")),
        ({"directions": {"c0": (0, 1, 0)}}, {}, UNKNOWN.format("y", "excitation.base_acceleration")),
        ({"base_load": None}, {}, "excitation.base_acceleration: the reduced model does not say how a base loads it"),
        (
            {"directions": {"y": (0, 1, 0)}},
            {"excitation": {"frequency": 1.0, "at": "y"}, "gravity": {"direction": [0, 0, -1]}},
            UNKNOWN.format("c0", "gravity.direction"),
        ),
    ],
)
def test_what_needs_an_unknown_direction_is_refused(model, tables, message, tmp_path):
    scene = shaken(oscillator(tmp_path / "rom.h5", 1.1, [0.0], **model), [{}], **tables)
    with pytest.raises(InputError, match=message):
        simulate(scene)


def test_a_model_without_directions_runs_where_none_is_needed(tmp_path):
    file = oscillator(tmp_path / "rom.h5", 1.1, [0.0], directions=None, base_load=None)
    assert simulate(shaken(file, [{}], excitation={"frequency": 1.0, "force": 1.0, "at": "y"})).status == "ok"


def test_directions_of_a_model_have_length_one():
    model = ReducedModel.from_matrices([[1.0]], [[1.0]], {"a": [1.0], "b": [1.0]}, damping_ratio=0.0,
                                       directions={"a": (0.0, 3.0, 4.0)})  # fmt: skip
    np.testing.assert_allclose(model.directions, [[0.0, 0.6, 0.8], [0.0, 0.0, 0.0]], atol=1e-15)


def cavity(path, directions=None, normals=None, **labels):
    """A scene with one cavity along y, whose walls and floor are coordinates of their own on the oscillator."""
    axes = {"left": (0, 1, 0), "right": (0, 1, 0), "floor": (0, 1, 0), "y": (0, 1, 0)} | (directions or {})
    faces = {"left": (0, 1, 0), "right": (0, -1, 0), "floor": (0, 0, 1), "y": (0, 0, 0)} | (normals or {})
    model = ReducedModel.from_matrices(
        [[1.0]], [[1.2 * OMEGA**2]], {label: [1.0] for label in axes}, damping_ratio=0.02, directions=axes,
        normals=np.array(list(faces.values()), float),
    )  # fmt: skip
    model.save(path)
    labels = labels or {"left": "left", "right": "right", "floor": "floor"}
    return shaken(
        str(path), [{}], gap=1.0, excitation={"frequency": 1.0, "force": 1.0, "at": "y"},
        cavity=[{"name": "c0", "gap": 1.0} | labels],
    )  # fmt: skip


def tilted(degrees):
    """Unit direction in the plane of x and y, from y."""
    return (math.sin(math.radians(degrees)), math.cos(math.radians(degrees)), 0.0)


@pytest.mark.parametrize(
    ("directions", "normals", "labels", "message"),
    [
        ({"right": (0, -1, 0)}, {}, {}, r"cavity\[0\].right: 'right' points against 'left', \[0, -1, 0\] and"),
        ({"right": tilted(30)}, {}, {}, r"cavity\[0\].right: 'right' points at 30 degrees to 'left'"),
        ({"left": tilted(9), "right": tilted(9)}, {}, {}, r"cavity\[0\].left: 'left' points at 9 degrees to 'floor'"),
        (
            dict.fromkeys(("left", "right", "floor"), (1, 0, 0)), {}, {},
            r"cavity\[0\].left: 'left' has a direction \[1, 0, 0\] at 90 degrees .* the direction \[0, 1, 0\]",
        ),
        (
            {}, {}, {"left": "right", "right": "left", "floor": "floor"},
            r"cavity\[0\].left: along its direction \[0, 1, 0\] 'right' is the wall at the other end .*: swap",
        ),
        ({}, {"right": (0, 1, 0)}, {"left": "left", "right": "right"}, r"cavity\[0\].right: along its direction"),
    ],
)  # fmt: skip
def test_walls_that_do_not_fit_their_cavity_are_refused(directions, normals, labels, message, tmp_path):
    with pytest.raises(InputError, match=message):
        simulate(cavity(tmp_path / "rom.h5", directions, normals, **labels))


@pytest.mark.parametrize(
    ("directions", "normals", "labels"),
    [
        ({}, {}, {}),
        ({"right": tilted(3)}, {"right": tilted(183)}, {}),  # a wedge
        ({}, dict.fromkeys(("left", "right", "floor"), (0, 0, 0)), {}),  # no facets are known
        ({"right": (0, 0, 0)}, {}, {}),  # no direction is known
        ({}, {}, {"floor": "floor"}),  # one surface stands for all
        ({}, {}, {"left": "right"}),
    ],
)
def test_walls_that_fit_or_are_not_known_run(directions, normals, labels, tmp_path):
    assert simulate(cavity(tmp_path / "rom.h5", directions, normals, **labels)).status == "ok"


CASE = changed(CLUSTER, ("degree = 2", "degree = 1")).split("[modes]")[0]


def reduced(folder, **directions):
    """File of the shipped cluster's reduced model with coordinates of these directions, by facet group."""
    tables = "".join(f'[interface.{name}]\nfacets = "{name}"\ndirection = {way}\n' for name, way in directions.items())
    path = folder / "case.toml"
    path.write_text(CASE + tables)
    model = reduction(assemble(Case.load(path)), 3, "craig-bampton", 0.01)
    model.save(folder / "rom.h5")
    return model


def test_walls_of_the_cluster_along_their_normals(tmp_path):
    """Both walls have the direction of y, whichever way they face, and so run; the record keeps their normals."""
    model = reduced(tmp_path, shroud=[0, 1, 0], c1_left='"normal"', c1_right='"normal"', c1_floor=[0, 2, 0])
    np.testing.assert_allclose(model.directions, [[0, 1, 0]] * 4, atol=1e-12)
    again = ReducedModel.load(tmp_path / "rom.h5")
    np.testing.assert_allclose(again.normals, [[0, 0, -1], [0, 1, 0], [0, -1, 0], [0, 0, 1]], atol=1e-12)
    assert simulate(on_cluster(tmp_path)).status == "ok"


def test_an_outward_normal_of_the_cluster_is_refused(tmp_path):
    reduced(tmp_path, shroud=[0, 1, 0], c1_left=[0, 1, 0], c1_right=[0, -1, 0], c1_floor=[0, 1, 0])
    with pytest.raises(InputError, match=r"cavity\[0\].right: 'c1_right' points against 'c1_left'"):
        simulate(on_cluster(tmp_path))


def test_a_direction_along_the_walls_of_the_cluster_is_refused(tmp_path):
    reduced(tmp_path, shroud=[0, 1, 0], c1_left=[1, 0, 0], c1_right=[1, 0, 0], c1_floor=[1, 0, 0])
    with pytest.raises(InputError, match=r"cavity\[0\].left: 'c1_left' has a direction .* \[0, 1, 0\]"):
        simulate(on_cluster(tmp_path))


def on_cluster(folder):
    return shaken(
        str(folder / "rom.h5"), [{"mass": 0.003}],
        excitation={"frequency": 2450.0, "resonance_amplitude": 3e-5, "at": "shroud"},
        cavity=[{"name": "c0", "gap": 3e-5, "left": "c1_left", "right": "c1_right", "floor": "c1_floor"}],
        contact={"law": "compliant", "stiffness": 1e8},
    )  # fmt: skip


def test_a_group_without_a_normal_is_told(tmp_path):
    with pytest.raises(InputError, match=r"^interface.all.direction: 'all' has no normal"):
        path = tmp_path / "case.toml"
        path.write_text(CASE)
        interface(replace(Case.load(path), interface={"all": InterfaceTable("all", "normal")}), closed_matrices())


def closed_matrices():
    """Matrices of three nodes, whose patch "all" has no normal."""
    unit = sparse.csr_array(np.eye(9))
    return SystemMatrices(unit, unit, np.eye(3), np.array([]), {"all": Patch([0, 1, 2], [1.0, 1.0, 1.0])}, 0.0)
