"""Wear of contacts: Archard in closed form, the energy balance, patches, and how cavities open."""

import math

import numpy as np
import pytest

from vanedamp.coupling.response.wear import body_shares, ledger_warning, opening, patches
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.coupling.transients.ring_down import ring_down
from vanedamp.studies.cli import main

K, H = 2e-4, 2.5e9
SLIDER = {"cavity": "c", "mass": 0.003, "friction": 0.4, "restitution": 0.7}
BLOCK = SLIDER | {"shape": "block", "length": 6.88e-3, "height": 4.8e-3, "tilt": 1e-4}
SCENE = {
    "structure": {"model": "rigid", "mass": 0.148, "stiffness": 3.4e7, "damping_ratio": 0.002},
    "excitation": {"frequency": 2414.0, "force": 40.0},
    "cavity": [{"name": "c", "gap": 2e-5, "play": 2e-4, "rotation": 5.0, "normal_motion": 0.1}],
    "time": {"periods": 120, "transient": 20},
    "wear": {"coefficient": K, "hardness": H, "impact_rate": 1e-15, "width": 0.01},
}


def scene(**tables):
    return Scene.of(SCENE | tables, "scene")


def test_a_body_that_slides_all_the_time_wears_by_archard():
    """On a table with acceleration a sin, which never lets it stop above mu g sqrt(1 + pi^2/4).

    r'' = a sin(w t + phi) -+ mu g with r' = 0 at both ends of a half cycle: cos phi = pi mu g/(2 a), and the
    path of a period is 4 a sin(phi)/w^2.
    """
    mu, load, mass, frequency = 0.3, 20.0, 2.0, 5.0
    omega, hold = 2 * math.pi * frequency, mu * load / mass
    acceleration = 4.0 * hold
    worn = scene(
        structure={"model": "prescribed", "displacement_amplitude": acceleration / omega**2},
        excitation={"frequency": frequency}, cavity=[{"name": "c", "gap": 10.0}],
        damper=[{"cavity": "c", "mass": mass, "friction": mu, "normal_load": load}],
        time={"periods": 300, "transient": 200}, wear={"coefficient": K, "hardness": H, "length": 0.02, "width": 0.05},
    )  # fmt: skip
    path = 4 * acceleration * math.sin(math.acos(math.pi * hold / (2 * acceleration))) / omega**2
    response = simulate(worn)
    floor, *walls = response.wear
    assert floor.side == "floor" and not any(wall.volume_rate for wall in walls)
    assert floor.sliding == pytest.approx(load * path * 100, rel=1e-9)
    per_hour = K * load * path / H * frequency * 3600
    assert floor.volume_rate == pytest.approx(per_hour, rel=1e-9)
    assert floor.volume_rate_confidence < 1e-6 * per_hour
    assert floor.depth_rate == pytest.approx(per_hour / (0.02 * 0.05), rel=1e-9)
    assert floor.hours_to(1e-6) == pytest.approx(1e-6 * 0.02 * 0.05 / per_hour)
    assert floor.work_rate == pytest.approx(load * path * frequency, rel=1e-9)


@pytest.mark.parametrize(
    "tables",
    [
        {"damper": [SLIDER]},
        {"damper": [SLIDER, SLIDER], "friction_damper": [{"normal_force": 5.0, "friction": 0.3}]},
        {"damper": [BLOCK]},
        {"damper": [BLOCK, BLOCK | {"mass": 0.002}]},
    ],
    ids=["slider", "row", "block", "blocks"],
)
def test_friction_work_is_wear_volume_times_hardness_over_k(tables):
    """The volume is that of sliding alone: rates of impacts are 0."""
    response = simulate(scene(**tables, wear={"coefficient": K, "hardness": H}))
    hours = (response.periods - response.transient) / response.frequency / 3600
    by_volume = sum(
        work.friction * one.volume_rate * hours * H / K
        for work, one in zip(response.contact_work, response.wear, strict=True)
    )
    assert by_volume == pytest.approx(response.energy["friction"], rel=1e-11) and by_volume > 0.0
    assert not response.warnings
    assert "differ by 1.0e-03" in ledger_warning(response.contact_work, response.energy["friction"] / 1.001)[0]


def test_volumes_of_impacts_and_sliding_add_up():
    response = simulate(scene(damper=[BLOCK]))
    for work, one in zip(response.contact_work, response.wear, strict=True):
        total = K / H * work.sliding + 1e-15 * work.impacts
        hours = len(work.course) / response.frequency / 3600
        assert one.volume_rate * hours == pytest.approx(total, rel=1e-12)
        assert (one.volume_rate_confidence > 0.0) == (one.volume_rate > 0.0)
    data = response.to_json()["wear"]
    assert [one["corner"] for one in data] == [work.corner for work in response.contact_work]
    assert data[0].keys() >= {
        "damper",
        "side",
        "sliding",
        "friction",
        "impacts",
        "volume_rate",
        "depth_rate",
        "work_rate",
    }


def of(found, work, **place):
    return next(
        patch for patch, one in zip(found, work, strict=True)
        if all(getattr(one, key) == value for key, value in place.items())
    )  # fmt: skip


def test_patches_by_geometry_and_by_pairs():
    wear = SCENE["wear"] | {
        "share": 0.2,
        "pair": [{"side": "floor", "rate": 1e-13}, {"damper": 1, "area": 1e-6}],
    }
    worn = scene(damper=[BLOCK, BLOCK], wear=wear, time={"periods": 2, "transient": 1})
    work = simulate(worn).contact_work
    found = patches(worn, work)
    floor, left = of(found, work, damper=0, side="floor"), of(found, work, damper=0, side="left")
    assert floor.area == pytest.approx(6.88e-3 * 0.01 / 2) and floor.sliding == 1e-13 and floor.share == 0.2
    assert left.area == pytest.approx(4.8e-3 * 0.01 / 2) and left.sliding == K / H and left.impact == 1e-15
    assert of(found, work, damper=0, side="body").area == pytest.approx(4.8e-3 * 0.01 / 2)
    assert of(found, work, damper=1, side="floor").area == 1e-6
    edges = scene(damper=[BLOCK], wear=SCENE["wear"] | {"edge": 1e-4})
    work = [one for one in work if one.damper == 0 and one.side != "body"]
    assert [patch.area for patch in patches(edges, work)] == pytest.approx([1e-6] * len(work))


def test_sliders_have_extents_by_the_table_and_discs_none():
    wear = SCENE["wear"] | {"length": 0.02, "height": 0.005}
    worn = scene(damper=[SLIDER], wear=wear, time={"periods": 2, "transient": 1})
    areas = {one.side: one.area for one in simulate(worn).wear}
    assert areas == pytest.approx({"floor": 2e-4, "left": 5e-5, "right": 5e-5})
    disc = SLIDER | {"shape": "disc", "radius": 2e-3}
    round_one = simulate(scene(damper=[disc], wear=wear, time={"periods": 2, "transient": 1}))
    assert {one.area for one in round_one.wear} == {None} and {one.depth_rate for one in round_one.wear} == {None}


def test_gaps_open_by_the_depths_of_walls_and_neighbours():
    worn = scene(damper=[BLOCK, BLOCK])
    places = [
        (0, "left"),
        (0, "left"),
        (0, "floor"),
        (0, "floor"),
        (0, "body"),
        (1, "right"),
        (1, "ceiling"),
        (1, "floor"),
    ]
    along, across = opening(worn, places)
    assert along[0] == pytest.approx([0.5, 0.5, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0])
    assert across[0] == pytest.approx([0.0, 0.0, 0.25, 0.25, 0.0, 0.0, 0.5, 0.5])

    class Contact:
        def __init__(self, damper, side):
            self.damper, self.side, self.share = damper, side, 0.3

    shares = body_shares(worn, [Contact(*place) for place in places])
    assert shares[:, 0] == pytest.approx([0.7, 0.0]) and shares[:, 4] == pytest.approx([0.7, 0.3])


def test_the_command_prints_the_wear(tmp_path, capsys):
    worn = scene(damper=[SLIDER], wear=SCENE["wear"] | {"height": 0.005}, time={"periods": 40, "transient": 10})
    worn.save(tmp_path / "scene.toml")
    out = tmp_path / "response.h5"
    assert main(["run", str(tmp_path / "scene.toml"), "-o", str(out)]) == 0
    told = capsys.readouterr().out
    assert "left of body 0: " in told and "nm/h, work rate" in told
    assert main(["report", str(out), "-o", str(tmp_path / "page.html")]) == 0


def test_wear_is_a_mean_over_the_evaluated_periods_only():
    long, short = (simulate(scene(damper=[SLIDER], time={"periods": 120, "transient": t})) for t in (20, 100))
    tail = np.concatenate([long.contact_work[1].course[80:, 1]])
    assert short.contact_work[1].impacts == pytest.approx(tail.sum())


def test_ring_downs_of_scenes_with_wear_do_not_count_it():
    table = {"start": "displacement", "displacement": 1e-5, "periods": 5}
    assert len(ring_down(scene(damper=[SLIDER], ring_down=table)).half_cycles.time) > 5
