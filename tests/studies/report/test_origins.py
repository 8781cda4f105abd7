"""Results of several models and devices."""

import re
from dataclasses import replace

import pytest

from tests.tools.input_files import DAMPED_BLOCK, changed
from vanedamp.coupling.sweep.record import Sweep
from vanedamp.studies.cli import main
from vanedamp.studies.report.page import write_report
from vanedamp.studies.report.results import collect

SCENE = """
structure = {model = "rom", file = "FILE.h5"}
excitation = {frequency = 830.0, force = 1.0, at = "tip"}
cavity = [{name = "c1", gap = 4e-5, floor = "tip"}]
damper = [{cavity = "c1", mass = 0.001, friction = 0.3, restitution = 0.6}]
sweep = {"excitation.frequency" = [820.0, 830.0]}
"""
NAMES = {"on_case), c1.gap = 40": ", force = 1 N", "narrow), c1.gap = 20": ", force = 1 N", "forces), c1.gap = 40": ""}
TUNE = '[calibration.tune]\nfrequencies = [850.0]\nmodes = [0]\nvary = ["material.default"]\n'


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("origins")

    def run(command, name, source, *options):
        assert main([command, f"{folder}/{source}.toml", "-o", f"{folder}/{name}.h5", *options]) == 0

    (folder / "case.toml").write_text(DAMPED_BLOCK + TUNE)
    (folder / "finer.toml").write_text(changed(DAMPED_BLOCK, ("[6, 2, 1]", "[8, 2, 1]")))
    run("calibrate", "calibration", "case", "--case", f"{folder}/tuned.toml", "--scene", f"{folder}/rigid.toml")
    run("sweep", "rigid", "rigid")
    for case in ("case", "tuned", "finer"):
        run("modal", f"modes_{case}", case)
        run("reduce", f"rom_{case}", case, "--modes", "1")
    scene, tuned = (SCENE.replace("FILE", f"rom_{case}") for case in ("case", "tuned"))
    scenes = {"on_case": scene, "on_tuned": tuned, "narrow": changed(scene, ("4e-5", "2e-5"))}
    for name, text in (
        scenes | {"forces": changed(scene, ('frequency" = [820.0, 830.0]', 'force" = [0.5, 1.0]'))}
    ).items():
        (folder / f"{name}.toml").write_text(text)
        run("sweep", name, name)
    replace(Sweep.load(folder / "on_case.h5"), provenance={}).save(folder / "old.h5")
    return folder


def page(folder, *names):
    write_report(collect([folder / f"{name}.h5" for name in names]), folder / "report.html")
    text = (folder / "report.html").read_text(encoding="utf-8")
    note = "".join(re.findall(r'<div class="apart">.*?</div>', text, re.DOTALL))
    lines = re.findall(r"<(?:li|p)>(.*?)</(?:li|p)>", note)
    curves = {name: colour for colour, name in re.findall(r'background: (#\w+)"></span> (.*?)</label>', text)}
    return re.findall("<h2[^>]*>(.*?)</h2>", text), lines, curves


def test_no_word_of_what_belongs_together(folder):
    headings, lines, curves = page(folder, "calibration", "modes_tuned", "rom_tuned", "on_tuned")
    assert (headings[1], lines, [*curves]) == ("Modes", [], ["reduced model"])
    assert page(folder, "modes_tuned", "rigid")[1] == []


def test_untuned_modes(folder):
    headings, lines, curves = page(folder, "modes_case", "calibration", "on_tuned")
    untuned, tuned = "young = 2e+11, before calibration.h5", lines[2].rpartition(": ")[2]
    assert lines[1:] == [f"modes_case.h5: {untuned}", f"calibration.h5, on_tuned.h5: {tuned}"]
    assert tuned.endswith(", as calibrated")
    assert (headings[1], [*curves]) == (f"Modes: {untuned}", [f"reduced model, {tuned}"])


def test_meshes_are_named(folder):
    headings, (_, *lines), curves = page(folder, "modes_finer", "on_case")
    finer, mine = (re.fullmatch(r"\w+.h5: (mesh \S+ \(\w{8}\))", line)[1] for line in lines)
    assert finer != mine
    assert (headings[1], [*curves]) == (f"Modes: {finer}", [f"reduced model, {mine}"])


def test_a_device_has_one_colour(folder):
    _, lines, curves = page(folder, "on_case", "narrow", "forces")
    wide, narrow, along = (curves[f"reduced model ({name} µm{force}"] for name, force in NAMES.items())
    assert (lines, along) == ([], wide)
    assert wide != narrow


def test_nothing_is_guessed(folder):
    told = "Whether old.h5 belongs to modes_case.h5 is not known: the files do not tell."
    assert page(folder, "modes_case", "old")[1] == [told]
