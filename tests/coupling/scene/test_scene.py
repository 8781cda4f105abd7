"""Scene files: every mistake gets one line that names the key and the remedy."""

import copy
import re

import pytest

from vanedamp.coupling.scene.paths import number_at
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.sweep.grid import grid
from vanedamp.files.toml_input import InputError, validate

GOOD = {
    "structure": {"model": "rigid", "mass": 0.148, "stiffness": 3.4e7, "damping_ratio": 0.002},
    "excitation": {"frequency": 2414.0, "force": 1.0},
    "cavity": [{"name": "c1", "gap": 2e-5}, {"name": "c2", "gap": 1e-5}],
    "damper": [
        {"cavity": "c1", "mass": 0.003, "friction": 0.4, "restitution": 0.7},
        {"cavity": "c2", "mass": 0.002, "position": -4e-6},
        {"cavity": "c2", "mass": 0.002, "position": 4e-6},
    ],
    "sweep": {"excitation.frequency": {"start": 2350.0, "stop": 2450.0, "num": 3}, "cavity.c1.gap": [2e-5, 1e-5]},
}


def put(path, value):
    def change(data):
        *steps, last = path
        for step in steps:
            data = data[step]
        if value is None:
            del data[last]
        else:
            data[last] = value

    return change


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (put(["damper", 0, "mass"], -1.0), r"damper\[0\].mass: should be greater than 0 \(got -1.0\)"),
        (put(["cavity", 0, "gap"], 0.0), r"cavity\[0\].gap: should be greater than 0"),
        (put(["damper", 0, "restitution"], 1.2), r"damper\[0\].restitution: should be less than or equal to 1"),
        (put(["damper", 0, "friktion"], 0.4), r"damper\[0\].friktion: unknown key; did you mean 'friction'\?"),
        (put(["exitation"], {}), "exitation: unknown key; did you mean 'excitation'"),
        (put(["structure", "mass"], None), "structure.mass: missing"),
        (put(["structure", "mass"], "1"), "structure.mass: should be a valid number"),
        (put(["structure", "model"], "rigit"), "structure.model: must be one of 'prescribed', 'rigid', 'rom'"),
        (put(["structure", "damping"], 1.0), "structure: give one of damping_ratio and damping"),
        (put(["excitation", "frequency"], float("nan")), "excitation.frequency: should be a finite number"),
        (put(["excitation", "base_acceleration"], 1.0), "excitation: give at most one of force"),
        (put(["damper", 1, "cavity"], "c3"), r"damper\[1\].cavity: no cavity 'c3'; known: c1, c2"),
        (put(["damper", 0, "position"], 1.1e-5), r"damper\[0\].position: 1.1e-05 lies outside cavity 'c1'"),
        (put(["damper", 2, "position"], -5e-6), r"damper\[2\].position: overlaps the body before it"),
        (put(["time"], {"periods": 10, "transient": 10}), r"time: transient \(10\) must be less than periods"),
        (put(["gravity"], {"orientation_deg": 120.0}), r"damper\[0\]: gravity lifts the body off the floor"),
        (put(["cavity", 1, "name"], "c1"), "cavity: the name 'c1' is used twice"),
        *(
            (
                put(["cavity", 1, "name"], name),
                r"cavity\[1\].name: expected a word of at most 200 characters that is no",
            )
            for name in ("", ".", "a/b", "/", "a.b", "1", "gap", "a\0b", "a\nb", "x" * 201)
        ),
        (
            put(["sweep"], {"cavity.c1.scatter.gap": [0.1], "cavity.c1_scatter.gap": [1e-5]}),
            r"sweep.cavity.c1_scatter.gap: files have _ for dots, which makes it cavity.c1.scatter.gap; rename the",
        ),
    ],
)
def test_mistakes_are_named(change, message):
    data = copy.deepcopy(GOOD)
    change(data)
    with pytest.raises(InputError, match="^scene.toml: " + message) as error:
        validate(Scene, data, "scene.toml")
    assert "\n" not in str(error.value)


def test_replace_by_dotted_path():
    scene = validate(Scene, GOOD, "scene.toml")
    changed = scene.replace({"cavity.c1.gap": 5e-6, "damper.friction": 0.1, "damper.2.mass": 1.0})
    assert [cavity.gap for cavity in changed.cavity] == [5e-6, 1e-5]
    assert [damper.friction for damper in changed.damper] == [0.1, 0.1, 0.1]
    assert [damper.mass for damper in changed.damper] == [0.003, 0.002, 1.0]
    assert scene.replace({}) == scene
    with pytest.raises(InputError, match="no entry 'c9'; known: c1, c2"):
        scene.replace({"cavity.c9.gap": 1.0})
    with pytest.raises(InputError, match=r"damper.7.mass: there are only 3 entries"):
        scene.replace({"damper.7.mass": 1.0})
    with pytest.raises(InputError, match="no table 'excitations'; did you mean 'excitation'"):
        scene.replace({"excitations.frequency": 1.0})
    with pytest.raises(InputError, match=r"excitation.frequenc: unknown key; did you mean 'frequency'"):
        scene.replace({"excitation.frequenc": 1.0})
    with pytest.raises(InputError, match=r"excitation.frequency.0: no table holds '0'; leave it out"):
        scene.replace({"excitation.frequency.0": 1.0})


def test_numbers_that_are_not_there_are_named():
    data = {"damper": [{"mass": 1.0}, {"mass": 1.0}], "stop": [], "rotation": {"point": [0.0, 1.0]}}
    assert number_at(data, "damper.mass") == 1.0
    for path, told in {
        "damper.mas": "the scene holds no 'mas' there; did you mean 'mass'?", "stop.gap": "names no number",
        "damper.0": "names a table, not a value", "rotation.point.0": "no table holds '0'; leave it out",
    }.items():  # fmt: skip
        with pytest.raises(InputError, match=re.escape(f"scene: {path}: {told}")):
            number_at(data, path)


def test_sweep_is_the_product_of_its_axes():
    points = grid(validate(Scene, GOOD, "scene.toml"))
    assert list(points.axes) == ["excitation.frequency", "cavity.c1.gap"]
    assert points.values(0) == {"excitation.frequency": 2350.0, "cavity.c1.gap": 2e-5}
    assert points.values(5) == {"excitation.frequency": 2450.0, "cavity.c1.gap": 1e-5}
    assert points.size == 6


def test_broken_files(tmp_path):
    with pytest.raises(InputError, match=r"absent.toml: no such file"):
        Scene.load(tmp_path / "absent.toml")
    (tmp_path / "broken.toml").write_text("[structure\nmodel = 1")
    with pytest.raises(InputError, match=r"broken.toml: not valid TOML"):
        Scene.load(tmp_path / "broken.toml")
