"""A block in a corner that friction holds: laws leave its forces open, and the least of these turn with the numbers."""

import mpmath as mp
import pytest

import vanedamp as vd
from tests.reference.orbit_numbers import Numbers, derivatives
from tests.tools.closed_form_scenes import scene

#: error allowed, of a derivative or of its result over the number
CLOSE = 1e-10
#: the scene's numbers by their paths; the structure keeps the sign of its velocity (m/s) for the period of 1 s
NUMBERS = {
    "structure.mass": 1.0, "structure.stiffness": 4.0, "structure.damping": 0.1, "excitation.force": 0.2,
    "cavity.c.normal_motion": 0.3, "cavity.c.rotation": 0.4, "damper.0.mass": 0.3, "damper.0.length": 1.0,
    "damper.0.height": 1.5, "damper.0.friction": 0.2, "gravity.acceleration": 10.0, "initial.velocity": -1.0,
}  # fmt: skip
GAP = 0.5


def corner() -> vd.Scene:
    """A cavity that turns with its structure, with a block in its left corner."""
    tables = {table: {} for table in ("structure", "excitation", "cavity", "damper", "gravity", "initial")}
    for path, value in NUMBERS.items():
        table, *_, key = path.split(".")
        tables[table][key] = value
    cavity = tables.pop("cavity") | {"name": "c", "gap": GAP, "play": 0.3}
    block = tables.pop("damper") | {"cavity": "c", "shape": "block", "restitution": 0.3, "position": -0.5 * GAP}
    tables["structure"]["model"], tables["excitation"]["frequency"] = "rigid", 1.0
    tables["gravity"]["orientation_deg"] = 45.0
    return scene(cavity=[cavity], damper=[block], time={"periods": 1, "transient": 0}, **tables)


def after_a_period(n: Numbers) -> Numbers:
    """The structure's state q, q' after a period, and the energy that friction takes.

    The block has both corners at the left wall and stands on the floor with the right one, where it sticks: four rows
    on three motions. The floor is touched away from the wall, which the cavity's rotation moves further: the block rubs
    there. Forces count in units of their rows' lengths.
    """
    M, stiffness, damping, force, across, turn, m, L, H, mu, gravity, velocity = (n[path] for path in NUMBERS)
    way, pull, omega = mp.sign(turn * velocity), gravity / mp.sqrt(2), 2 * mp.pi
    # by q, and the block's x, y and tilt
    inverse = mp.diag([1 / M, 1 / m, 1 / m, 12 / (m * (L**2 + H**2))])
    low, high = mp.matrix([[-1, 1, 0, H / 2]]), mp.matrix([[turn * H - 1, 1, 0, -H / 2]])
    stands = mp.matrix([[-across - turn * L / 2, 0, 1, L / 2]])
    rubs = mp.matrix([[turn * (L + GAP) / 2 - across, 0, 1, -L / 2]])
    rows = stacked(low, high, stands)
    acts = inverse * stacked(low - way * mu * rubs, high - way * mu * rubs, stands, low).T
    unit = mp.diag([1 / (row * inverse * row.T)[0] for row in (low, high, stands, low)])
    mobility = rows * acts
    forces = -unit * mobility.T * mp.inverse(mobility * unit * mobility.T) * rows
    # of z = (q, q', 1, sin(omega t), cos(omega t)): accelerations without contacts, and what moves z
    free, X, power = mp.zeros(4, 5), mp.zeros(5), mp.zeros(5)
    free[0, 0], free[0, 1], free[0, 3] = -stiffness / M, -damping / M, force / M
    free[1, 2] = free[2, 2] = -pull
    X[0, 1], X[3, 4], X[4, 3], X[1, :] = 1, omega, -omega, (free + acts * forces * free)[0, :]
    pressed = forces * free
    power[1, :] = mu * way * turn * GAP / 2 * (pressed[0, :] + pressed[1, :])  # times q'
    # both flows, and the integral of z power z between them (Van Loan 1978)
    both = mp.zeros(10)
    both[:5, :5], both[:5, 5:], both[5:, 5:] = -X.T, power, X
    both, z = mp.expm(both), mp.matrix([0, velocity, 1, 0, 1])
    flow = both[5:, 5:]
    end = flow * z
    return {"place": end[0], "rate": end[1], "friction": (z.T * flow.T * both[:5, 5:] * z)[0]}


def stacked(*rows: mp.matrix) -> mp.matrix:
    return mp.matrix([list(row) for row in rows])


def test_the_least_forces_turn_with_the_numbers():
    values, slopes = derivatives(after_a_period, NUMBERS)
    found = vd.sensitivity(corner(), list(NUMBERS))
    assert (found.status, found.note) == ("ok", "")
    results = {
        "place": (found.state[0], found.state_derivative[0]), "rate": (found.state[1], found.state_derivative[1]),
        "friction": (found.values["energy.friction"], found.derivatives["energy.friction"]),
    }  # fmt: skip
    for name, (value, turns) in results.items():
        assert value == pytest.approx(float(values[name]), rel=CLOSE), name
        for (path, number), turn in zip(NUMBERS.items(), turns.tolist(), strict=True):
            size = abs(float(values[name]) / number)
            assert turn == pytest.approx(float(slopes[path][name]), rel=CLOSE, abs=CLOSE * size), (name, path)
