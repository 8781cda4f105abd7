"""Scenes of rings, written out by sector."""

from dataclasses import replace

import numpy as np
import pytest

from tests.tools.rings import Chain
from vanedamp.coupling.scene.elements.element import SceneElement
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.system.assembly import assemble
from vanedamp.coupling.system.body_loads import body_loads
from vanedamp.coupling.system.linear_response import linear_responses
from vanedamp.coupling.system.modal_basis import basis_of
from vanedamp.coupling.system.resonance import chosen_resonance, excitation_force, force_shapes
from vanedamp.coupling.system.sectors import unrolled
from vanedamp.files.toml_input import InputError, validate

CHAIN = Chain(sectors=6)


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    return CHAIN.saved(tmp_path_factory.mktemp("ring"))


def scene(file, **changes):
    tables = {
        "structure": {"model": "ring", "file": file},
        "excitation": {"frequency": 320.0, "force": 2.0, "at": "tip", "wave": 2},
        "cavity": [{"name": "c", "gap": 1e-4, "floor": "tip", "sectors": "all"}],
        "damper": [{"cavity": "c", "mass": 0.01, "position": -2e-5}, {"cavity": "c", "mass": 0.02, "position": 1e-5}],
    }
    return validate(Scene, tables, "scene").replace({path.replace("__", "."): value for path, value in changes.items()})


def test_cavities_and_rows_of_bodies_are_repeated(file):
    made = unrolled(scene(file, cavity__c__sectors=[4, 1]))
    assert [cavity.name for cavity in made.cavity] == ["c@4", "c@1"]
    assert [cavity.floor for cavity in made.cavity] == ["tip@4", "tip@1"]
    assert [(body.cavity, body.mass, body.position) for body in made.damper] == [
        ("c@4", 0.01, -2e-5), ("c@4", 0.02, 1e-5), ("c@1", 0.01, -2e-5), ("c@1", 0.02, 1e-5)
    ]  # fmt: skip
    assert not made.repeats
    assert unrolled(made) is made
    assert [cavity.name for cavity in unrolled(scene(file, cavity__c__sectors="alternate")).cavity] == [
        "c@0", "c@2", "c@4"
    ]  # fmt: skip
    assert [cavity.name for cavity in unrolled(scene(file, cavity__c__sectors=5)).cavity] == ["c@5"]


def test_cavities_as_written_stay_beside_repeated_ones(file):
    cavities = [
        {"name": "own", "gap": 2e-4, "floor": "tip@3"},
        {"name": "c", "gap": 1e-4, "floor": "tip", "sectors": [0, 1]},
    ]
    bodies = [{"cavity": "c", "mass": 0.01}, {"cavity": "own", "mass": 0.02}]
    made = unrolled(
        scene(file, cavity=cavities, damper=bodies, wear={"rate": 1e-15, "pair": [{"damper": 0, "rate": 2e-15}]})
    )
    assert [body.cavity for body in made.damper] == ["own", "c@0", "c@1"]
    assert [pair.damper for pair in made.wear.pair] == [1, 2]  # of the copies of body 0


def test_friction_dampers_and_stops_are_repeated(file):
    tables = {
        "friction_damper": [{"normal_force": 5.0, "friction": 0.3, "stiffness": 1e6, "sectors": "alternate"}],
        "stop": [{"side": "left", "gap": 1e-4, "at": "tip", "to": "tip@+1", "sectors": "all"}],
    }
    made = unrolled(scene(file, **tables))
    assert [damper.at for damper in made.friction_damper] == ["tip@0", "tip@2", "tip@4"]
    assert [(stop.at, stop.to) for stop in made.stop] == [(f"tip@{j}", f"tip@{(j + 1) % 6}") for j in range(6)]


def test_a_wave_lags_from_sector_to_sector(file):
    harmonics = [{"order": 1, "amplitude": 1.0, "phase": 10.0}, {"order": 3, "amplitude": 0.5}]
    made = unrolled(scene(file, excitation__harmonic=harmonics)).excitation
    assert made.at == "tip@0"
    assert made.load_factor == 2.0
    force = {(load.at, load.order): load.amplitude for load in made.load}
    for sector in range(6):
        assert force[f"tip@{sector}", 1] == pytest.approx(np.exp(1j * (np.radians(10.0) - 2 * 2 * np.pi * sector / 6)))
        assert force[f"tip@{sector}", 3] == pytest.approx(0.5)  # three times 2/6 of a turn


def test_a_whole_engine_order_is_a_wave_and_no_other_is(file):
    turning = {"rotation": {"speed": 500.0}, "excitation": {"engine_order": 4.0, "force": 1.0, "at": "tip"}}
    load = unrolled(scene(file, **turning)).excitation.load
    assert len(load) == 6
    # the load at rest cos(4 theta) meets sector j at theta = speed t + 2 pi j/6: earlier by 4 j/6 of a period
    assert load[1].amplitude == pytest.approx(np.exp(2j * np.pi * 4 / 6))
    turning["excitation"]["engine_order"] = 2.5
    assert unrolled(scene(file, **turning)).excitation.load == ()
    assert unrolled(scene(file, **turning)).excitation.at == "tip@0"


@pytest.mark.parametrize("wave", [0, 1, 2, 3, 4, 5, 8, -1])
def test_a_wave_excites_its_aliased_diameter_only(file, wave):
    # engine order r = k N +- h excites h only: the rest is round-off
    made = unrolled(scene(file, excitation__wave=wave))
    basis = basis_of(made)
    force = np.abs(force_shapes(made, basis, basis.rows["tip@0"])[0])
    aliased = min(wave % 6, -wave % 6)
    diameter = CHAIN.squares(np.arange(4))
    own = np.isclose(basis.stiffness, diameter[aliased], rtol=1e-6)
    assert force[~own].max() < 1e-10 * force[own].max()


@pytest.mark.parametrize("wave", [1, 3])
def test_the_linear_response_is_the_wave_of_the_chain(file, wave):
    # every sector moves alike: one mass on the stiffness of the wave
    made = scene(file, excitation__wave=wave, excitation__frequency=321.0)
    free, fixed = linear_responses(made)
    omega, square = 2 * np.pi * 321.0, CHAIN.squares([wave])[0]
    rows = np.array([basis_of(made).rows[f"tip@{sector}"] for sector in range(6)])
    for response, mass in ((free, 0.5), (fixed, 0.53)):
        # the damping ratio is that of the modes without bodies
        damping = 2 * CHAIN.damping_ratio * np.sqrt(square) * 0.5
        expected = 2.0 / abs(square * 0.5 - omega**2 * mass + 1j * omega * damping)
        assert response.amplitudes(321.0, rows) == pytest.approx(np.full(6, expected), rel=1e-10)


@pytest.mark.parametrize("natural", [False, True])
def test_modes_of_a_ring_are_whole_pairs(file, natural):
    # a wave of which a part is left out would stand: 2, 1, 1, 2, 1, 1 of the amplitude
    made = scene(file, structure__modes=4, structure__natural=natural, excitation__frequency=321.0)
    basis, square = basis_of(made), CHAIN.squares([2])[0]
    assert len(basis.stiffness) == 5
    omega, rows = 2 * np.pi * 321.0, np.array([basis.rows[f"tip@{sector}"] for sector in range(6)])
    expected = 2.0 / 0.5 / abs(square - omega**2 + 2j * CHAIN.damping_ratio * np.sqrt(square) * omega)
    assert linear_responses(made)[0].amplitudes(321.0, rows) == pytest.approx(np.full(6, expected), rel=1e-9)


def test_the_level_of_a_mistuned_ring_is_that_of_the_tuned_one(file):
    square = CHAIN.squares([2])[0]
    tuned = scene(
        file, excitation={"frequency": np.sqrt(square) / 2 / np.pi, "resonance_amplitude": 1e-4, "at": "tip", "wave": 2}
    )
    zeta = CHAIN.damping_ratio
    peak = 1 / (0.5 * square * 2 * zeta * np.sqrt(1 - zeta**2))  # of one mass, per newton
    assert excitation_force(tuned) == pytest.approx(1e-4 / peak, rel=1e-6)
    mistuned = tuned.replace({"structure.mistuning": {"stiffness": {"std": 0.05}}})
    assert excitation_force(mistuned) == excitation_force(tuned)
    assert chosen_resonance(mistuned).frequency == chosen_resonance(tuned).frequency
    apart = basis_of(mistuned).stiffness / basis_of(tuned).stiffness - 1
    assert np.abs(apart).max() > 1e-3


def test_scatter_does_not_depend_on_which_sectors_have_cavities(file):
    scatter = {"gap": 0.05, "position": 0.5, "seed": 4}
    every = unrolled(scene(file, cavity__c__scatter=scatter))
    some = unrolled(scene(file, cavity__c__scatter=scatter, cavity__c__sectors=[3]))
    assert every.cavity[3] == some.cavity[0]
    assert every.damper[6:8] == some.damper
    other = unrolled(scene(file, cavity__c__scatter=scatter | {"seed": 5}))
    gaps = np.array([[cavity.gap for cavity in made.cavity] for made in (every, other)])
    assert np.unique(gaps).size == 12
    assert np.abs(gaps / 1e-4 - 1).max() < 5 * 0.05
    still = unrolled(scene(file, cavity__c__scatter={"position": 1.0}))
    assert {cavity.gap for cavity in still.cavity} == {1e-4}
    places = np.reshape([body.position for body in still.damper], (6, 2))
    assert np.all(places[:, 0] <= places[:, 1])
    assert np.abs(places).max() <= 0.5e-4
    assert np.unique(places).size > 6


def test_bodies_of_every_sector_begin_spread_over_its_own_gap(file):
    row = [{"cavity": "c", "mass": 0.01}] * 3
    for scatter in (None, {"gap": 0.05, "seed": 4}):
        made = unrolled(scene(file, damper=row, cavity__c__scatter=scatter))
        gaps = [cavity.gap for cavity in made.cavity]
        assert len(set(gaps)) == (1 if scatter is None else 6)
        assert np.reshape(made.positions, (6, 3)) == pytest.approx(np.outer(gaps, [-0.25, 0.0, 0.25]), abs=1e-19)
    assert unrolled(scene(file, damper=row[:1])).positions == [0.0] * 6


def test_paths_of_the_compact_scene_change_all_sectors(file):
    made = scene(file)
    changed = unrolled(made.replace({"cavity.c.gap": 2e-4, "damper.1.mass": 0.03}))
    assert {cavity.gap for cavity in changed.cavity} == {2e-4}
    assert [body.mass for body in changed.damper] == [0.01, 0.03] * 6


def test_a_path_names_the_copies_of_a_cavity(file):
    made = unrolled(scene(file, cavity__c__sectors=[0, 3]))
    changed = made.replace({"cavity.c.gap": 3e-4})
    assert [cavity.gap for cavity in changed.cavity] == [3e-4, 3e-4]
    assert made.replace({"cavity.c@3.gap": 2e-4}).cavity[0] == made.cavity[0]


def test_a_ring_in_memory_is_a_structure():
    made = validate(
        Scene, {"structure": CHAIN.ring(), "excitation": {"frequency": 1.0, "force": 1.0, "at": "tip"}}, "scene"
    )
    assert made.structure.model == "ring"
    assert basis_of(made).stiffness == pytest.approx(np.sort(CHAIN.squares(CHAIN.diameters)))


def test_rotation_presses_the_bodies_of_all_sectors_by_their_radius(tmp_path):
    # the bodies slide along the axis, at the radius of their label
    path = tmp_path / "turning.h5"
    ring = CHAIN.ring()
    replace(ring, centrifugal_stiffness=0.0 * ring.stiffness, greatest_speed=800.0).save(path)
    made = unrolled(scene(str(path), rotation={"speed": 300.0}, damper__friction=0.3))
    loads = body_loads(made, basis_of(made))
    assert loads.across == pytest.approx(np.full(12, 300.0**2 * CHAIN.radius))
    assert loads.along == pytest.approx(np.zeros(12), abs=1e-9)


def test_a_compact_scene_is_assembled_written_out(file):
    made = scene(file)
    one, other = assemble(made), assemble(unrolled(made))
    assert one.bodies == 12
    assert np.array_equal(one.J, other.J)
    assert np.array_equal(one.load, other.load)


def test_elements_that_may_name_bodies_are_rejected(file):
    made = replace(scene(file), added={"tether": (SceneElement(),)})
    with pytest.raises(InputError, match="tether: may name bodies by number"):
        unrolled(made)
    assert unrolled(replace(made, cavity=(), damper=())).added


def test_it_comes_back_from_its_file(file, tmp_path):
    made = scene(file, cavity__c__scatter={"gap": 0.1}, structure__mistuning={"seed": 3, "mass": {"std": 0.01}})
    made.save(tmp_path / "scene.toml")
    again = Scene.load(tmp_path / "scene.toml")
    assert unrolled(again).damper == unrolled(made).damper
    assert np.array_equal(basis_of(again).stiffness, basis_of(made).stiffness)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"cavity__c__sectors": [0, 6]}, r"cavity\[0\].sectors: the ring has no sector 6; its 6 sectors are 0 to 5"),
        ({"cavity__c__sectors": [1, 1]}, "sector 1 is given twice"),
        (
            {"cavity__c__floor": "tipp"},
            r"cavity\[0\].floor: no sector of the ring has a label 'tipp'; did you mean 'tip'",
        ),
        ({"excitation__at": "root"}, "excitation.at: no sector of the ring has a label 'root'"),
        ({"excitation__at": "tip@+x"}, r"excitation.at: expected 'tip', 'tip@3' or 'tip@\+1', not 'tip@\+x'"),
        ({"cavity__c__floor": "tip@2"}, r"cavity\[0\].floor: 'tip@2' is the same place for all of several sectors"),
        (
            {"stop": [{"side": "left", "gap": 1e-4, "at": "tip", "to": "tip@3", "sectors": "all"}]},
            r"stop\[0\].to: 'tip@3' is the same place for all of several sectors; give 'tip'",
        ),
        (
            {"structure__modes": 1},
            "structure.modes: 1 modes are without the nodal diameter 2, which wave 2 excites; give at least 4",
        ),
        (
            {"structure__modes": 5, "structure__mistuning": {"mass": {"std": 0.01}}},
            "without the nodal diameter 3, which wave 2 excites in a mistuned ring; give at least 6",
        ),
        ({"structure__modes": 3, "excitation__wave": None}, "without the nodal diameter 2, which a force at one label"),
    ],
)
def test_what_the_ring_does_not_have_is_rejected(file, changes, message):
    with pytest.raises(InputError, match=message):
        unrolled(scene(file, **changes))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"structure": {"model": "rigid", "mass": 1.0, "stiffness": 1e6, "damping": 1.0}, "excitation__wave": None},
         r"cavity\[0\].sectors: this structure is no ring"),
        ({"cavity__c__sectors": None, "structure": {"model": "rom", "file": "a.h5"}}, "wave: is around a ring"),
        ({"cavity__c__sectors": "some"}, 'expected "all", "alternate", the number of a sector'),
        ({"cavity__c__sectors": []}, 'expected "all", "alternate", the number of a sector'),
        ({"cavity__c__sectors": None, "cavity__c__scatter": {"gap": 0.1}}, "scatter: is over the sectors of a ring"),
        ({"damper__0__cavity": "c@7"}, r"damper\[0\].cavity: no cavity 'c@7'"),
        ({"structure__modes": "auto"}, 'modes: "auto" is for model = "rom"'),
        ({"excitation": {"frequency": 1.0, "base_acceleration": 1.0, "at": "tip", "wave": 1}},
         "a base moves all sectors alike"),
        ({"excitation": {"frequency": 1.0, "force": 1.0, "at": "tip", "wave": 1,
                         "waveform": {"shape": "multisine", "orders": [1, 4]}}},
         "a wave around a ring takes sines"),
        ({"excitation": {"frequency": 1.0, "at": "tip", "wave": 1, "load": [{"at": "tip@0", "force": 1.0}]}},
         "give one of load and wave"),
    ],
)  # fmt: skip
def test_bad_tables_are_rejected(file, changes, message):
    with pytest.raises(InputError, match=message):
        scene(file, **changes)


def test_a_file_of_another_kind_is_rejected(file, tmp_path):
    CHAIN.ring().model().save(tmp_path / "rom.h5")
    with pytest.raises(Exception, match="ring-model"):
        unrolled(scene(file, structure__file=str(tmp_path / "rom.h5")))
