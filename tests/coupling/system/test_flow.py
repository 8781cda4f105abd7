"""The flow of the states of units, and linear references as states of it, against tests/reference/flows.py."""

import numpy as np
import pytest

from tests.reference.flows import flow as reference
from tests.tools.sensitive_scenes import KINDS, scene_of
from vanedamp.coupling.derivatives.dynamics import ScaledDynamics
from vanedamp.coupling.derivatives.frame import Frame
from vanedamp.coupling.engine.backends import engine_run
from vanedamp.coupling.numerics import codes
from vanedamp.coupling.response.records import new_records
from vanedamp.coupling.response.restart import start_of
from vanedamp.coupling.response.segment import Walk
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.system.assembly import assemble
from vanedamp.coupling.system.linear_modes import linear_systems
from vanedamp.coupling.system.linear_response import linear_responses
from vanedamp.files.toml_input import validate

#: of rows that nearly depend on each other the shared flow has the square of the condition
ROUND_OFF = 1e-11
PERIODS, MOST_EVENTS = 4, 20000


@pytest.mark.parametrize("seed", range(len(KINDS)), ids=KINDS)
def test_generators_and_forces_of_every_state_that_a_run_meets(seed, tmp_path):
    _, scene = scene_of(seed, tmp_path)
    frame = Frame(scene)
    dynamics, system = ScaledDynamics(frame, frame.sizes()), frame.system
    run = engine_run(system, start_of(scene, system), new_records(system, PERIODS, 0), True, MOST_EVENTS)
    met = {segment.state.tobytes() + segment.open_force.tobytes(): segment for segment in Walk(run, PERIODS)}
    assert met
    for segment in met.values():
        flow = dynamics.flow(segment.state, segment.open_force)
        X, forces = reference(system, segment.state, segment.open_force)
        # in units of energy: every entry has the order of the frequencies
        for found, exact in ((flow.X, dynamics.per[:, None] * X / dynamics.per), (flow.forces, forces / dynamics.per)):
            np.testing.assert_allclose(found, exact, rtol=0.0, atol=ROUND_OFF * (np.abs(exact).max() or 1.0))


@pytest.mark.parametrize("state", [codes.SLIP_RIGHT, codes.STICK])
@pytest.mark.parametrize("seed", [2, 3, 10, 11, 40, 43, 65])
def test_linear_references_are_states_of_one_flow(seed, state, tmp_path):
    """Without bodies all contacts are open and all floors slip; with bodies fixed all floors stick."""
    _, scene = scene_of(seed, tmp_path)
    system = assemble(scene)
    u, size, fixed = len(system.rest), len(system.mass), int(state == codes.STICK)
    states = np.where(np.arange(u) < system.contacts, codes.OPEN, state)
    X = reference(system, states, np.zeros(2 * u))[0]
    own = X[: 2 * size, : 2 * size]
    values, decays = np.linalg.eigvals(own), -linear_systems(scene, system)[fixed][0].value
    np.testing.assert_allclose(
        np.sort(-values.real[values.imag > 1.0]), np.sort(decays.real[decays.imag > 1.0]), rtol=1e-9
    )
    if not scene.friction_damper:  # whose springs are no bodies
        cosine, sine = 2 * size + 1, 2 * size + 1 + len(system.frequency)
        force = X[: 2 * size, cosine] - 1j * X[: 2 * size, sine]
        wave = np.linalg.solve(1j * system.omega * np.eye(2 * size) - own, force)[: system.modes]
        np.testing.assert_allclose(linear_responses(scene, system)[fixed].motion(scene.frequency)[0], wave, rtol=1e-10)


def test_a_disc_that_rolls_freely_is_not_there():
    """Beside a body on a spring, too: the structure with the latter alone is the loose system."""
    data = {
        "structure": {"model": "rigid", "mass": 1.0, "stiffness": 4e5, "damping_ratio": 0.01},
        "excitation": {"frequency": 100.0, "force": 1.0},
        "cavity": [{"name": name, "gap": 1e-3, "play": 1e-3} for name in ("a", "b")],
        "damper": [
            {"cavity": "a", "mass": 0.05, "stiffness": 2e4, "dashpot": 1.0},
            {"cavity": "b", "mass": 0.3, "shape": "disc", "radius": 0.01, "friction": 0.3},
        ],
    }
    both = validate(Scene, data, "both")
    alone = validate(Scene, data | {"cavity": data["cavity"][:1], "damper": data["damper"][:1]}, "alone")
    found, exact = (linear_systems(scene, assemble(scene))[0][0] for scene in (both, alone))
    for name in ("mass", "damping", "stiffness", "value"):
        np.testing.assert_allclose(getattr(found, name), getattr(exact, name), rtol=1e-12)
