"""What heyoka's callbacks decide, without heyoka: sticking, staying closed and impacts, by hand."""

import numpy as np
import pytest

from benchmarks.methods import scenes
from benchmarks.methods.heyoka_states import Model, States
from vanedamp.coupling.system.assembly import assemble
from vanedamp.coupling.system.line_system import line_system


def states_of(scene):
    model = Model(line_system(assemble(scene)))
    return model, States(model)


def test_rows_are_gaps_over_the_free_travel_and_forces_in_their_units():
    model, _ = states_of(scenes.single())
    system = model.system
    assert (model.rubs, model.hard, model.soft, model.rests) == ([0], [1, 2], [], True)
    np.testing.assert_allclose(model.rest[1:], 0.5)
    q = np.array([1.3e-6, 2.1e-6])
    np.testing.assert_allclose(model.row @ (q / model.size), system.J @ q / model.length)
    # a unit of force opens a contact with a unit of acceleration, and friction's is its limit
    np.testing.assert_allclose(np.einsum("rj,rj->r", model.row, model.push)[1:], 1.0)
    slip = system.limit[0] * system.delassus[0, 0] / (model.length * system.omega**2)
    assert model.row[0] @ model.push[0] == pytest.approx(slip)


def test_body_sticks_until_the_structure_accelerates_too_fast():
    model, states = states_of(scenes.single())
    z = model.extended(np.zeros(4), 0.0)
    (force,) = states.decide(z).values()
    # without slip, the body's force is its mass times the floor's acceleration
    floor = states.accelerations[0] @ z
    body = states.accelerations[1] @ z
    assert model.row[0, 0] * floor + model.row[0, 1] * body == pytest.approx(0.0, abs=1e-15)
    assert abs(force @ z) < 1 and states.slips == {0: 0.0}
    # bound and displacement of the floor at which its spring alone would need it
    far = np.zeros(4)
    far[0] = 2 / abs(force[0])
    z = model.extended(far, 0.0)
    assert states.decide(z) == {}
    assert states.slips[0] == -np.sign(force @ z)
    assert model.row[0] @ (states.accelerations @ z) * states.slips[0] > 0


def test_two_bodies_that_reach_the_bound_together_slip_together():
    model, states = states_of(scenes.double())
    assert model.rubs == [0, 1]
    force = states.decide(model.extended(np.zeros(6), 0.0))
    far = np.zeros(6)
    far[0] = (1 + 1e-6) / min(abs(factors[0]) for factors in force.values())
    states.decide(model.extended(far, np.pi))
    assert states.slips[0] == states.slips[1] != 0.0


def test_ball_at_rest_is_pushed_until_the_plate_falls_faster_than_it():
    model, states = states_of(scenes.chatter())
    at_rest = np.array([-model.rest[1], 0.0])
    states.closed.add(1)
    (force,) = states.decide(model.extended(at_rest, 0.0)).values()
    weight = model.free[0, -1]
    np.testing.assert_allclose(force @ model.extended(at_rest, 0.0), -weight)
    # the plate's acceleration is that of the load
    shaken = np.hypot(*model.free[0, 2:4])
    assert shaken > -weight
    angle = np.arcsin(-weight / shaken)
    assert states.decide(model.extended(at_rest, angle - 1e-3)).keys() == {1}
    assert states.decide(model.extended(at_rest, angle + 1e-3)) == {} and not states.closed


def test_impacts_follow_newtons_law_and_a_chatter_ends():
    model, states = states_of(scenes.chatter())
    states.decide(model.extended(np.array([-model.rest[1], -1e-3]), 0.0))
    for speed, rebound, closed in ((-1e-3, 5e-4, set()), (-1e-8, 0.0, {1})):
        z = model.extended(np.array([-model.rest[1], speed]), 0.0)
        assert speed + states.collide(1, z)[0] == pytest.approx(rebound, abs=1e-18)
        assert states.closed == closed


def test_impact_against_a_body_that_rests_at_the_wall():
    """The wall takes the impulse of the resting body at once: the other one rebounds as from a wall."""
    model, states = states_of(scenes.double())
    system = model.system
    (inner,) = (row for row in model.hard if system.left_body[row] >= 0 and system.right_body[row] >= 0)
    wall = next(row for row in model.hard if system.left_body[row] < 0)
    states.closed.add(wall)
    rate = np.zeros(3)
    rate[system.modes + system.right_body[inner]] = -0.2
    after = rate + states.collide(inner, model.extended(np.r_[np.zeros(3), rate], 0.0))
    assert model.row[wall] @ after == pytest.approx(0.0, abs=1e-15)
    assert model.row[inner] @ after == pytest.approx(-system.restitution[inner] * (model.row[inner] @ rate))
    assert states.closed == {wall}
