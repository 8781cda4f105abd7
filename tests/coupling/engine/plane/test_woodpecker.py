"""The woodpecker toy: a sleeve with play on a pole, a bird on a spring, and three contacts with friction.

Pfeiffer (1984); the model and its parameters by Glocker (Glocker and Studer 2005; Leine, van Campen and Glocker 2003),
built from rows here: scenes have no such structure.
"""

import numpy as np
import pytest

from tests.tools.planar import Run, ledger
from vanedamp.coupling.response.records import IMPACT, new_records
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.response.restart import state_at
from vanedamp.coupling.system.assembly import Coordinates
from vanedamp.coupling.system.system import LEFT, RIGHT, System

SLEEVE, BIRD = (3e-4, 5e-9), (4.5e-3, 7e-7)  # mass, moment of inertia: kg, kg m^2
L_M, L_G, L_S, R_M, R_0, H_M, H_S = 0.01, 0.015, 0.0201, 0.0031, 0.0025, 0.0058, 0.02  # m
SPRING, MU, BEAK, G = 0.0056, 0.3, 0.5, 9.81  # N m/rad, friction, restitution of the beak, m/s^2
#: between two records, s
RECORDED = 0.05


def woodpecker():
    """The engine's system and the root L of the mass matrix: coordinates z = L^T (height, sleeve's, bird's angle)."""
    (m, j), (bird, inertia) = SLEEVE, BIRD
    arm = np.array([1.0, L_M, L_G])
    root = np.linalg.cholesky(np.diag([m, j, inertia]) + bird * np.outer(arm, arm))
    turned = np.linalg.inv(root)
    normal = np.array([[0.0, 0.0, -H_S], [0.0, H_M, 0.0], [0.0, -H_M, 0.0]])
    slip = np.array([[1.0, L_M, L_G - L_S], [1.0, R_M, 0.0], [1.0, R_M, 0.0]])
    J = np.vstack([normal, slip]) @ turned.T
    weight = turned @ (-G * (m * np.array([1.0, 0.0, 0.0]) + bird * arm))
    twist = turned @ np.array([0.0, 1.0, -1.0])
    one, three = np.zeros((1, 3)), np.zeros(3)
    system = System(
        in_plane=True,
        modes=0, bodies=1, contacts=3, scale=1.0, mass=np.ones(3), squares=np.zeros(0), viscous=np.zeros((0, 0)),
        alike=True, omega=2 * np.pi / RECORDED, other=np.full(3, -1), holds=np.zeros(1), casing=np.zeros((0, 3)),
        grip=np.zeros(0), casing_spring=np.zeros(0), stiffness=SPRING * np.outer(twist, twist),
        damping=np.zeros((3, 3)),
        load=one.astype(complex), weight=weight, response=turned.T[0].copy(), table=np.zeros(1, complex),
        frequency=np.array([2 * np.pi / RECORDED]), period=RECORDED,
        speed=float((np.abs(J) @ np.abs(weight)).max() * RECORDED), J=J,
        rest=np.array([L_M + L_G - L_S - R_0, R_M - R_0, R_M - R_0]), delassus=J @ J.T, friction=np.full(3, MU),
        limit=three, restitution=np.array([BEAK, 0.0, 0.0]), restitution_at=0,
        spring=np.full(3, np.inf), dashpot=np.zeros(3), tangential=np.zeros(0), elongation=np.zeros((0, 3)),
        two_phases=False, moment=1e-6 * RECORDED,
        play=np.full(3, 2 * (R_M - R_0)), slider=np.full(3, -1),
        body=np.zeros(3, np.int64), surface=np.array([LEFT, LEFT, RIGHT]), corner=np.array([-1, 0, 1]),
        along=np.zeros(1, np.int64), tilt=np.full(1, 2), floor=one, turn=one, rise=one, height=np.zeros(1),
        cavity=np.zeros(1, np.int64), neglected=np.zeros(1),
    )  # fmt: skip
    return system, root


def test_its_limit_cycle_takes_146_ms():
    """In each cycle the beak hits once; friction and impacts take the weight's work."""
    system, root = woodpecker()
    # near the limit cycle, as the sleeve's lower edge has come to the pole
    q, v = np.array([0.0, -(R_M - R_0) / H_M, -0.2788]), np.array([-0.3411, 0.0, -7.4583])
    periods = 60
    run = Run(
        system, state_at(system, Coordinates(root.T @ q, root.T @ v)), new_records(system, periods, 0), True, 10**6
    )
    assert run.advance_to(periods) is Status.OK
    impacts = run.events(IMPACT)
    beak = impacts[(impacts[:, 2] == 0) & (impacts[:, 3] < -0.05)]
    cycle = np.diff(beak[:, 0])[-10:]
    assert cycle.mean() == pytest.approx(0.146, rel=0.02)
    np.testing.assert_allclose(cycle, cycle.mean(), rtol=1e-3)
    assert abs(ledger(run)) <= 1e-11 * run.state.ledger[1:5].sum()
