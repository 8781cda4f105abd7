"""Shapes that this file adds, by every method and in the report: a block with chamfered corners, a hexagonal prism."""

import json
import math
import re
from typing import ClassVar

import numpy as np
import pytest

from tests.tools.planar import planar_scene, still_table
from vanedamp.coupling.scene.registration import SHAPES, register
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.shapes.shape import Polygon, common_heights
from vanedamp.coupling.scene.units import unit_of
from vanedamp.coupling.simulation import simulate
from vanedamp.files.extensions import ExtensionError
from vanedamp.files.reference import key_in, schema
from vanedamp.files.toml_input import InputError, validate
from vanedamp.studies.report.page import write_report
from vanedamp.studies.report.results import collect
from vanedamp.studies.report.time_history import TimeHistory


class Chamfered(Polygon):
    """A rectangle whose corners are cut at 45 degrees."""

    measures: ClassVar = {"length": "", "height": "", "chamfer": "legs of the cut at each corner [m]"}

    def corners(self, body):
        a, b, c = body.length / 2, body.height / 2, body.measure("chamfer")
        lower = np.array([(c - a, -b), (a - c, -b), (a, c - b), (a, b - c)])
        return np.vstack([lower, -lower])


class Hexagon(Polygon):
    """A regular hexagon that stands on a side; `radius` is that of its corners."""

    measures: ClassVar = {"radius": ""}

    def corners(self, body):
        angle = np.radians([240, 300, 0, 60, 120, 180])
        return body.radius * np.column_stack([np.cos(angle), np.sin(angle)])


@pytest.fixture(scope="module", autouse=True)
def registered():
    """Both shapes, for the tests of this file only."""
    register(Chamfered, "chamfered")
    register(Hexagon, "hexagon")
    yield
    del SHAPES.parts["chamfered"], SHAPES.parts["hexagon"]
    unit_of.cache_clear()


G, FALL, TILT, MASS, E = 9.81, 1e-4, 2e-3, 0.7, 0.6
SHAPES_OF = {
    "chamfered": {"shape": "chamfered", "length": 0.02, "height": 0.012, "chamfer": 0.002},
    "hexagon": {"shape": "hexagon", "radius": 0.01},
}
#: corners that meet the floor, of a body that is tilted against the clock, and their distance along from the centre
LANDS = {"chamfered": (0, 0.008), "hexagon": (0, 0.005)}
METHODS = {
    "exact": ({"method": "exact"}, 1e-9),
    "moreau": ({"method": "moreau", "steps_per_period": 40000}, 2e-3),
    "solve_ivp": ({"method": "solve_ivp", "rtol": 1e-9, "steps_per_period": 2000}, 1e-6),
}


def dropped(shape, solver, periods=1, **more):
    """A body that falls, tilted, on a table at rest: it lands on one corner first."""
    body = SHAPES_OF[shape] | {"mass": MASS, "restitution": E, "lift": FALL, "tilt": TILT} | more
    table = still_table(40.0) | {"solver": solver | {"linearisation": 1.0}}
    return planar_scene(table, body, periods=periods, gap=1e-3, play=1e-3)


def inertia(shape):
    """Moments of inertia by textbook formulas: a rectangle less four triangles; a regular hexagon, 5/12 m R^2."""
    if shape == "hexagon":
        return 5 / 12 * MASS * 0.01**2
    length, height, c = 0.02, 0.012, 0.002
    area, cut = length * height, c * c / 2
    x, y = length / 2 - c / 3, height / 2 - c / 3
    whole = area * (length**2 + height**2) / 12
    less = 4 * (2 * c**4 / 36 + cut * (x * x + y * y))
    return MASS * (whole - less) / (area - 4 * cut)


@pytest.mark.parametrize("shape", SHAPES_OF)
def test_moment_of_inertia(shape):
    body = dropped(shape, {}).damper[0]
    assert body.moment_of_inertia == pytest.approx(inertia(shape), rel=1e-12)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("shape", SHAPES_OF)
def test_one_impact(shape, method):
    """A corner at a from the centre lands at u: impulse (1 + e) u / (1/m + a^2/I), then -u e at the corner."""
    solver, tolerance = METHODS[method]
    response = simulate(dropped(shape, solver), events=True, samples_per_period=2000)
    first = next(event for event in response.event_list if event.kind == "impact")
    corner, lever = LANDS[shape]
    assert (first.side, first.corner) == ("floor", corner)
    speed, moment = math.sqrt(2 * G * FALL), inertia(shape)
    assert first.time == pytest.approx(speed / G, rel=max(tolerance, 1e-9))
    impulse = (1 + E) * speed / (1 / MASS + lever**2 / moment)
    assert first.impulse == pytest.approx(impulse, rel=tolerance)
    assert (-first.relative_velocity_before, first.relative_velocity_after) == pytest.approx(
        (speed, E * speed), rel=tolerance
    )
    # it turns at impulse * lever / moment until another corner lands
    tilt, time = response.in_plane.body_tilt[:, 0], response.time
    second = next(event.time for event in response.event_list if event.kind == "impact" and event.corner != corner)
    free = (time > first.time * 1.05) & (time < 0.95 * second)
    again = [event for event in response.event_list if event.kind == "impact" and first.time < event.time < second]
    assert not again and free.sum() > 2
    rate = np.polyfit(time[free], tilt[free], 1)[0]
    assert rate == pytest.approx(-impulse * lever / moment, rel=max(tolerance, 1e-6))


def corner_gaps(scene, response):
    """Gaps (n, 4, corners) of all corners to left wall, right wall, floor and ceiling, from the body's coordinates."""
    body, cavity, plane = scene.damper[0], scene.cavity[0], response.in_plane
    corners = body.form.corners(body)
    a, b = np.abs(corners).max(axis=0)
    along, tilt = response.body_displacement[:, :1], plane.body_tilt[:, :1]
    x, y = (
        along + corners[:, 0] - tilt * corners[:, 1],
        plane.body_lift[:, :1] + b + corners[:, 1] + tilt * corners[:, 0],
    )
    return np.stack([x + a + cavity.gap / 2, a + cavity.gap / 2 - x, y, 2 * b + cavity.play - y], axis=1)


SHAKEN = {
    "structure": {"model": "rigid", "mass": 20.0, "stiffness": 8e5, "damping_ratio": 0.01},
    "excitation": {"frequency": 31.0, "force": 60.0}, "initial": {"velocity": 0.2},
    "solver": {"linearisation": 1.0},
}  # fmt: skip


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("shape", SHAPES_OF)
def test_no_corner_gets_through_and_no_energy_is_lost(shape, method):
    body = SHAPES_OF[shape] | {"mass": 0.3, "friction": 0.2, "restitution": E, "tilt": TILT, "lift": 2e-4}
    solver = METHODS[method][0] | {"linearisation": 1.0}
    solver |= {"exact": {}, "moreau": {"steps_per_period": 4000}, "solve_ivp": {"steps_per_period": 400}}[method]
    scene = planar_scene(SHAKEN | {"solver": solver}, body, periods=2, gap=2e-3, play=1e-3)
    response = simulate(scene, events=True, samples_per_period=200)
    struck = {event.side for event in response.event_list if event.kind == "impact"}
    assert struck >= {"left", "right", "floor"}
    slack = {"exact": 1e-12, "moreau": 3e-2, "solve_ivp": 1e-7}[method]
    assert corner_gaps(scene, response).min() > -slack * 1e-3
    ledger = {"exact": 1e-10, "moreau": 1e-10, "solve_ivp": 1e-6}[method]
    assert abs(response.energy_residual) < ledger


def test_neighbours_touch_at_the_heights_that_both_have():
    hexagon, block = SHAPES_OF["hexagon"], {"shape": "block", "length": 0.01, "height": 0.03}
    scene = planar_scene(still_table(), hexagon | {"mass": 1.0}, block | {"mass": 1.0})
    faces = [body.form.face(body) for body in scene.damper]
    assert common_heights(*faces) == pytest.approx((0.01 * math.sin(math.radians(60)),), rel=1e-12)


def test_the_report_draws_its_outline(tmp_path):
    """Every corner is drawn where it is: gaps to the walls as drawn are those of the coordinates."""
    body = SHAPES_OF["chamfered"] | {"mass": 0.3, "friction": 0.2, "restitution": E, "tilt": TILT}
    scene = planar_scene(SHAKEN, body, periods=4, gap=2e-3, play=1e-3)
    response = simulate(scene, events=True, samples_per_period=60)
    response.save(tmp_path / "run.h5", {"scene": scene.to_dict()})
    history = TimeHistory.load(tmp_path / "run.h5")
    motion = history.motion()
    (cavity,) = motion.cavities
    outline, unit = cavity.bodies[0].outline, motion.factor * motion.scale
    assert outline.shape[1] == 8
    gaps = corner_gaps(scene, response)[-len(outline) :]
    far, low = [7, 6], [0, 1]
    np.testing.assert_allclose(outline[:, far, 0] - cavity.left[:, :1], unit * gaps[:, 0, far], atol=1e-9 * unit)
    np.testing.assert_allclose(outline[:, low, 1], unit * gaps[:, 2, low], atol=1e-9 * unit)
    places = {(place.side, place.corner): place.place for place in history.by_place}
    assert places["left", 7] == "left wall<br>corner 7"
    write_report(collect([tmp_path / "run.h5"]), tmp_path / "report.html")
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    data = json.loads(re.search(r'<script type="application/json">(.*?)</script>', page, flags=re.DOTALL)[1])
    drawn = data["cavities"][0]["bodies"][0]
    assert not drawn["round"] and {len(points) for points in drawn["outline"]} == {16}


def test_keys_of_a_shape_are_read_written_and_described():
    scene = dropped("chamfered", {})
    assert validate(Scene, scene.to_dict(), "again") == scene
    assert scene.to_dict()["damper"][0]["chamfer"] == 0.002
    assert scene.replace({"damper.0.chamfer": 0.001}).damper[0].measure("chamfer") == 0.001
    damper = schema(Scene)["$defs"]["Damper"]
    assert key_in(damper, "chamfer") == {
        "description": "legs of the cut at each corner [m]", "exclusiveMinimum": 0, "type": "number", "x-unit": "m",
    }  # fmt: skip
    assert {"hexagon", "chamfered"} <= set(key_in(damper, "shape")["enum"])


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"damper.0.chamfer": None}, 'damper[0]: chamfer: missing of shape = "chamfered"'),
        ({"damper.0.chamfer": -1.0}, "damper[0].chamfer: should be greater than 0"),
        ({"damper.0.radius": 1e-3}, 'damper[0]: radius: not a measure of shape = "chamfered"'),
        ({"damper.0.shape": "block"}, 'damper[0]: chamfer: not a measure of shape = "block"'),
        ({"damper.0.shape": "octagon"}, "damper[0].shape: should be 'slider', 'block', 'disc', 'auto', 'chamfered' or"),
    ],
)
def test_refused(changes, message):
    with pytest.raises(InputError, match=re.escape(message)):
        dropped("chamfered", {}).replace(changes)


def test_names_are_taken_once():
    with pytest.raises(ExtensionError, match="there is a shape named block already"):
        register(Hexagon, "block")
    with pytest.raises(ExtensionError, match="is no shape: lacks extended, corners, points"):
        SHAPES.register("nothing", dict)
    register(Hexagon, "hexagon")
    assert SHAPES.part("hexagon") is Hexagon
