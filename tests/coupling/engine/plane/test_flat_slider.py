"""A block that lies flat is a slider whose centre is half its height above the floor, in cavities that turn too."""

import numpy as np
import pytest
from scipy.linalg import eigh

from tests.coupling.system.test_surfaces import FOUR, HEIGHT, cavity_scene, rigid_cavity
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.coupling.system.assembly import assemble
from vanedamp.coupling.system.line_system import line_system
from vanedamp.coupling.system.linear_response import linear_response, linear_responses
from vanedamp.coupling.system.system import BODY, FLOOR, LEFT, RIGHT
from vanedamp.files.toml_input import validate

MASS, STIFFNESS, AMPLITUDE = 0.15696, 3.6046e7, 7e-5
NATURAL = np.sqrt(STIFFNESS / MASS) / (2 * np.pi)
TURNS = -16.4


def rigid_scene(*bodies, periods=60, gravity=3e4, **cavity):
    """The paper's oscillator with bodies in a cavity that turns."""
    return validate(Scene, {
        "structure": {"model": "rigid", "mass": MASS, "stiffness": STIFFNESS, "damping_ratio": 0.002},
        "excitation": {"frequency": 0.995 * NATURAL, "resonance_amplitude": AMPLITUDE, "resonance_near": NATURAL},
        "gravity": {"acceleration": gravity},
        "cavity": [{"name": "c1", "gap": 0.5 * AMPLITUDE, "play": 2e-4, "rotation": TURNS} | cavity],
        "damper": list(bodies), "initial": {"velocity": 0.53}, "time": {"periods": periods, "transient": 0},
    }, "scene")  # fmt: skip


def body(shape="slider", **changes):
    own = {"cavity": "c1", "mass": 0.02 * MASS, "friction": 0.3, "restitution": 0.4, "shape": shape, "height": 3.5e-3}
    return own | ({"length": 6.88e-3} if shape == "block" else {}) | changes


def as_sliders(scene):
    """The scene with its blocks as sliders of their heights."""
    plain = dict.fromkeys(("length", "inertia", "lift", "tilt"))
    bodies = [
        {key: value for key, value in item.items() if key not in plain} | {"shape": "slider"}
        for item in scene.to_dict()["damper"]
    ]
    return scene.replace({"damper": bodies})


def flat_motions(system, modes):
    """Coordinates (N, modes + bodies) of blocks that lie flat: their places are free, their tilts the cavity's."""
    lying = np.zeros((len(system.mass), modes + len(system.along)))
    lying[:modes, :modes] = np.eye(modes)
    for b, x in enumerate(system.along):
        lying[x, modes + b] = 1.0
        lying[x + 1, :modes], lying[x + 2, :modes] = system.rise[b, :modes], system.turn[b, :modes]
    return lying


def two_blocks():
    others = {"normal_motion": 0.3}
    return rigid_scene(body("block", position=-4e-6), body("block", height=6e-3, position=4e-6), **others)


def rigid_blocks(tmp_path, surfaces):
    """A block on a reduced model that moves along, across and turns."""
    return cavity_scene(rigid_cavity(tmp_path / "rom.h5"), surfaces)


@pytest.mark.parametrize("kind", ["two on one mode", "one label", "four patches"])
def test_rows_of_a_flat_block_are_those_of_the_slider(tmp_path, kind):
    """Gaps of all its corners at a wall, slips of both lower ones; mass but for its rotation and motion across."""
    surfaces = {"floor": "all"} if kind == "one label" else FOUR
    scene = two_blocks() if kind == "two on one mode" else rigid_blocks(tmp_path, surfaces)
    plane = assemble(scene)
    n, b = plane.modes, plane.bodies
    height = [damper.height for damper in scene.damper]
    # every body as the slider that it is while it lies flat, with neighbours of its own height
    sliders = [
        line_system(assemble(as_sliders(scene).replace({f"damper.{k}.height": own for k in range(b)})))
        for own in height
    ]
    lying = flat_motions(plane, n)
    rows, units = plane.J @ lying, len(plane.J) // 2
    gaps = {LEFT: b, RIGHT: len(sliders[0].J) - 1}
    for unit, surface in enumerate(plane.surface):
        body = plane.body[unit]
        if surface == FLOOR:
            np.testing.assert_allclose(rows[units + unit], sliders[body].J[body], atol=1e-12)
            np.testing.assert_allclose(rows[unit] * (kind != "four patches"), 0.0, atol=1e-12)
        elif surface in gaps:
            np.testing.assert_allclose(rows[unit], sliders[body].J[gaps[surface]], atol=1e-12)
        elif surface == BODY:
            apart = np.r_[0.5 * (height[body + 1] - height[body]) * plane.turn[body, :n], -np.eye(b)[body]]
            apart[n + body + 1] = 1.0
            np.testing.assert_allclose(rows[unit], apart, atol=1e-12)
    floor = np.array([sliders[k].floor[k] for k in range(b)])
    np.testing.assert_allclose(plane.floor[:, :n], floor, atol=1e-14)
    mass = lying.T @ (plane.mass[:, None] * lying) - np.diag(sliders[0].mass)
    inertia, weight = plane.mass[plane.tilt], plane.mass[plane.along]
    own = (plane.turn.T * inertia) @ plane.turn + (plane.rise.T * weight) @ plane.rise
    np.testing.assert_allclose(mass[:n, :n], own[:n, :n], atol=1e-12 * np.abs(mass).max())
    np.testing.assert_allclose(mass[n:], 0.0, atol=1e-15)
    arm = 0.5 * np.array(height)[:, None]
    without = assemble(as_sliders(scene).replace({f"damper.{k}.height": None for k in range(b)}))
    np.testing.assert_allclose(without.floor[:, :n] - floor, arm * plane.turn[:, :n], atol=1e-13)
    assert np.abs(arm * plane.turn[:, :n]).max() > 0.01 * np.abs(floor).max()


@pytest.mark.parametrize("height", [None, HEIGHT])
def test_a_sprung_slider_has_the_arm_too(tmp_path, height):
    slider = {"cavity": "c1", "mass": 0.05, "stiffness": 10.0, "height": height, "friction": 0.2}
    scene = cavity_scene(rigid_cavity(tmp_path / "rom.h5"), FOUR, damper=[slider, slider])
    system = assemble(scene)
    flat = line_system(assemble(scene.replace({f"damper.{k}.stiffness": None for k in range(2)})))
    in_order = [flat.friction_rows, flat.friction_rows + 1, flat.friction_rows + 2]
    found = {surface: system.J[unit] for unit, surface in enumerate(system.surface[: system.contacts])}
    for surface, row in zip((LEFT, BODY, RIGHT), in_order, strict=True):
        np.testing.assert_allclose(found[surface], flat.J[row], atol=1e-13)
    np.testing.assert_allclose(system.floor[:, : flat.modes], flat.floor, atol=1e-14)


def test_the_fixed_body_moves_by_its_arm():
    """Closed form: omega^2 = K / (M + m (1 - theta h/2)^2)."""
    scene = rigid_scene(body())
    moved = 1.0 - TURNS * 3.5e-3 / 2
    mass = linear_response(assemble(scene), True).mass[0, 0]
    assert mass == pytest.approx(1.0 + 0.02 * moved**2, rel=1e-12)
    natural = linear_responses(scene)[1].resonances()[0][0]
    expected = np.sqrt(eigh([[STIFFNESS]], [[MASS * mass]], eigvals_only=True)[0]) / (2 * np.pi)
    assert natural == pytest.approx(expected, rel=1e-12)


def test_a_block_that_stays_flat_moves_as_the_slider():
    """Pressed down, it sticks and slips; what is left of the difference is its own rotation, and goes with its inertia.

    A slider without a height is 12 % off: its floor moves by 2.9 % less.
    """
    with_arm = simulate(rigid_scene(body()))
    assert simulate(rigid_scene(body(height=None))).peak[-1] > 1.02 * with_arm.peak[-1]
    apart = []
    for inertia in (1e-11, 1e-12):
        block = simulate(rigid_scene(body("block", inertia=inertia)))
        assert block.tilt_max[0] < 1e-10
        apart.append(np.abs(block.peak - with_arm.peak).max() / with_arm.peak.max())
    assert apart[0] < 1e-6 and apart[1] < 0.2 * apart[0]


def test_impacts_of_a_flat_block_are_the_sliders():
    """Both corners hit at once. Without friction, as Coulomb's law of several corners has more than one answer."""
    free = {"friction": 0.0, "restitution": 0.6}
    slider = simulate(rigid_scene(body(**free), gravity=2e3, periods=12))
    block = simulate(rigid_scene(body("block", inertia=1e-13, **free), gravity=2e3, periods=12))
    plain = simulate(rigid_scene(body(height=None, **free), gravity=2e3, periods=12))
    assert slider.impacts_per_period > 1.5 and block.tilt_max[0] < 1e-9
    np.testing.assert_allclose(block.peak, slider.peak, rtol=1e-6)
    assert np.abs(plain.peak / slider.peak - 1.0).max() > 5e-3


def test_sliders_of_one_cavity_share_a_height():
    """The mean by mass; the ledger closes, and slips never overlap."""
    scene = rigid_scene(
        body(position=-4e-6, mass=1e-3), body(height=6e-3, position=4e-6, mass=3e-3), gravity=2e3, periods=100
    )
    system = assemble(scene)
    np.testing.assert_allclose(system.floor[:, 0] * np.sqrt(MASS), 1.0 - TURNS * (3.5e-3 + 3 * 6e-3) / 8, rtol=1e-12)
    response = simulate(scene)
    assert response.status in ("ok", "not_steady") and abs(response.energy_residual) < 1e-10
    assert response.impacts_per_period > 0.5
    assert np.all(np.diff(response.slip, axis=1) >= -1e-12 * scene.cavity[0].gap)
