"""`vanedamp check`: what it derives from a file, against closed forms and against runs."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

from tests.tools.input_files import BLOCK, CLUSTER, SCENE, changed
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.coupling.sweep.grid import grid
from vanedamp.coupling.system.onset import NEVER_STICKS, onset, onsets, swing
from vanedamp.files.formats.meshes.msh_header import read_header
from vanedamp.files.toml_input import validate
from vanedamp.files.toml_output import toml
from vanedamp.rom.reduced import ReducedModel
from vanedamp.studies.cli import BAD_INPUT, main

G, MU, MASS, STIFFNESS, ZETA = 10.0, 0.4, 0.157, 3.6e7, 0.002
HZ = math.sqrt(STIFFNESS / MASS) / (2 * math.pi)
DAMPED = {
    "structure": {"model": "rigid", "mass": MASS, "stiffness": STIFFNESS, "damping_ratio": ZETA},
    "excitation": {"frequency": 0.99 * HZ, "force": 4.0},
    "cavity": [{"name": "c1", "gap": 2e-5}],
    "damper": [{"cavity": "c1", "mass": 0.003, "friction": MU, "restitution": 0.7}],
    "gravity": {"acceleration": G},
}


def checked(tmp_path, capfd, tables, name="file.toml"):
    """The facts in the JSON of a file."""
    path = tmp_path / name
    path.write_text(tables if isinstance(tables, str) else toml(tables))
    assert main(["check", str(path), "--json", "-"]) == 0
    return json.loads(capfd.readouterr().out)


# scenes


def test_warnings_are_those_of_the_sweep(tmp_path, capfd):
    """Gravity, which matters less the faster it turns, is told of the slow end of a sweep."""
    turning = DAMPED | {
        "rotation": {"speed": 400.0}, "cavity": [{"name": "c1", "gap": 2e-5, "radius": 0.3}],
        "sweep": {"rotation.speed": [40.0, 400.0]},
    }  # fmt: skip
    expected = list(grid(validate(Scene, turning, "scene")).warnings)
    assert any("gravity turns once a revolution" in warning for warning in expected)
    assert checked(tmp_path, capfd, turning)["warnings"] == expected


def test_numbers_of_a_rigid_structure(tmp_path, capfd):
    found = checked(tmp_path, capfd, DAMPED | {"sweep": {"excitation.frequency": [2300.0, 2400.0]}})
    omega = 2 * math.pi * 0.99 * HZ

    def amplitude(omega, mass):
        return 4.0 / abs(STIFFNESS - omega**2 * mass + 2j * ZETA * math.sqrt(STIFFNESS * MASS) * omega)

    expected = {
        "static_amplitude": 4.0 / STIFFNESS, "resonance_hz": HZ * math.sqrt(1 - 2 * ZETA**2),
        "resonance_amplitude": 4.0 / STIFFNESS / (2 * ZETA * math.sqrt(1 - ZETA**2)), "modal_mass": MASS,
        "amplitude_undamped": amplitude(omega, MASS), "amplitude_fixed": amplitude(omega, MASS + 0.003),
        "mass_ratio": 0.003 / MASS, "fixed_hz": HZ / math.sqrt(1 + 0.003 / MASS), "force": 4.0,
    }  # fmt: skip
    assert {key: found[key] for key in expected} == pytest.approx(expected, rel=1e-9)
    assert found["natural_frequency_hz"] == pytest.approx([HZ], rel=1e-12)
    assert found["damping_ratio"] == pytest.approx([ZETA], rel=1e-12)
    assert found["gap_ratio"] == pytest.approx([2e-5 / expected["resonance_amplitude"]], rel=1e-9)
    assert found["slip_onset"] == pytest.approx([MU * G / omega**2], rel=1e-12)
    assert found["kind"] == "scene" and found["commands"] == ["run", "sweep"] and found["sweep_points"] == 2
    assert found["sweep_seconds"] > 0 and found["run_seconds"] > 0
    assert found["defaults"]["damper.0.position"] == 0.0 and "damper.0.friction" not in found["defaults"]
    assert found["positions"] == [0.0]


def shaker(amplitude, frequency=50.0, orientation_deg=0.0, **body):
    """A body on a floor that moves by a sine."""
    tables = {
        "structure": {"model": "prescribed", "displacement_amplitude": amplitude},
        "excitation": {"frequency": frequency},
        "cavity": [{"name": "c1", "gap": 2e-3}],
        "damper": [{"cavity": "c1", "mass": 0.01} | body],
        "gravity": {"acceleration": G, "orientation_deg": orientation_deg},
        "time": {"periods": 20, "transient": 0},
    }
    return validate(Scene, tables, "shaker")


def hits(scene):
    """Impacts of a run from the scene's initial state."""
    response = simulate(scene, events=True)
    assert response.status == "ok"
    return round(response.impacts_per_period * 20)


OMEGA = 2 * math.pi * 50.0


def impact_onset(scene):
    (found,) = onsets(scene)
    return found.impact


def test_onset_of_impacts_without_friction():
    """The body stays where it is in space: it begins with the floor's velocity, backwards."""
    for offset in (0.0, 3e-4):
        limit = impact_onset(shaker(1e-4, position=offset))
        assert limit == pytest.approx(1e-3 - offset, rel=1e-12)
        for share, hit in ((0.999, False), (1.001, True)):
            scene = shaker(share * limit, position=offset, velocity=-share * limit * OMEGA)
            assert bool(hits(scene)) is hit


@pytest.mark.parametrize("ratio", [0.2, 0.5])
def test_onset_of_impacts_with_friction_and_without_sticking(ratio):
    """A body that never sticks: its velocity is a zigzag of slope mu g, and it begins with that of its steady slip."""
    slip = ratio * 1e-3
    friction = slip * OMEGA**2 / G
    limit = impact_onset(shaker(1e-4, friction=friction))
    assert limit == pytest.approx(math.hypot(1e-3, 0.5 * math.pi * slip), rel=1e-12)
    for share, hit in ((0.999, False), (1.001, True)):
        reach = share * limit
        turn = math.acos(0.5 * math.pi * slip / reach)  # of the slip, at its most negative
        velocity = slip * (0.5 * math.pi - turn) - reach
        way = 0.5 * math.pi * slip * turn - 0.5 * slip * turn**2 - reach * math.sin(turn)
        position = -swing(reach, slip) - way
        scene = shaker(reach, friction=friction, velocity=velocity * OMEGA, position=position)
        assert bool(hits(scene)) is hit


def test_onset_of_impacts_of_a_body_that_sticks_and_slips():
    """Each half period it slips by twice its swing, first to the right, and sticks."""
    slip = 1.5e-3
    limit = impact_onset(shaker(1e-4, friction=slip * OMEGA**2 / G))
    assert slip < limit < NEVER_STICKS * slip
    for share, hit in ((0.995, False), (1.005, True)):
        swung = min(swing(share * limit, slip), 0.9999e-3)
        assert bool(hits(shaker(share * limit, friction=slip * OMEGA**2 / G, position=-swung))) is hit


@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_onset_of_impacts_in_an_inclined_cavity(friction):
    """The body lies at the left wall, which leaves it behind once it runs away faster than the body is pulled."""
    angle = math.radians(60.0)
    body = {"friction": friction, "orientation_deg": 60.0, "position": -1e-3}
    limit = impact_onset(shaker(1e-4, **body))
    assert limit == pytest.approx((G * math.sin(angle) + friction * G * math.cos(angle)) / OMEGA**2, rel=1e-12)
    for share, hit in ((0.99, False), (1.05, True)):
        assert bool(hits(shaker(share * limit, **body))) is hit


def test_swing_is_continuous_and_begins_with_the_slip():
    assert swing(1.0, 1.0) == 0.0
    assert swing(NEVER_STICKS, 1.0) == pytest.approx(1.0, rel=1e-12)
    assert swing(NEVER_STICKS * (1 - 1e-9), 1.0) == pytest.approx(1.0, rel=1e-6)
    assert swing(3.0, 0.0) == 3.0
    assert onset(0.3, 1.0, 0.0, 1.0).impact > 1.0 and swing(onset(0.3, 1.0, 0.0, 1.0).impact, 1.0) == pytest.approx(0.3)


def test_onset_by_the_response_of_a_reduced_model(tmp_path, capfd):
    """The cavity moves by another amplitude than the response."""
    rows = {"tip": [1.0, 0.3], "c1": [0.4, -0.8]}
    stiffness = np.array([2.0e8, 1.5e9])
    ReducedModel.from_matrices(np.eye(2), np.diag(stiffness), rows, damping_ratio=0.01).save(tmp_path / "rom.h5")
    omega = 2 * math.pi * 2200.0
    tables = DAMPED | {
        "structure": {"model": "rom", "file": "rom.h5"},
        "excitation": {"frequency": 2200.0, "force": 1.0, "at": "tip"},
        "cavity": [{"name": "c1", "gap": 2e-5, "floor": "c1"}],
        "damper": [{"cavity": "c1", "mass": 0.003}],
    }
    found = checked(tmp_path, capfd, tables)
    modal = np.array(rows["tip"]) / (stiffness - omega**2 + 0.02j * np.sqrt(stiffness) * omega)
    ratio = abs(modal @ rows["tip"]) / abs(modal @ rows["c1"])
    assert found["impact_onset"] == pytest.approx([1e-5 * ratio], rel=1e-9)
    assert found["natural_frequency_hz"] == pytest.approx((np.sqrt(stiffness) / (2 * math.pi)).tolist())
    mass = np.eye(2) + 0.003 * np.outer(rows["c1"], rows["c1"])
    glued = np.linalg.eigvals(np.linalg.solve(mass, np.diag(stiffness)))
    assert found["fixed_hz"] == pytest.approx(math.sqrt(min(glued)) / (2 * math.pi), rel=1e-9)


@pytest.mark.parametrize(
    "change",
    [
        {"damper": [{"cavity": "c1", "mass": 0.003, "stiffness": 1e3}]},
        {"excitation": {"frequency": 2000.0, "force": 1.0, "harmonic": [{"order": 2, "amplitude": 1.0}]}},
        {
            "cavity": [{"name": "c1", "gap": 2e-5, "play": 1e-4}],
            "damper": [{"cavity": "c1", "mass": 0.003, "shape": "disc", "radius": 1e-3, "friction": 0.2}],
        },
    ],
)
def test_onsets_that_have_no_closed_form_are_unknown(tmp_path, capfd, change):
    assert checked(tmp_path, capfd, DAMPED | change)["impact_onset"] == [None]


def test_bodies_in_a_row_begin_together(tmp_path, capfd):
    row = [
        {"cavity": "c1", "mass": mass, "friction": 0.1, "position": place}
        for mass, place in ((1e-3, -2e-6), (2e-3, 0.0))
    ]
    found = checked(tmp_path, capfd, DAMPED | {"damper": row})
    assert found["impact_onset"][0] == found["impact_onset"][1] == pytest.approx(8e-6, rel=1e-3)
    row[1]["friction"] = 0.2
    assert checked(tmp_path, capfd, DAMPED | {"damper": row})["impact_onset"] == [None, None]


def test_undamped_and_unmoved_scenes_are_told(tmp_path, capfd):
    still = DAMPED | {
        "structure": {"model": "rigid", "mass": 1.0, "stiffness": 1e4, "damping": 0.0},
        "excitation": {"frequency": 10.0},
    }
    found = checked(tmp_path, capfd, still)
    assert "nothing moves" in found["warnings"][-1] and "resonance_amplitude" not in found
    assert found["commands"] == []
    blow = still | {"ring_down": {"start": "impulse", "impulse": 0.1, "periods": 3}}
    found = checked(tmp_path, capfd, blow)
    assert found["commands"] == ["ringdown"] and found["warnings"] == []


# other kinds


def test_study(tmp_path, capfd):
    table = {"band": {"start": 2350.0, "stop": 2450.0, "num": 5}, "samples": 3, "evaluations": 10}
    found = checked(tmp_path, capfd, DAMPED | {"optimise": table | {"map": {"mass_ratio": 2, "gap_ratio": 3}}})
    assert found["kind"] == "study"
    assert (found["designs"], found["scenes"]) == (6 + 20, (6 + 20 + 30) * 5)
    assert found["reference_amplitude"] == pytest.approx(found["resonance_amplitude"], rel=1e-6)


def test_life(tmp_path, capfd):
    tables = {"wear": {"coefficient": 1e-4, "hardness": 2e9}, "life": {"band": [2350.0, 2450.0], "hours": 500.0}}
    found = checked(tmp_path, capfd, DAMPED | tables)
    assert found["kind"] == "life" and found["commands"] == ["life"] and found["hours"] == 500.0
    assert found["sliding_wear_rate"] == pytest.approx(5e-14)
    assert found["reference_amplitude"] == pytest.approx(found["resonance_amplitude"], rel=1e-6)


def test_case_of_a_generator(tmp_path, capfd):
    text = changed(BLOCK, ("count = 6", "max_frequency = 2e4"))
    found = checked(tmp_path, capfd, text)
    shear = math.sqrt(2e11 / 2.6 / 8000.0)
    assert found["kind"] == "case" and found["largest_element"] == pytest.approx(shear / 6 / 2e4)
    assert found["materials"]["default"]["shear_speed"] == pytest.approx(shear)
    assert found["materials"]["default"]["pressure_speed"] == pytest.approx(shear * math.sqrt(3.5))
    assert found["response"] == "tip" and found["defaults"]["mesh.degree"] == 2
    cluster = '[mesh]\ngenerator = "vane_cluster"\n' + text[text.index("[material") : text.index("[support")]
    sizes = [f'"vane_cluster"\nelement_size = {size}' for size in (2.6e-3, 1.3e-3)]
    elements = [checked(tmp_path, capfd, changed(cluster, ('"vane_cluster"', size)))["elements"] for size in sizes]
    assert elements[1] == pytest.approx(8 * elements[0], rel=1e-3)


def test_case_of_a_mesh_file_knows_its_groups(tmp_path, capfd):
    found = checked(tmp_path, capfd, CLUSTER)
    assert {"clamp", "shroud", "c1_floor"} <= set(found["groups"]["facets"]) and found["nodes"] > 1000
    (tmp_path / "bad.toml").write_text(changed(CLUSTER, ('["clamp"]', '["clmp"]')))
    assert main(["check", str(tmp_path / "bad.toml")]) == BAD_INPUT
    assert "no facet group 'clmp'" in capfd.readouterr().err


FATIGUE = "[material.fatigue]\nstrength = 4e8\nexponent = 8.0\nknee = 1e7\n[support]"


def test_case_with_fatigue_data(tmp_path, capfd):
    found = checked(tmp_path, capfd, changed(CLUSTER, ("[support]", FATIGUE)))
    assert found["fatigue"]["default"] == {
        "strength": 4e8, "mean_stress": "none", "criterion": "von_mises", "exponent": 8.0, "knee": 1e7,
        "after_knee": "haibach", "scatter": 1.0,
    }  # fmt: skip
    assert found["defaults"]["material.fatigue.scatter"] == 1.0
    assert "material.fatigue.expansion" not in found["defaults"]


def test_external_model(tmp_path, capfd):
    np.savez(tmp_path / "m.npz", m=np.eye(2), k=np.diag([4e6, 9e6]))
    tables = {
        "matrices": {"mass": "m", "stiffness": "k", "file": "m.npz", "damping_ratio": 0.1},
        "interface": {"x": {"coordinate": 0}},
    }
    found = checked(tmp_path, capfd, tables)
    assert found["kind"] == "external" and found["interface"] == ["x"]
    assert found["natural_frequency_hz"] == pytest.approx([2e3 / (2 * math.pi), 3e3 / (2 * math.pi)])


# pipelines, which tests/commands/test_pipeline.py has more of


def test_sweeps_make_a_pipeline(tmp_path, capfd):
    (tmp_path / "own.toml").write_text(SCENE)
    found = checked(tmp_path, capfd, '[[sweep]]\nscene = "own.toml"\n', "pipeline.toml")
    assert (found["kind"], found["runs"]) == ("pipeline", ["sweep own"])


# files that are none


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (
            "[structur]\nmass = 1.0\n",
            "no kind of input file has these keys; a scene has structure, excitation, cavity, damper; a case has",
        ),
        ("[matrix]\nmass = 'm.npz'\n", "an external has matrices"),
        (changed(SCENE, ("frequency = 15.9", "frequenzy = 15.9")), "frequenzy: unknown key; did you mean 'frequency'?"),
        (changed(SCENE, ("num = 4", "num = 4000000")), "sweep: 4e+06 points take"),
        (changed(SCENE, ("periods = 90", "periods = 1000000000000")), "time.periods: 1e+12 periods"),
        ("a = ", "not valid TOML"),
        (
            changed(SCENE, ("{start = 15.4, stop = 16.2, num = 4}", "[]")),
            "sweep.excitation.frequency: expected at least 1 entries, not 0",
        ),
        (changed(BLOCK, ("length = 0.1", "length = '1'")), "mesh.length: should be a valid number (got '1')"),
        ("[matrices]\nmass = 'm.npz'\n", "matrices.stiffness: missing"),
    ],
)
def test_bad_files_end_in_one_line(tmp_path, capfd, text, told):
    path = tmp_path / "bad.toml"
    path.write_text(text)
    assert main(["check", str(path)]) == BAD_INPUT
    error = capfd.readouterr().err
    assert error.count("\n") == 1 and str(path) in error and told in error


def test_what_is_printed(tmp_path, capfd):
    path = tmp_path / "scene.toml"
    path.write_text(toml(DAMPED))
    assert main(["check", str(path)]) == 0
    lines = capfd.readouterr().out.splitlines()
    assert lines[0] == f"{path}: a scene, for vanedamp run"
    assert any(line.split()[:3] == ["mass_ratio", f"{0.003 / MASS:.6g}", "of"] for line in lines)
    assert lines[-1].startswith("left at their defaults: structure.centrifugal_stiffness = 0,")


@pytest.mark.parametrize("text", ["$Mesh\n", "$MeshFormat\n4.1 0 8\n", "$MeshFormat\n4.1 0 8\n$PhysicalNames\nx\n"])
def test_a_mesh_file_that_is_none(tmp_path, text):
    (tmp_path / "a.msh").write_text(text)
    with pytest.raises(ValueError, match=r"a\.msh: "):
        read_header(tmp_path / "a.msh")


def warned(tmp_path, capfd, tables, key):
    return [text for text in checked(tmp_path, capfd, tables)["warnings"] if text.startswith(key)]


@pytest.mark.parametrize(
    ("span", "told"),
    [((2300.0, 2500.0, 9), "too coarse"), ((2405.0, 2500.0, 191), "edge of the range"), ((2350.0, 2450.0, 201), "")],
)
def test_frequencies_are_judged_as_the_headline_will(tmp_path, capfd, span, told):
    axis = dict(zip(("start", "stop", "num"), span, strict=True))
    found = warned(tmp_path, capfd, DAMPED | {"sweep": {"excitation.frequency": axis}}, "sweep.")
    assert all(told in text for text in found) and bool(found) is bool(told)


def test_slips_of_units_in_gap_and_stiffness(tmp_path, capfd):
    amplitude = checked(tmp_path, capfd, DAMPED)["resonance_amplitude"]
    for ratio, told in ((19.0, False), (21.0, True)):
        wide = DAMPED | {"cavity": [{"name": "c1", "gap": ratio * amplitude}]}
        assert bool(warned(tmp_path, capfd, wide, "cavity[0].gap")) is told
    # omega X sqrt(m/k) is the overlap of a body that a spring stops
    softest = 0.003 * (2 * math.pi * 0.99 * HZ * amplitude / 2e-5) ** 2
    for share, told in ((1.01, False), (0.99, True)):
        soft = DAMPED | {"contact": {"law": "compliant", "stiffness": share * softest}}
        assert bool(warned(tmp_path, capfd, soft, "contact.stiffness")) is told


@pytest.mark.parametrize(
    ("table", "key", "fine", "rough", "told"),
    [
        ("damper", "friction", 1.9, 40.0, "damper[0].friction: 40 is implausible: dry metals have 0.1 to 1"),
        ("damper", "mass", 0.156, 20 * MASS, "damper.mass: the bodies have 3.14 kg, 20 times the modal mass 0.157 kg"),
        ("cavity", "gap", 1e-5, 9.9e-6, "cavity[0].gap: a gap of 9.9 um is below 10 um, what two ground parts of IT5"),
    ],
)
def test_parts_that_nobody_makes(tmp_path, capfd, table, key, fine, rough, told):
    for value, expected in ((fine, []), (rough, [told])):
        changed_scene = DAMPED | {table: [DAMPED[table][0] | {key: value}]}
        found = [text[: len(told)] for text in checked(tmp_path, capfd, changed_scene)["warnings"]]
        assert [text for text in found if text == told] == expected


@pytest.mark.parametrize(
    ("contact", "wear", "told"),
    [
        ({"young": 2.1e11, "yield_strength": 9e8}, {"coefficient": 1e-4, "hardness": 2e9}, None),
        ({"young": 1e7, "wall_young": 2.1e11, "yield_strength": 1e7}, {"rate": 1e-9}, None),
        ({"young": 2.1e5}, {}, "contact.pair.young: no solid part has 2.1e+05 Pa"),
        ({"young": 2.1e11, "wall_young": 210.0}, {}, "contact.pair.wall_young: no solid part has 210 Pa"),
        ({"young": 2.1e11, "yield_strength": 900.0}, {}, "contact.pair.yield_strength: 900 Pa is 4.3e-09 times"),
        ({}, {"coefficient": 1e-4, "hardness": 2000.0}, "wear.hardness: no solid part has 2000 Pa"),
        ({}, {"rate": 1e-6}, "wear.rate: 1e-06 1/Pa is that of no solid part; 1 mm^3/(N m) is 1e-9 1/Pa"),
        (
            {}, {"rate": 1e-13, "pair": [{"damper": 0, "coefficient": 1e-4, "hardness": 200.0}]},
            "wear.pair[0].hardness: no solid part has 200 Pa",
        ),
    ],
)  # fmt: skip
def test_moduli_strengths_and_wear_in_other_units(tmp_path, capfd, contact, wear, told):
    pair = {"law": "newton"} | ({"pair": {"radius": 1e-3} | contact} if contact else {})
    warnings = checked(tmp_path, capfd, DAMPED | {"contact": pair} | ({"wear": wear} if wear else {}))["warnings"]
    found = [text for text in warnings if text.startswith(("contact.pair", "wear."))]
    assert len(found) == (told is not None) and all(text.startswith(told) for text in found)


@pytest.mark.parametrize(
    ("key", "told"),
    [
        ("fatigue_strength = 400.0", "material.default.fatigue_strength: 400 Pa is 2e-09 times Young's modulus"),
        ("fatigue = {strength = 4e8, tensile_strength = 1e15}",
         "material.default.fatigue.tensile_strength: 1e+15 Pa is 5e+03 times"),
    ],
)  # fmt: skip
def test_strengths_of_a_case_in_other_units(tmp_path, capfd, key, told):
    (tmp_path / "case.toml").write_text(changed(BLOCK, ("density = 8000.0", f"density = 8000.0\n{key}")))
    assert main(["check", str(tmp_path / "case.toml")]) == BAD_INPUT
    assert told in capfd.readouterr().err


def test_a_modulus_in_megapascals(tmp_path, capfd):
    (warning,) = checked(tmp_path, capfd, changed(BLOCK, ("young = 2e11", "young = 2e5")))["warnings"]
    assert warning.startswith("units: sound travels at 5 m/s in 'default', as when young is in MPa (then 2e+11 Pa)")


def test_a_casing_of_implausible_friction(tmp_path, capfd):
    tables = DAMPED | {"friction_damper": [{"normal_force": 1.0, "friction": 3.0}]}
    assert warned(tmp_path, capfd, tables, "friction_damper[0].friction: 3 is implausible")


def test_gaps_of_a_study_that_no_machine_cuts(tmp_path, capfd):
    study = DAMPED | {"time": {"periods": 1500, "transient": 700}}
    amplitude = checked(tmp_path, capfd, DAMPED)["resonance_amplitude"]
    for gap, width, told in (
        (9e-6, 0.0, "a gap of 9 um is below 10 um, what"), (3e-5, 0.0, ""), (3e-5, 0.2, ""),
        (3e-5, 0.1, "at its lower bound, a tolerance of +-3 um is below +-5 um, what"),
    ):  # fmt: skip
        table = {
            "band": [2380.0, 2400.0], "variables": {"gap_ratio": [gap / amplitude, 9.0]}, "tolerances": {"gap": width},
        }  # fmt: skip
        found = warned(tmp_path, capfd, study | {"optimise": table}, "optimise.variables.gap_ratio: at its lower")
        assert bool(found) is bool(told) and all(told in text for text in found)


@pytest.mark.parametrize(("scale", "told"), [(1.0, False), (1e3, True)])
def test_a_mesh_in_millimetres(tmp_path, capfd, scale, told):
    case = changed(CLUSTER, ("degree = 2", f"degree = 2\nscale = {scale}"))
    found = checked(tmp_path, capfd, case)
    assert any("mesh.scale = 1e-3" in text for text in found["warnings"]) is told
    assert found["extent"] == pytest.approx(0.0759885 * scale, rel=1e-4)


def test_a_study_that_leaves_bodies_out(tmp_path, capfd):
    two = DAMPED | {
        "damper": [{"cavity": "c1", "mass": 0.0015, "friction": MU, "position": place} for place in (-5e-6, 5e-6)]
    }
    study = two | {"time": {"periods": 1500, "transient": 700}}
    for given, told in (({}, True), ({"variables": {"bodies": 1}}, False)):
        tables = study | {"optimise": {"band": [2380.0, 2400.0], **given}}
        assert bool(warned(tmp_path, capfd, tables, "optimise.variables.bodies")) is told
