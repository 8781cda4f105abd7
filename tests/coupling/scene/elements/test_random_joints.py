"""Random scenes with several joints against small steps of an own program."""

import math

import numpy as np
import pytest

import vanedamp as vd
from tests.coupling.scene.elements.test_joint import LABELS, matrices, scene
from tests.tools.tiers import seeds


def random_joints(seed):
    """Joints of any kind between two points and the casing; rigid ones on normals that do not depend on each other."""
    rng = np.random.default_rng((3, seed))
    points = [("a", "b"), ("casing", "b"), ("a", "casing")]
    joints = []
    for number, (first, last) in enumerate(points[k] for k in rng.permutation(3)[: rng.integers(1, 4)]):
        rigid = rng.random() < 0.4 and number < 2
        kind = {"restitution": rng.choice([0.0, 0.6])} if rigid else {"normal_stiffness": 10 ** rng.uniform(4, 6.5)}
        load = {"gap": rng.uniform(0, 5e-4)} if rng.random() < 0.3 else {"preload": rng.uniform(0, 50)}
        normal = [label if label == "casing" else label + "_across" for label in (first, last)]
        friction = rng.choice([0.0, rng.uniform(0.1, 1.0), 3.0])
        joints.append({"between": [first, last], "normal": normal, "friction": friction} | kind | load)
    loads = [(0, rng.uniform(20, 120), 0.0), (int(rng.integers(1, 4)), rng.uniform(5, 60), rng.uniform(0, 360))]
    return joints, loads, rng.uniform(12, 45)


def stepped(structure, joints, loads, frequency, periods, steps):
    """Displacements at the ends of periods by Moreau's steps: velocities at midpoints, impulses by projection."""
    h, omega = 1 / frequency / steps, 2 * math.pi * frequency

    def rows(key):
        signs = np.zeros((len(joints), 4))
        for row, joint in zip(signs, joints, strict=True):
            for sign, label in zip((1.0, -1.0), joint[key], strict=True):
                if label != "casing":
                    row[LABELS[label]] += sign
        return signs

    normal = rows("normal")
    all_rows = np.vstack([normal, rows("between")])
    held = np.linalg.inv(structure.mass + h / 2 * structure.damping + h * h / 4 * structure.stiffness)
    start = structure.mass - h / 2 * structure.damping - h * h / 4 * structure.stiffness
    turned = all_rows @ held @ all_rows.T
    m = len(joints)
    q, v, impulse, found = np.zeros(4), np.zeros(4), np.zeros(2 * m), []
    for step in range(periods * steps):
        force = -structure.stiffness @ q
        for at, size, phase in loads:
            force[at] += size * math.sin(omega * h * (step + 0.5) + math.radians(phase))
        force -= normal.T @ [joint.get("preload", 0.0) for joint in joints]
        free, before = held @ (start @ v + h * force), all_rows @ v
        gaps = normal @ (q + h / 2 * v)
        closed = []
        for k, joint in enumerate(joints):
            stiffness = joint.get("normal_stiffness")
            gap = gaps[k] + joint.get("gap", 0.0) - (joint.get("preload", 0.0) / stiffness if stiffness else 0.0)
            if gap > 0:
                impulse[[k, m + k]] = 0.0
                continue
            closed.append((k, joint["friction"], None if stiffness else joint["restitution"]))
            if stiffness:
                impulse[k] = -stiffness * gap * h
        speeds = all_rows @ free + turned @ impulse
        for _ in range(300 if closed else 0):
            last = impulse.copy()
            for k, friction, restitution in closed:
                for row in (k, m + k):
                    if row == k and restitution is None:
                        continue
                    rebound = restitution * min(before[k], 0.0) if row == k else 0.0
                    wanted = impulse[row] - (speeds[row] + rebound) / turned[row, row]
                    most = friction * impulse[k]
                    wanted = max(wanted, 0.0) if row == k else min(most, max(-most, wanted))
                    speeds += turned[:, row] * (wanted - impulse[row])
                    impulse[row] = wanted
            if np.abs(impulse - last).max() < 1e-9 * h:
                break
        ended = free + held @ all_rows.T @ impulse
        q, v = q + h / 2 * (v + ended), ended
        if (step + 1) % steps == 0:
            found.append(q)
    return np.array(found)


@pytest.mark.parametrize("seed", seeds(40, fast=[0]))
def test_random_joints_against_small_steps(seed):
    """Two periods, before impacts have enlarged the error of a step."""
    structure, (joints, loads, frequency), periods = matrices(seed), random_joints(seed), 2
    made = scene(structure, joints[0], loads, frequency, time={"periods": periods + 1, "transient": 0})
    response = vd.simulate(made.replace({"joint": joints}), samples_per_period=1)
    assert response.status is vd.Status.OK and abs(response.energy_residual) < 1e-10
    reference = stepped(structure, joints, loads, frequency, periods, 6000)
    error = np.abs(response.displacement[1 : periods + 1] - reference[:, 0]).max()
    assert error < 3e-3 * np.abs(reference).max()
