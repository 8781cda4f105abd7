"""Other programs on the same scenes, each where it is installed; what they cannot express they say."""

from importlib.util import find_spec

import numpy as np
import pytest

from benchmarks.bodies.methods import block_scene
from benchmarks.methods import peers
from benchmarks.methods import scenes as method_scenes
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.files.toml_input import InputError, validate

PERIODS, SAMPLES = 3, 10


@pytest.fixture(scope="module")
def periodic():
    """Two impacts per period, and the exact samples."""
    scene = method_scenes.periodic(1000).replace({"time.periods": PERIODS, "time.transient": 0})
    exact = simulate(scene, samples_per_period=SAMPLES)
    return scene, np.column_stack([exact.displacement, exact.body_displacement])


def needs(name):
    package = peers.PEERS[name].needs.partition(".")[0]
    if find_spec(package) is None:
        pytest.skip(f"{name} is not installed: {peers.PEERS[name].remedy}")


def error(periodic, name, setting):
    scene, exact = periodic
    run = peers.run_peer(name, scene, PERIODS, setting, SAMPLES)
    assert run.status == "ok" and run.seconds > 0 and len(run.peak) == PERIODS
    return (np.abs(run.samples - exact) / np.ptp(exact, axis=0)).max()


@pytest.mark.parametrize(
    ("name", "coarse", "fine", "bound"),
    [
        ("SUNDIALS CVODE", 1e-4, 1e-9, 1e-5),
        ("heyoka", 1e-4, 1e-10, 1e-10),
        ("Exudyn", 300, 10_000, 2e-2),
        ("Siconos", 100, 3000, 5e-3),
    ],
)
def test_peers_converge_to_the_exact_engine(periodic, name, coarse, fine, bound):
    needs(name)
    assert error(periodic, name, fine) < min(bound, 0.5 * error(periodic, name, coarse))


def test_siconos_and_our_own_time_stepping_are_one_method(periodic):
    """Both are Moreau-Jean's with theta = 1/2: the same impacts in the same steps."""
    needs("Siconos")
    scene, exact = periodic
    ours = simulate(method_scenes.by(scene, method="moreau", steps_per_period=500), samples_per_period=SAMPLES)
    theirs = peers.run_peer("Siconos", scene, PERIODS, 500, SAMPLES)
    size = np.ptp(exact, axis=0)
    apart = np.abs(theirs.samples - np.column_stack([ours.displacement, ours.body_displacement])) / size
    assert apart.max() < 1e-3
    assert theirs.penetration == pytest.approx(ours.penetration, rel=0.05)


@pytest.mark.parametrize(
    ("name", "setting"), [("Exudyn", 500), ("Siconos", 500), ("SUNDIALS CVODE", 1e-6), ("heyoka", 1e-6)]
)
def test_friction_and_bodies_in_one_cavity(name, setting):
    """Two bodies with friction over the first periods, before chaos parts the runs."""
    needs(name)
    scene = method_scenes.double().replace({"time.periods": 2, "time.transient": 0})
    run = peers.run_peer(name, scene, 2, setting)
    np.testing.assert_allclose(run.peak, simulate(scene).peak, rtol=5e-3)


@pytest.mark.parametrize(
    ("name", "setting"), [("Exudyn", 500), ("Siconos", 500), ("SUNDIALS CVODE", 1e-6), ("heyoka", 1e-6)]
)
def test_an_excitation_with_several_harmonics(name, setting):
    needs(name)
    harmonic = [{"order": 1, "amplitude": 0.8, "phase": 25.0}, {"order": 3, "amplitude": 1.3, "phase": -70.0}]
    changes = {"time.periods": 2, "time.transient": 0, "excitation.harmonic": harmonic}
    scene = method_scenes.double().replace(changes)
    run = peers.run_peer(name, scene, 2, setting)
    np.testing.assert_allclose(run.peak, simulate(scene).peak, rtol=1e-2)


@pytest.mark.parametrize(
    ("name", "setting", "bound"), [("Exudyn", 1000, 2e-2), ("SUNDIALS CVODE", 1e-6, 2e-3), ("heyoka", 1e-10, 1e-9)]
)
def test_soft_walls(name, setting, bound, periodic):
    """Exudyn's dashpot pulls until the gap opens, which is another restitution; ours and CVODE's lets go before."""
    needs(name)
    scene = periodic[0].replace({"contact": {"law": "compliant", "stiffness": 1e7}})
    exact = simulate(scene)
    assert exact.impacts_per_period >= 1
    run = peers.run_peer(name, scene, PERIODS, setting)
    assert run.status == "ok"
    np.testing.assert_allclose(run.peak, exact.peak, rtol=bound)


@pytest.mark.parametrize(
    ("make", "periods"), [(method_scenes.chatter, 3), (method_scenes.single, 40), (method_scenes.double, 40)]
)
def test_heyoka_sticks_and_stays_closed_as_the_exact_engine_does(make, periods):
    """A chatter that ends at rest and is launched again; slip and sticking, also of two bodies at once.

    Errors grow with every impact, and fall while a body sticks.
    """
    needs("heyoka")
    scene = make().replace({"time.periods": periods, "time.transient": 0})
    exact = simulate(scene, samples_per_period=SAMPLES)
    samples = np.column_stack([exact.displacement, exact.body_displacement])
    run = peers.run_peer("heyoka", scene, periods, 1e-10, SAMPLES)
    assert run.status == "ok" and exact.impacts_per_period > 1
    assert (np.abs(run.samples - samples) / np.ptp(samples, axis=0)).max() < 1e-6
    np.testing.assert_allclose(run.peak, exact.peak, rtol=1e-6)


def test_heyoka_refuses_friction_dampers(monkeypatch):
    monkeypatch.setitem(peers.PEERS, "heyoka", peers.PEERS["heyoka"]._replace(needs="numpy"))
    scene = method_scenes.single().to_dict() | {"friction_damper": [{"normal_force": 1.0, "friction": 0.1}]}
    with pytest.raises(InputError, match="heyoka: this set-up knows no friction dampers"):
        peers.run_peer("heyoka", validate(Scene, scene, "scene"), 1, 1e-6)


def test_a_soft_wall_is_refused_with_the_reason():
    needs("Siconos")
    scene = method_scenes.single().replace({"contact": {"law": "compliant", "stiffness": 1e8}})
    with pytest.raises(InputError, match="unilateral spring"):
        peers.run_peer("Siconos", scene, 1, 100)


def test_what_is_not_installed_is_said(monkeypatch):
    monkeypatch.setitem(peers.PEERS, "Exudyn", peers.PEERS["Exudyn"]._replace(needs="no_such_module"))
    with pytest.raises(InputError, match="not installed; pip install"):
        peers.run_peer("Exudyn", method_scenes.single(), 1, 100)


def block(start=0.0, **changes):
    """A block that is thrown about its cavity."""
    return block_scene(0, 0.4).replace({"damper.0.position": start} | changes)


def test_siconos_and_our_own_time_stepping_move_a_block_alike():
    """One scheme, but contacts of its own geometry and a solver of its own, to that solver's tolerance."""
    needs("Siconos")
    scene = block()
    ours = simulate(method_scenes.by(scene, method="moreau", steps_per_period=1000), samples_per_period=SAMPLES)
    theirs = peers.run_peer("Siconos", scene, 2, 1000, SAMPLES)
    samples = np.column_stack([ours.displacement, ours.body_displacement])
    assert ours.impacts_per_period > 2
    assert (np.abs(theirs.samples - samples) / np.ptp(samples, axis=0)).max() < 1e-4
    assert theirs.penetration == pytest.approx(ours.penetration, rel=1e-3)


def test_siconos_moves_a_block_as_the_exact_engine_does():
    """Medians over starts: where two corners hit almost together, steps part from it at once."""
    needs("Siconos")
    errors = []
    for start in (-4e-6, -2e-6, 0.0, 2e-6, 4e-6):
        scene = block(start)
        exact = simulate(scene, samples_per_period=SAMPLES)
        samples = np.column_stack([exact.displacement, exact.body_displacement])
        theirs = peers.run_peer("Siconos", scene, 2, 10_000, SAMPLES).samples
        errors.append((np.abs(theirs - samples) / np.ptp(samples, axis=0)).max())
    assert np.median(errors) < 0.03


def test_bodies_that_a_peer_does_not_take_are_refused(monkeypatch):
    with pytest.raises(InputError, match="Exudyn: this set-up takes sliders"):
        peers.run_peer("Exudyn", block(), 1, 100)
    monkeypatch.setitem(peers.PEERS, "Siconos", peers.PEERS["Siconos"]._replace(needs="numpy"))
    for changes in ({"cavity.c1.rotation": 1.0}, {"damper.0.stiffness": 1e3}):
        with pytest.raises(InputError, match="Siconos: this set-up knows no"):
            peers.run_peer("Siconos", block(**changes), 1, 100)
    two = block().to_dict()
    two["damper"] = [two["damper"][0] | {"position": -1e-5}, two["damper"][0] | {"position": 1e-5}]
    with pytest.raises(InputError, match="one block in one cavity"):
        peers.run_peer("Siconos", validate(Scene, two, "scene"), 1, 100)
