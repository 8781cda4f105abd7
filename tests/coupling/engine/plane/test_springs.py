"""Corners, discs and faces on springs: closed forms, the rigid limit, brute force by DOP853, laws event by event."""

import math
import tomllib

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from tests.rom.test_massless import TIP, rod_scene
from tests.tools.input_files import SCENE
from tests.tools.periodic_scenes import scene_of
from tests.tools.planar import initial_motion, ledger, open_run, planar_run, planar_scene, run_planar, still_table
from tests.tools.planar_laws import LIMITS, check_laws, laws_of, tables
from tests.tools.small_structures import rod, truss
from tests.tools.tiers import cases, seeds
from vanedamp.coupling.numerics.codes import DONE, EVENT_BUDGET
from vanedamp.coupling.response.records import CONTACT, DETACHES, FRICTION, IMPACT, IMPACT_LOSS, SLIPS, STICKS
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.scene.contact_laws.compliant import damping_ratio
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.coupling.system.modal_basis import basis_of
from vanedamp.files.toml_input import InputError, validate
from vanedamp.rom.interface import Interface, InterfaceCoordinate
from vanedamp.rom.reduction import reduce

G, K, MASS = 9.81, 2e5, 1.3
DISC = {"shape": "disc", "radius": 0.01, "mass": MASS}


def springs(stiffness=K, frequency=20.0, gravity=G, **table):
    return still_table(frequency, gravity=gravity, **table) | {"contact": {"law": "compliant", "stiffness": stiffness}}


def contact_of(mass, stiffness, dashpot, gravity, speed):
    """Duration of a contact that begins at a speed (m/s), and the speed at its end, where the force vanishes."""
    omega, sag = math.sqrt(stiffness / mass), mass * gravity / stiffness
    ratio = dashpot / (2 * mass * omega)
    turn = omega * math.sqrt(1 - ratio**2)

    def motion(t):
        decay, sine, cosine = math.exp(-ratio * omega * t), math.sin(turn * t), math.cos(turn * t)
        b = (-speed + ratio * omega * sag) / turn
        shift = decay * (sag * cosine + b * sine)
        rate = -ratio * omega * shift + turn * decay * (-sag * sine + b * cosine)
        return shift - sag, rate

    force = lambda t: -stiffness * motion(t)[0] - dashpot * motion(t)[1]  # noqa: E731
    end = brentq(force, 0.3 * math.pi / turn, 1.2 * math.pi / turn, xtol=1e-18, rtol=1e-15)
    return end, motion(end)[1]


@pytest.mark.parametrize("restitution", [0.5, 0.8, 1.0])
@pytest.mark.parametrize("shape", ["disc", "block"])
def test_a_body_that_falls_on_springs(shape, restitution):
    """A disc on one spring, a block that lies flat on two, each with the dashpot of a corner that hits on its own."""
    drop, half = 1e-3, 0.01
    block = {"shape": "block", "length": 2 * half, "height": 0.04, "mass": MASS}
    body = (DISC if shape == "disc" else block) | {"friction": 0.3, "restitution": restitution, "lift": drop}
    run = planar_run(springs(), body, periods=1)
    number, own = (1, MASS) if shape == "disc" else (2, MASS / (1 + 3 * half**2 / (half**2 + 0.02**2)))
    dashpot = 2 * damping_ratio(restitution) * math.sqrt(K * own)
    speed = math.sqrt(2 * G * drop)
    duration, after = contact_of(MASS, number * K, number * dashpot, G, speed)
    begin, end = run.events(IMPACT)[0], run.events(DETACHES)[0]
    assert begin[0] == pytest.approx(speed / G, rel=1e-12)
    assert end[0] - begin[0] == pytest.approx(duration, rel=1e-9)
    assert end[4] == pytest.approx(after, rel=1e-9)
    # each spring has its share of the momentum and of the weight meanwhile
    assert end[5] == pytest.approx(MASS * (speed + after + G * duration) / number, rel=1e-9)
    assert run.status is Status.OK
    assert abs(ledger(run)) <= 1e-12 * MASS * G * drop
    assert abs(run.state.ledger[IMPACT_LOSS]) <= 1e-12 * MASS * G * drop
    assert abs(run.state.ledger[FRICTION]) <= 1e-12 * MASS * G * drop
    if restitution == 1.0:
        assert abs(run.state.ledger[CONTACT]) <= 1e-12 * MASS * G * drop


@pytest.mark.parametrize("restitution", [0.3, 0.7, 1.0])
def test_a_collision_has_the_restitution_asked_for(restitution):
    body = DISC | {"friction": 0.0, "restitution": restitution, "lift": 1e-4, "lift_velocity": -0.5}
    run = planar_run(springs(gravity=0.0), body, periods=1, events=2)
    assert run.events(DETACHES)[0][4] == pytest.approx(0.5 * restitution, rel=1e-10)


@pytest.mark.parametrize("restitution", [0.6, 1.0])
def test_an_oblique_impact_that_slips_throughout(restitution):
    """The bound of friction follows the spring: the impulses are those of the rigid law, spread over the contact."""
    mu, normal, along, radius = 0.1, 0.4, 0.9, 0.01
    inertia = 0.4 * MASS * radius**2
    sphere = DISC | {
        "inertia": inertia, "friction": mu, "restitution": restitution, "lift": 1e-4, "lift_velocity": -normal,
        "velocity": along,
    }  # fmt: skip
    run = planar_run(springs(gravity=0.0), sphere, periods=1, events=2)
    (end,) = run.events(DETACHES)
    push = MASS * (1 + restitution) * normal
    np.testing.assert_allclose(end[5:7], [push, -mu * push], rtol=1e-10)
    np.testing.assert_allclose(run.state.v[0], along - mu * push / MASS, rtol=1e-10)
    np.testing.assert_allclose(run.state.v[2], -mu * push * radius / inertia, rtol=1e-10)
    lost = 0.5 * (MASS * (along**2 - run.state.v[0] ** 2) - inertia * run.state.v[2] ** 2)
    assert run.state.ledger[FRICTION] == pytest.approx(lost, rel=1e-9)


def test_springs_that_stiffen_come_to_the_rigid_law():
    """The contacts' durations fall with the root of the stiffness, and with them the distance from k = 1."""
    block = {
        "shape": "block", "length": 0.02, "height": 0.01, "mass": MASS, "friction": 0.0, "restitution": 1.0,
        "lift": 3e-4, "velocity": 0.3, "tilt": 2e-4, "tilt_rate": 0.02,
    }  # fmt: skip
    cavity = {"gap": 2e-3, "play": 1e-3}
    rigid = planar_run(still_table(100.0), block, periods=1, **cavity)
    assert len(rigid.events(IMPACT)) >= 4
    reach, errors = np.abs(rigid.system.J).max(axis=0), []
    for stiffness in (1e11, 1e13):
        run = planar_run(springs(stiffness, 100.0), block, periods=1, **cavity)
        assert run.status is Status.OK
        assert len(run.events(IMPACT)) == len(rigid.events(IMPACT))
        errors.append(np.abs((run.state.q - rigid.state.q) * reach).max())
    assert errors[0] <= 0.02 * cavity["gap"]
    assert errors[1] == pytest.approx(0.1 * errors[0], rel=0.2)


def test_a_block_rests_on_its_springs():
    """It begins without force and swings about the weight's sag; its slip waits for the spring's force."""
    block = {"shape": "block", "length": 0.02, "height": 0.01, "mass": MASS, "friction": 0.3, "restitution": 0.4}
    run = planar_run(springs(), block, periods=10)
    assert run.status is Status.OK
    assert run.state.q[1] == pytest.approx(-MASS * G / (2 * K), rel=1e-6)
    assert abs(run.state.q[0]) <= 1e-15
    assert abs(run.state.q[2]) <= 1e-12


def brute_force(system, q, v, span):
    """Coordinates at the end of a span, by DOP853 from change to change of the contacts' states; how often they stick.

    Springs, dashpots and Coulomb's law as they are written down, without the engine's flows and decisions.
    """
    n, u = len(q), len(system.rest)
    normal, slip = system.J[:u], system.J[u:]
    state = {r: "open" for r in range(u)}

    def forces(t, y):
        q, v = y[:n], y[n:]
        would = -(system.spring * (system.rest + normal @ q) + system.dashpot * (normal @ v))
        pushes = np.array([would[r] if state[r] in ("right", "left", "stick") else 0.0 for r in range(u)])
        way = np.array([{"right": 1.0, "left": -1.0}.get(state[r], 0.0) for r in range(u)])
        load = system.weight + (system.load * np.exp(1j * system.frequency * t)[:, None]).real.sum(axis=0)
        load = load - system.stiffness @ q - system.damping @ v
        load = load + normal.T @ pushes - slip.T @ (way * system.friction * pushes)
        held = [r for r in range(u) if state[r] == "stick"]
        # the least of all shares: those of two corners of one block are open
        shares, *_ = np.linalg.lstsq(
            (slip[held] / system.mass) @ slip[held].T, slip[held] @ (load / system.mass), rcond=None
        )
        friction = -shares
        return (load + slip[held].T @ friction) / system.mass, would, dict(zip(held, friction, strict=True))

    def functions():
        made = []
        for r in range(u):
            gap = lambda t, y, r=r: system.rest[r] + normal[r] @ y[:n]  # noqa: E731
            push = lambda t, y, r=r: forces(t, y)[1][r]  # noqa: E731
            if state[r] == "open":
                made.append((gap, -1, r, "closes"))
                continue
            if state[r] == "leaving":
                made += [(gap, 1, r, "opens"), (push, 1, r, "pushes")]
                continue
            made.append((push, -1, r, "parts"))
            if state[r] == "stick":
                for sign in (1.0, -1.0):
                    bound = lambda t, y, r=r, sign=sign: (  # noqa: E731
                        system.friction[r] * forces(t, y)[1][r] - sign * forces(t, y)[2][r]
                    )
                    made.append((bound, -1, r, "left" if sign > 0 else "right"))
            else:
                way = 1.0 if state[r] == "right" else -1.0
                made.append((lambda t, y, r=r, way=way: way * (slip[r] @ y[n:]), -1, r, "stops"))
        for function, direction, _, _ in made:
            function.terminal, function.direction = True, direction
        return made

    t, y, sticks = 0.0, np.r_[q, v], 0
    for _ in range(200):
        made = functions()
        path = solve_ivp(
            lambda t, y: np.r_[y[n:], forces(t, y)[0]], (t, span), y, "DOP853", rtol=1e-12, atol=1e-16,
            events=[function for function, *_ in made],
        )  # fmt: skip
        t, y = path.t[-1], path.y[:, -1]
        if path.status == 0:
            return y, sticks
        (_, _, r, what) = next(each for each, times in zip(made, path.t_events, strict=True) if len(times))
        if what in ("closes", "pushes"):
            state[r] = "right" if slip[r] @ y[n:] > 0 else "left"
        elif what == "parts":
            state[r] = "leaving" if system.dashpot[r] > 0 else "open"
        elif what == "opens":
            state[r] = "open"
        elif what == "stops":
            state[r] = "stick"
            _, would, friction = forces(t, y)
            if abs(friction[r]) > system.friction[r] * would[r]:
                state[r] = "left" if friction[r] > 0 else "right"
            else:
                sticks += 1
        else:
            state[r] = what
    raise AssertionError("too many events")


@pytest.mark.parametrize("restitution", [0.7, 1.0])
@pytest.mark.parametrize(
    "body",
    [
        DISC | {"velocity": 0.05},
        # one corner after the other: were both to stick, their shares of friction would be open
        {"shape": "block", "length": 0.06, "height": 0.012, "mass": MASS, "velocity": -0.03, "tilt": 8e-3},
    ],
)
def test_brute_force_finds_the_same(body, restitution):
    """Between four walls that move, with contacts that slip, stick and slip again."""
    block = body | {"friction": 0.5, "restitution": restitution, "lift": 2e-4, "lift_velocity": -0.1}
    scene = planar_scene(springs(5e5, 50.0, amplitude=1e-4), block, gap=1e-3, play=8e-4)
    start = open_run(scene, 1, 0)
    system = start.system
    q, v = initial_motion(scene, system)
    run = run_planar(scene, 1)
    assert run.status is Status.OK
    expected, sticks = brute_force(system, q, v, system.period)
    assert len(run.events(STICKS)) >= sticks >= 1
    assert len(run.events(SLIPS)) >= 1
    reach = np.abs(system.J).max(axis=0)
    # DOP853 leaves 1e-12 in each of some thousand steps, which contacts multiply
    np.testing.assert_allclose(run.state.q * reach, expected[: len(q)] * reach, rtol=0, atol=1e-7 * 1e-3)
    assert abs(ledger(run)) <= 1e-10 * 0.5 * MASS * 0.1**2


@pytest.mark.parametrize("scenes", cases((3, 12), fast=[3]))
@pytest.mark.parametrize("stiffness", cases([30.0, 1e3, 1e4], fast=[1e3]))
def test_laws(stiffness, scenes):
    worst, ends = laws_of(0, scenes, law={"law": "compliant", "stiffness": stiffness})
    assert sum(ends.values()) <= 1  # undecided: a body whose ringing has died out, and whose slip is round-off
    assert worst.steps >= 66 * scenes


@pytest.mark.slow
@pytest.mark.parametrize("stiffness", [30.0, 1e3, 1e4])
@pytest.mark.parametrize("first", range(10_000, 10_300, 100))
def test_laws_of_hundreds(first, stiffness):
    """Runs that give up, with a status that says so, are fewer than 2 %."""
    worst, ends = laws_of(first, 60, law={"law": "compliant", "stiffness": stiffness})
    assert worst.steps >= 4000
    assert sum(ends.values()) <= 1


def upright(orientation, frequency, stiffness, share=1.0, speed=0.0, periods=10):
    """Figure 9's block, flat at the start, in a cavity on end: its corners at the floor carry nothing."""
    mass, spring, damping, unit = 0.15696, 3.6046e7, 0.002, 7e-5
    body = {"shape": "block", "mass": 0.02 * mass, "length": 6.88e-3, "height": 4.8e-3, "friction": 0.4}
    data = {
        "structure": {"model": "rigid", "mass": mass, "stiffness": spring, "damping_ratio": damping},
        "excitation": {"frequency": frequency, "force": share * 2 * damping * spring * unit},
        "initial": {"velocity": speed * unit * 2 * np.pi * frequency},
        "gravity": {"acceleration": 9.81, "orientation_deg": orientation},
        "contact": {"law": "compliant", "stiffness": stiffness},
    }  # fmt: skip
    return run_planar(
        planar_scene(data, body | {"restitution": 0.7}, periods=periods, gap=0.5 * unit, play=2e-4), periods, 2000
    )


@pytest.mark.parametrize("orientation", [90.0, -90.0])
@pytest.mark.parametrize(("frequency", "stiffness"), [(2300.0, 1e7), (2400.0, 1e8), (2450.0, 1e9)])
@pytest.mark.parametrize("speed", [0.0, 0.5])
def test_a_block_that_stands_upright_and_flat(orientation, frequency, stiffness, speed):
    """Its faces meet the walls as a slider does: what its unloaded corners do is not the last bit's choice."""
    run = upright(orientation, frequency, stiffness, speed=speed)
    assert run.status is Status.OK
    assert abs(run.state.q[3]) <= 1e-9 * 2e-4 / 6.88e-3  # it does not turn
    assert abs(run.state.q[2]) <= 1e-9 * 2e-4
    flowed = np.abs(run.records.ledger[-1]).sum()
    assert abs(ledger(run)) <= 1e-9 * flowed


@pytest.mark.parametrize("off", [1e-9, 1e-6, 1e-3])
def test_a_block_that_stands_as_good_as_upright(off):
    """A weight across the cavity of a billionth of g still has a motion."""
    for orientation in (90.0 - off, -90.0 + off):
        assert upright(orientation, 2400.0, 1e8, speed=0.5).status is Status.OK


@pytest.mark.parametrize("copy", seeds(8, fast=[0, 1, 2]))
def test_contacts_that_lose_their_forces_together(copy):
    """Two contacts end within a millionth of a second: round-off of the second force, which pulls, decides nothing."""
    data = tables(301101) | {"contact": {"law": "compliant", "stiffness": 1e4}}
    for damper in data["damper"]:
        damper["mass"] *= 1 + 3e-14 * copy
    assert check_laws(301101, data=data)[1] in (DONE, EVENT_BUDGET)


@pytest.mark.parametrize("seed", [301221, 301445])
def test_friction_at_its_bound_begins_to_slip(seed):
    """The forces of motion and decision differ by round-off of a stiff spring: their events do not repeat for ever."""
    assert check_laws(seed, law={"law": "compliant", "stiffness": 1e4})[1] in (DONE, EVENT_BUDGET)


def test_a_slip_that_stops_within_the_resolution_of_time(tmp_path):
    """What is left of it, 1.1e-12 of the fastest speed, is rest: the same stop does not repeat for ever."""
    _, scene = scene_of(72, tmp_path)
    assert simulate(scene).status is Status.OK


def alike(slider, planar, count):
    """The first impacts and peaks of two responses are the same."""
    np.testing.assert_allclose(planar.peak[:4], slider.peak[:4], rtol=1e-9)
    first, second = ([e for e in r.event_list if e.kind in ("impact", "detach")][:count] for r in (slider, planar))
    assert len(first) == len(second) == count
    for one, other in zip(first, second, strict=True):
        assert (one.kind, one.damper, one.side) == (other.kind, other.damper, other.side)
        assert one.time == pytest.approx(other.time, rel=1e-10)
        assert one.impulse == pytest.approx(other.impulse, rel=1e-8)
    assert planar.energy_residual < 1e-9


@pytest.mark.parametrize("restitution", [0.6, 1.0])
def test_sliders_on_springs_in_the_plane_are_sliders(restitution):
    """The engine for sliders, and that for the plane, to which a dashpot of zero leads."""
    scene = validate(Scene, tomllib.loads(SCENE), "scene").replace(
        {"sweep": {}, "time": {"periods": 20, "transient": 0}, "damper.restitution": restitution,
         "damper.friction": 0.1, "contact": {"law": "compliant", "stiffness": 1e6}}
    )  # fmt: skip
    alike(*(simulate(s, events=True) for s in (scene, scene.replace({"damper.dashpot": 0.0}))), count=6)


def test_massless_walls(tmp_path):
    """The spring is the residual flexibility of the wall: a slider in both engines."""
    matrices = rod(100, damping_ratio=0.01)
    file = str(tmp_path / "rom.h5")
    reduce(matrices, Interface.on_patches(matrices, TIP), modes=20).save(file)
    scene = rod_scene(file, 4, position=0.1, velocity=0.3)
    alike(*(simulate(s, events=True) for s in (scene, scene.replace({"damper.dashpot": 0.0}))), count=4)


def test_massless_corners(tmp_path):
    """A disc that falls: its walls yield as the cavity's label does, its floor and ceiling as that across it."""
    matrices = truss()
    labels = [InterfaceCoordinate("a", "a", (1, 0, 0)), InterfaceCoordinate("a.normal", "a", (0, 1, 0))]
    model = reduce(matrices, Interface.on_patches(matrices, labels), modes=4)
    file = str(tmp_path / "rom.h5")
    model.save(file)
    data = {
        "structure": {"model": "rom", "file": file, "modes": 4, "natural": True},
        "excitation": {"frequency": 0.2, "force": 1e-3, "at": "a"}, "gravity": {"acceleration": 0.0},
        "contact": {"law": "massless"},
    }  # fmt: skip
    disc = {"shape": "disc", "radius": 0.1, "mass": 0.05, "friction": 0.0, "lift": 0.05, "lift_velocity": -0.3}
    cavity = {"name": "c1", "gap": 0.4, "play": 0.3, "floor": "a"}
    tables = {"cavity": [cavity], "damper": [disc | {"cavity": "c1"}], "time": {"periods": 1, "transient": 0}}
    scene = validate(Scene, data | tables, "scene")
    run = run_planar(scene, 1)
    along, across = (basis_of(scene).flexibility({label: 1.0}) for label in ("a", "a.normal"))
    expected = [1 / along] * 2 + [1 / across] * 2
    np.testing.assert_allclose(run.system.spring[:4], expected, rtol=1e-12)
    assert run.status is Status.OK
    assert len(run.events(DETACHES)) >= 1
    assert abs(run.state.ledger[CONTACT]) <= 1e-12
    assert abs(ledger(run)) <= 1e-12
    with pytest.raises(InputError, match="lacks no flexibility"):
        plain = Interface.on_patches(matrices, labels[:1])
        reduce(matrices, plain, modes=4).save(file)
        run_planar(scene, 1)


def test_slow_modes_beside_a_stiff_contact(monkeypatch):
    """While a stiff contact slips, slow modes have round-off of their own: gaps are off by 1e-12 to 1e-9 plays."""
    monkeypatch.setitem(LIMITS, "penetration", 1e-8)
    worst, code = check_laws(301187, law={"law": "compliant", "stiffness": 1e4})
    assert code in (DONE, EVENT_BUDGET)
    assert worst.motion <= 1e-10
