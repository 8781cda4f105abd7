"""`vanedamp contact`: table, picture and JSON of a file and of a scene; bad input in one line."""

import csv
import json
import math

import pytest

import vanedamp as vd
from tests.tools.input_files import SCENE
from vanedamp.studies.cli import BAD_INPUT, main

PAIR = """
mass = 0.0005
preload = 10.0
[pair]
radius = 0.005
young = 2.1e11
yield_strength = 9e8
"""
HERTZ = """
[contact]
law = "compliant"
stiffness = "hertz"
speed = 0.2
[contact.pair]
radius = 0.05
young = 2e11
yield_strength = 9e8
"""


def test_table_picture_and_json(tmp_path, capsys):
    (tmp_path / "pair.toml").write_text(PAIR)
    table, picture, result = (tmp_path / name for name in ("table.csv", "chart.png", "out.json"))
    arguments = ["-o", str(table), "--picture", str(picture), "--json", str(result)]
    assert main(["contact", str(tmp_path / "pair.toml"), *arguments]) == 0
    out = capsys.readouterr().out
    assert "first yield at 0.3045 m/s" in out
    assert "Kharaz, Gorham and Salman 2001" in out
    assert picture.read_bytes()[:4] == b"\x89PNG"
    (found,) = json.loads(result.read_text())["contacts"]
    rows = list(csv.DictReader(table.open()))
    assert len(rows) == len(found["speed"]) == 25
    assert [float(row["force [N]"]) for row in rows] == pytest.approx(found["force"], rel=1e-8)
    # restitution 1 up to first yield, which is in the middle of the table
    left = dict(zip(found["speed"], found["restitution_thornton"], strict=True))
    assert all((value == 1.0) == (speed <= found["yield_speed"] * (1 + 1e-12)) for speed, value in left.items())
    assert found["utilisation"][0] == pytest.approx(0.1**0.4, rel=1e-9)
    assert found["preload"]["stiffness"] == pytest.approx(
        1.5 * 10.0 / vd.Pair(2.1e11, radius=0.005).contact.approach(10.0)
    )


def test_a_scene_has_the_spring_that_its_runs_use(tmp_path, capsys):
    path = tmp_path / "scene.toml"
    path.write_text(SCENE + HERTZ)
    assert main(["contact", str(path), "--speeds", "0.2", "2", "--json", "-"]) == 0
    (found,) = json.loads(capsys.readouterr().out)["contacts"]
    assert found["mass"] == pytest.approx(0.05 / 1.05, rel=1e-12)  # both walls are alike: one record
    scene = vd.Scene.load(path)
    assert found["stiffness_force"][0] == pytest.approx(scene.contact.element(0.6, found["mass"]).stiffness, rel=1e-12)
    assert main(["check", str(path)]) == 0


def test_check_and_python_of_a_pair(tmp_path, capsys):
    path = tmp_path / "pair.toml"
    path.write_text(PAIR)
    assert main(["check", str(path), "--json", "-"]) == 0
    assert json.loads(capsys.readouterr().out)["kind"] == "contact"
    pair = vd.Pair(2.1e11, radius=0.005, yield_strength=9e8)
    (one,), (other,) = vd.contact(path), vd.contact(pair, mass=0.0005, preload=10.0)
    assert one.columns["duration"] == pytest.approx(other.columns["duration"])
    assert "yield_speed: 0.304" in repr(one)
    (flat,) = vd.contact(vd.Pair(2e11, length=0.01, area=2e-5), mass=1.0)
    assert flat.patch == {"body_flexibility": pytest.approx(0.01 / (3 * 2e11 * 2e-5))}
    (rubber,) = vd.contact(vd.Pair(1e7, radius=0.01, width=0.02, depth=0.01), mass=0.1, speeds=(0.01, 0.1))
    assert not rubber.models
    assert math.isfinite(rubber.columns["duration"][0])


@pytest.mark.parametrize(
    ("text", "options", "message"),
    [
        (PAIR.replace("0.005", "-0.005"), [], "pair.radius: should be greater than 0"),
        (PAIR.replace("mass = 0.0005", ""), [], "mass: missing"),
        (PAIR.replace("radius = 0.005", ""), [], "pair: give the radius of a rounded contact, or length and area"),
        (PAIR.replace("mass = 0.0005", "mass = 1.0\nspeeds = [2.0, 1.0]"), [], "speeds: expected the lower one first"),
        (PAIR, ["--speeds", "2", "1"], "--speeds: expected the lower one first, not 2 1"),
        (PAIR, ["-o", "table.txt"], "expected a file name ending in .csv"),
        (SCENE, [], "contact.pair: missing; give young and radius"),
        (PAIR.replace("radius = 0.005", "radius = 0.01\nwidth = 0.01\ndepth = 1e-5"), [], "as wide as the bodies"),
        (PAIR.replace("radius = 0.005", "length = 0.01\narea = 1e-5"), ["-o", "t.csv"], "has no table over the speed"),
    ],
)  # fmt: skip
def test_bad_input_is_one_line(tmp_path, capsys, text, options, message):
    (tmp_path / "in.toml").write_text(text)
    options = [str(tmp_path / option) if "." in option and option[0] != "-" else option for option in options]
    assert main(["contact", str(tmp_path / "in.toml"), *options]) == BAD_INPUT
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1
    assert not (tmp_path / "t.csv").exists()
