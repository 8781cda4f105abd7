"""`vanedamp modal`: what a case can ask for, beyond the clamped structure and its lowest modes."""

import json

import numpy as np
import pytest

from tests.tools.input_files import BLOCK, changed
from vanedamp.modal.records.modes import Modes
from vanedamp.studies.cli import BAD_INPUT, main
from vanedamp.studies.report.page import write_report
from vanedamp.studies.report.results import collect

CASE = BLOCK.replace("count = 6", "count = 8")


def modal(folder, capfd, *changes):
    """The result of a changed case as data, and what was written to standard error."""
    (folder / "case.toml").write_text(changed(CASE, *changes))
    arguments = ["modal", str(folder / "case.toml"), "-o", str(folder / "modes.h5"), "--json", "-"]
    status = main(arguments)
    captured = capfd.readouterr()
    return (json.loads(captured.out) if status == 0 else status), captured.err


@pytest.fixture(scope="module")
def clamped(tmp_path_factory):
    folder = tmp_path_factory.mktemp("clamped")
    (folder / "case.toml").write_text(CASE)
    assert main(["modal", str(folder / "case.toml"), "--json", str(folder / "modes.json")]) == 0
    return json.loads((folder / "modes.json").read_text())


def test_no_warnings_without_need(clamped):
    assert clamped["warnings"] == []


def test_free_structure(tmp_path, capfd):
    result, told = modal(tmp_path, capfd, ('clamped = ["root"]', ""))
    frequencies = result["frequency_hz"]
    assert max(frequencies[:6]) < 1e-3
    assert frequencies[6] > 1000.0
    # six rigid modes carry all mass, along every axis
    assert np.sum(result["effective_mass"][:6], axis=0) == pytest.approx(result["movable_mass"], rel=1e-6)
    assert (result["first_bending"], result["rigid"]) == (None, None)
    assert "6 rigid modes carry the mass" in result["warnings"][0]
    assert told.count("\n") == 1
    assert "warning: modes: no first bending" in told
    write_report(collect([str(tmp_path / "modes.h5")]), tmp_path / "report.html")
    assert "None of these modes is a first bending" in (tmp_path / "report.html").read_text()


def test_modes_without_factors(tmp_path, capfd, clamped):
    """By the case, and by the option, which comes first."""
    known = clamped["frequency_hz"]
    assert clamped["solver"]["name"] == "factor" and clamped["solver"]["counted"]
    assert clamped["solver"]["factor_bytes"] < clamped["solver"]["memory_bytes"]
    result, told = modal(tmp_path, capfd, ("count = 8", 'count = 8\nsolver = "iterative"'))
    assert result["frequency_hz"] == pytest.approx(known, rel=1e-8)
    assert result["solver"] == {"name": "iterative", "counted": False}
    assert "only factors prove that there is none" in result["warnings"][0]
    assert told.count("\n") == 1
    assert not Modes.load(tmp_path / "modes.h5").counted
    case = str(tmp_path / "case.toml")
    assert main(["modal", case, "--solver", "factor", "--json", "-"]) == 0
    assert json.loads(capfd.readouterr().out)["solver"] == {"name": "factor", "counted": True}


def test_a_solver_that_does_not_exist(tmp_path, capfd):
    status, told = modal(tmp_path, capfd, ("count = 8", 'count = 8\nsolver = "lobpcg"'))
    assert status == BAD_INPUT and told.count("\n") == 1
    assert "modes.solver" in told and "'iterative'" in told
    with pytest.raises(SystemExit, match="2"):
        main(["modal", str(tmp_path / "case.toml"), "--solver", "lobpcg"])
    assert "--solver" in capfd.readouterr().err


def test_range_of_frequencies(tmp_path, capfd, clamped):
    known = clamped["frequency_hz"]
    low, high = 0.5 * (known[1] + known[2]), 0.5 * (known[5] + known[6])
    result, _ = modal(tmp_path, capfd, ("count = 8", f"min_frequency = {low}\nmax_frequency = {high}"))
    assert result["frequency_hz"] == pytest.approx(known[2:6], rel=1e-8)
    assert Modes.load(tmp_path / "modes.h5").frequencies_hz == pytest.approx(known[2:6], rel=1e-8)


def test_beam_on_an_elastic_root(tmp_path, capfd):
    """First-order change of w^2 by the root's springs: moment^2 / k_turn + force^2 / k_shift of the clamped mode.

    Euler and Bernoulli's mode, L b = 1.8751041 and s = 0.7340955, has 2 E I b^2 and 2 s E I b^3 there, against
    E I b^4 L of strain energy (Blevins 1979, table 8-1).
    """
    springs = "[support.elastic.root]\nnormal = 1e15\ntangential = 1e15"
    bar = ("poisson = 0.3", "poisson = 0.0")
    clamped, _ = modal(tmp_path, capfd, bar)
    held, _ = modal(tmp_path, capfd, bar, ('[support]\nclamped = ["root"]', springs))
    rigid, elastic = (result["frequency_hz"][result["first_bending"]] for result in (clamped, held))
    area, second_moment, length = 0.02 * 0.01, 0.02 * 0.01**3 / 12, 0.1
    turn, shift = 1e15 * second_moment, 1e15 * area
    bending = 2e11 * second_moment / length
    expected = 4.0 * bending / turn + 4.0 * (0.7340955 * 1.8751041 / length) ** 2 * bending / shift
    assert (rigid / elastic) ** 2 - 1.0 == pytest.approx(expected, rel=0.03)


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("young = 2e11", "young = 2e5", "sound travels at 5 m/s in 'default', as when young is in MPa (then 2e+11 Pa)"),
        ("density = 8000.0", "density = 80.0", "sound travels at 5e+04 m/s in 'default'"),
    ],
)
def test_wrong_units_are_told(old, new, told, tmp_path, capfd):
    result, error = modal(tmp_path, capfd, (old, new), ("thickness = 0.01", "thickness = 0.002"))
    assert told in result["warnings"][0]
    assert "mesh in m, young in Pa, density in kg/m^3" in error
    assert error.count("\n") == 1


def test_unknown_group_of_springs(tmp_path, capfd):
    status, error = modal(tmp_path, capfd, ('clamped = ["root"]', "elastic.rot.stiffness = 1e12"))
    assert status == BAD_INPUT
    assert "case.toml: support.elastic.rot: no facet group 'rot' in the mesh; it has bottom, left, right, root" in error
    assert not (tmp_path / "modes.h5").exists()


def test_inverted_and_loose_meshes(tmp_path, capfd):
    """A mesh file whose elements are turned inside out, or tied to nothing, ends in one line."""
    header = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n8\n"
    points = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (3, 0, 0), (4, 0, 0), (3, 1, 0), (3, 0, 1)]
    nodes = "".join(f"{i} {x} {y} {z}\n" for i, (x, y, z) in enumerate(points, start=1))
    for order, told in (("5 6 7 8", "falls into 2 parts that share no node"), ("5 7 6 8", "negative volume")):
        elements = f"$EndNodes\n$Elements\n2\n1 4 2 1 1 1 2 3 4\n2 4 2 2 2 {order}\n$EndElements\n"
        (tmp_path / "bad.msh").write_text(header + nodes + elements)
        mesh = CASE[CASE.index("generator") : CASE.index("[material")]
        status, error = modal(tmp_path, capfd, (mesh, 'file = "bad.msh"\n'))
        assert status == BAD_INPUT
        assert error.count("\n") == 1
        assert "bad.msh" in error
        assert told in error


def test_mesh_without_names(tmp_path, capfd):
    """A mesh whose facets are in no group cannot be held by one."""
    header = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n4\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n$EndNodes\n"
    (tmp_path / "plain.msh").write_text(header + "$Elements\n1\n1 4 2 0 1 1 2 3 4\n$EndElements\n")
    mesh = CASE[CASE.index("generator") : CASE.index("[material")]
    status, error = modal(tmp_path, capfd, (mesh, 'file = "plain.msh"\n'))
    assert status == BAD_INPUT
    assert "support.clamped: no facet group 'root' in the mesh; it has none" in error


def test_reduction_of_a_structure_on_springs(tmp_path, capfd):
    """The reduced model keeps the frequencies, with no clamp to hold it."""
    springs = "[support.elastic.root]\nstiffness = [1e13, 2e13, 3e13]"
    full, _ = modal(tmp_path, capfd, ('[support]\nclamped = ["root"]', springs))
    assert main(["reduce", str(tmp_path / "case.toml"), "--json", "-", "--modes", "8"]) == 0
    reduced = json.loads(capfd.readouterr().out)
    assert reduced["frequency_hz"][:3] == pytest.approx(full["frequency_hz"][:3], rel=1e-6)


def test_motion_of_a_cavity(tmp_path, capfd):
    """As printed and in JSON, record and report: the keys that a scene's [[cavity]] takes."""
    patch = ('facets = "tip"\ndirection = [0, 0, 1]', 'facets = "tip"\ndirection = [0, 0, 1]\nkind = "patch"')
    result, _ = modal(tmp_path, capfd, patch)
    motion = result["cavity"]["tip"]
    assert motion["along"] == pytest.approx(1.0, rel=1e-12)
    # a cantilever's first bending: the tip's slope is 1.3765 of deflection over length (Euler and Bernoulli); shear and
    # the coarse mesh take some percent
    assert motion["rotation"] == pytest.approx(-1.3765 / 0.1, rel=0.05)
    # the tip lies above the beam's axis as much as below it
    assert abs(motion["normal_motion"]) < 1e-3
    assert main(["modal", str(tmp_path / "case.toml")]) == 0
    printed = f"normal_motion = {motion['normal_motion']:.5g}, rotation = {motion['rotation']:.5g} rad/m"
    assert f"cavity tip: moves by 1 of tip, {printed}" in capfd.readouterr().out
    assert main(["calibrate", str(tmp_path / "case.toml"), "--json", str(tmp_path / "calibration.json")]) == 0
    assert json.loads((tmp_path / "calibration.json").read_text())["cavity"] == {"tip": pytest.approx(motion)}
    assert printed in capfd.readouterr().out
    write_report(collect([str(tmp_path / "modes.h5")]), tmp_path / "report.html")
    assert f"<td>{motion['rotation']:.5g}</td>" in (tmp_path / "report.html").read_text()


def test_a_mode_that_leaves_a_cavity_alone_tells_nothing_of_it(tmp_path, capfd):
    """A plane of motion that the bending of a symmetric mesh does not move."""
    side = '[interface.side]\nfacets = "tip"\ndirection = [0, 1, 0]\nkind = "patch"\nnormal = [1, 0, 0]\n'
    result, _ = modal(
        tmp_path,
        capfd,
        ("count = 8", 'count = 8\nat = "tip"'),
        ("thickness", "hexahedra = true\nthickness"),
        ("[interface.tip]", side + "[interface.tip]"),
    )
    assert result["rigid"] is not None
    assert result["cavity"] == {}
