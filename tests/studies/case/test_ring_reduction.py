"""Reduced ring of a bladed disk's finite elements against the whole ring's, of which the same blades deviate."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from scipy import sparse
from scipy.sparse.linalg import eigsh, splu

from tests.tools.archives import labelled
from tests.tools.rings import whole_ring
from vanedamp.files.store import kind_of
from vanedamp.rom.ring.deviations import Deviations
from vanedamp.rom.ring.ring_model import RingModel
from vanedamp.rom.ring.study import amplification
from vanedamp.studies.case.ring_stages import ring_reduction, ring_sector
from vanedamp.studies.case.stages import assemble, interface
from vanedamp.studies.case.tables import Case
from vanedamp.studies.cli import main

CASE = """
[mesh]
generator = "sector"
sectors = 6
inner_radius = 0.1
outer_radius = 0.16
thickness = 0.02
element_size = 0.03
blade_length = 0.12
blade_thickness = 0.012
degree = 1
[material.default]
young = 2.0e11
poisson = 0.3
density = 7800.0
damping_ratio = 0.001
[support]
clamped = ["bore"]
[ring]
sectors = 6
low = "low"
high = "high"
deviating = ["blade"]
[mistuning.frequency]
std = 0.01
[interface.tip]
facets = "tip"
direction = [0, 1, 0]
"""


@pytest.fixture(scope="module")
def structure(tmp_path_factory):
    path = tmp_path_factory.mktemp("ring") / "case.toml"
    path.write_text(CASE)
    return assemble(Case.load(path))


def modes_of(stiffness, mass, count):
    values, shapes = eigsh(stiffness.tocsc(), count, mass.tocsc(), sigma=0.0, v0=np.ones(mass.shape[0]))
    order = np.argsort(values)
    return values[order], shapes[:, order]


@pytest.mark.parametrize(("size", "basis"), [(0.05, "modes"), (0.3, "modes"), (0.3, "sectors")])
def test_frequencies_and_amplification_of_deviating_blades(structure, size, basis):
    ring, sector = ring_reduction(structure, basis=basis), ring_sector(structure)
    deviations = Deviations(size * np.random.default_rng(1).uniform(-1.0, 1.0, 6))
    part = structure.solid.part(["blade"])
    stiffness, mass, place = whole_ring(sector, part, deviations)
    squares, shapes = modes_of(stiffness, mass, 24)
    tuned = np.sqrt(modes_of(*whole_ring(sector, part)[:2], 6)[0])
    exact, found = np.sqrt(squares), np.sqrt(ring.model(deviations).squares)
    assert np.abs(exact[:6] - tuned).max() > 0.2 * size * tuned[0]
    assert np.abs(found[:6] - exact[:6]).max() < 1e-4 * np.abs(exact[:6] - tuned).max()

    vector = interface(structure.case, sector.matrices).vectors[:, 0]
    tips = np.array([one.T @ vector for one in place])
    load = np.exp(-2j * np.pi * np.arange(6) / 6)
    modal, static = tips @ shapes, splu(sparse.csc_matrix(stiffness)).solve(tips.T)
    rest = tips @ static - (modal / squares) @ modal.T
    low, high = 0.97 * exact[0], 1.03 * exact[5]
    omegas = np.linspace(low, high, 20001)[:, None]
    transfer = 1 / (squares - omegas**2 + 2j * 0.001 * np.sqrt(squares) * omegas)
    response = np.abs((transfer * (modal.T @ load)) @ modal.T + rest @ load)
    band = [low / 2 / np.pi, high / 2 / np.pi]
    one = amplification(ring, deviations, 1, "tip", band)
    assert one.amplitude == pytest.approx(response.max(), rel=1e-3)
    assert one.sector == np.argmax(response.max(axis=0))


@pytest.mark.parametrize("basis", ["modes", "sectors"])
def test_one_blade_that_deviates(structure, basis):
    """No frequency is below the whole ring's, the error is near the estimate, and by sectors it is small."""
    ring, sector, part = (
        ring_reduction(structure, 2, basis=basis),
        ring_sector(structure),
        structure.solid.part(["blade"]),
    )
    told = {each["stiffness"]: each["frequency"] for each in ring.provenance["estimate"]["one_sector"]}
    assert all(f"at {size:+.0%}" in ring.provenance["estimate"]["sentence"] for size in told)
    for size in (0.0, -0.1, -0.3, -0.5, -0.9, 1.0):
        deviations = Deviations(size * np.eye(6)[2])
        exact = modes_of(*whole_ring(sector, part, deviations)[:2], 12)[0]
        errors = np.sqrt(np.sort(ring.model(deviations).squares)[:12] / exact) - 1.0
        assert errors.min() > -1e-11
        if size in told:
            assert 0.2 * told[size] < errors.max() < 2.0 * told[size] or size == -0.9
            assert errors.max() < 2.0 * told[size]
        if basis == "sectors":
            assert errors.max() < (1e-5 if size == -0.9 else 2e-6)


def test_command(tmp_path: Path, capsys):
    case, output = tmp_path / "case.toml", tmp_path / "ring.h5"
    case.write_text(CASE)
    assert main(["reduce", str(case), "-o", str(output), "--families", "2", "--json", "-"]) == 0
    result = json.loads(capsys.readouterr().out)
    ring = RingModel.load(output)
    assert kind_of(output) == "ring-model" and ring.sectors == result["sectors"] == 6 and ring.modes == 12
    np.testing.assert_array_equal(result["frequency_hz"], ring.frequencies_hz)
    assert result["estimate"]["receptance"] < 0.05
    assert main(["info", str(output), "--json", "-"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["sectors"] == 6 and facts["interface"] == ["tip"]
    assert main(["reduce", str(case), "-o", str(output), "--modes", "5"]) == 2
    assert "--families" in capsys.readouterr().err
    assert main(["reduce", str(case), "-o", str(output), "--basis", "rubin"]) == 2
    assert "basis: expected one of modes, sectors" in capsys.readouterr().err
    assert main(["reduce", str(case), "-o", str(output), "--basis", "sectors", "--json", "-"]) == 0
    assert kind_of(output) == "ring-sectors"


def test_a_group_that_deviates_of_an_abaqus_mesh(structure, tmp_path: Path):
    """The blade has the default material and is named by [ring] only; the mesh of the generator, written as .inp."""
    case = tmp_path / "case.toml"
    case.write_text(CASE)
    assert main(["mesh", str(case), "-o", str(tmp_path / "disk.msh")]) == 0
    mesh = labelled(tmp_path / "disk.msh")
    lines = ["*NODE", *(", ".join(map(repr, (label, *place.tolist()))) for label, place in mesh.nodes.items())]
    for name, labels in mesh.element_sets.items():
        for label in labels:
            kind, nodes = mesh.elements[label]
            if kind == "hexahedron":
                lines += [f"*ELEMENT, TYPE=C3D8, ELSET={name}", ", ".join(map(str, (label, *nodes)))]
            else:
                lines += [f"*NSET, NSET={name}", ", ".join(map(str, nodes))]
    (tmp_path / "disk.inp").write_text("\n".join(lines) + "\n")
    case.write_text('[mesh]\nfile = "disk.inp"\ndegree = 1\n' + CASE[CASE.index("[material") :])
    deviations = Deviations(-0.3 * np.eye(6)[1])
    found, expected = (ring_reduction(one, 2) for one in (assemble(Case.load(case)), structure))
    np.testing.assert_allclose(found.model(deviations).squares, expected.model(deviations).squares, rtol=1e-6)


@pytest.mark.parametrize(
    ("given", "put", "message"),
    [
        ('deviating = ["blade"]', 'deviating = ["vane"]', "ring.deviating"),
        ('[ring]\nsectors = 6\nlow = "low"\nhigh = "high"\ndeviating = ["blade"]', "", "mistuning: deviations are"),
    ],
)
def test_wrong_input_in_a_line(tmp_path: Path, capsys, given, put, message):
    case = tmp_path / "case.toml"
    case.write_text(CASE.replace(given, put))
    assert main(["reduce", str(case), "-o", str(tmp_path / "ring.h5")]) == 2
    error = capsys.readouterr().err
    assert message in error and error.count("\n") == 1
