"""The engine against an independent way: DOP853 at rtol 1e-12 with event search (tests/reference/), random scenes.

Impacts come in the same order at times equal to 1e-8 of a period, and the motion between them is the same. Chaos
multiplies every difference at each impact, so the comparison ends where two runs of the reference itself, at other
step lengths and tolerances, part. The last impacts of a chatter are left out: each way completes it by its own rule.
"""

import pytest

from tests.reference.comparison import SAMPLES, compare_motion, impacts
from tests.reference.integrator import with_horizon
from tests.tools.random_scenes import random_reduced, random_scene
from tests.tools.tiers import cases
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.simulation import simulate

PERIODS = 10
#: seeds of each kind of structure and number of bodies
KINDS = {("rigid", 1): 20, ("prescribed", 1): 10, ("rigid", 2): 10, ("rom", 2): 10}


@pytest.mark.parametrize(
    ("structure", "bodies", "seed"),
    cases(
        [(*kind, seed) for kind, count in KINDS.items() for seed in range(count)],
        fast=[(*kind, seed) for kind in KINDS for seed in (0, 2)],
    ),
)
def test_motion_equals_dop853(structure, bodies, seed, tmp_path):
    scene = random_scene(seed, structure, bodies).replace({"time.periods": PERIODS, "time.transient": 0})
    reduced = None
    if structure == "rom":
        reduced = random_reduced(seed)
        reduced.save(tmp_path / "rom.h5")
        scene = scene.replace({"structure.file": str(tmp_path / "rom.h5")})
    period = 1 / scene.excitation.frequency
    reference, end = with_horizon(scene, PERIODS, reduced)
    response = simulate(scene, events=True, samples_per_period=SAMPLES)
    assert response.status == Status.OK
    assert response.energy_residual < 1e-10

    expected, found = impacts(reference.events, end), impacts(response.event_list, end)
    assert abs(len(expected) - len(found)) <= 1  # one may lie just beyond the end
    for one, other in zip(expected, found, strict=False):
        assert one.damper == other.damper
        assert abs(one.time - other.time) < 1e-8 * period
    compare_motion(scene, response, reference, end, structure=2e-8, bodies=2e-7)
