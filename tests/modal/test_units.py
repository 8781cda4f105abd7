"""Slips of units are told or refused, parts that exist are not; a gmsh mesh may be in millimetres."""

import json

import gmsh
import numpy as np
import pytest

from tests.tools.input_files import BLOCK, changed
from vanedamp.meshes.benchmarks import TaperedBlock, build
from vanedamp.modal.elasticity import ElasticityError, Material, Solid
from vanedamp.modal.msh import session
from vanedamp.modal.units import absurdity, doubts, model_doubts, strength_absurdity
from vanedamp.studies.cli import BAD_INPUT, main

# E in Pa, rho in kg/m^3 (Ashby, Materials Selection in Mechanical Design, 2011, appendix A)
SOLIDS = {
    "steel": (2.1e11, 7850.0), "titanium": (1.14e11, 4430.0), "lead": (1.4e10, 11350.0), "diamond": (1.2e12, 3500.0),
    "carbon fibre": (1.4e11, 1550.0), "balsa": (2.0e9, 180.0), "rubber": (1e7, 1200.0), "tungsten": (4.1e11, 19300.0),
}  # fmt: skip


@pytest.mark.parametrize("name", SOLIDS)
def test_solids_that_exist_pass(name):
    assert absurdity(*SOLIDS[name]) is None
    assert doubts({name: SOLIDS[name]}, 0.1, 0.5, 2414.0) == ()


@pytest.mark.parametrize(
    ("young", "density", "told"),
    [
        (2.1e11, 7.85e-9, "density: no solid has 7.85e-09 kg/m^3; 7850 kg/m^3, if this is in t/mm^3"),
        (2.1e5, 7.85e-9, "density: no solid has 7.85e-09 kg/m^3"),
        (2.1e11, 7.85, "density: sound would travel at 1.64e+05 m/s; 7850 kg/m^3, if the density is in g/cm^3"),
        (210.0, 7850.0, "young: sound would travel at 0.164 m/s; 2.1e+11 Pa, if the modulus is in GPa"),
        (2.1e14, 7850.0, "young: no solid has 2.1e+14 Pa"),
    ],
)
def test_solids_that_cannot_exist(young, density, told):
    assert absurdity(young, density).startswith(told)


@pytest.mark.parametrize(
    ("strength", "young", "told"),
    [
        # fatigue strength of steel; tensile strengths of concrete, rubber, rock wool (Ashby, appendix A)
        (4e8, 2.1e11, None), (2e6, 3e10, None), (2.5e7, 2e6, None), (1e4, 1e6, None),
        (400.0, 2.1e11, "400 Pa is 1.9e-09 times Young's modulus (2.1e+11 Pa), as when the strength is in MPa"),
        (4e8, 2.1e5, "4e+08 Pa is 1.9e+03 times Young's modulus (2.1e+05 Pa), as when young is in MPa"),
    ],
)  # fmt: skip
def test_strengths_in_other_units_than_moduli(strength, young, told):
    assert strength_absurdity(strength, young) == told


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"materials": {"blade": (2.1e5, 7850.0)}}, "sound travels at 5.17 m/s in 'blade', as when young is in MPa"),
        ({"size": 67.0}, "the mesh measures 67 m; of a mesh in millimetres, set mesh.scale = 1e-3"),
        ({"size": 6.7e-5}, "the mesh measures 6.7e-05 m"),
        ({"mass": 5e8}, "the mass is 5e+08 kg"),
        ({"first_hz": 0.3}, "the first frequency is 0.3 Hz"),
    ],
)
def test_one_slip_is_told_in_one_line(changes, told):
    values = {"materials": {"blade": SOLIDS["steel"]}, "size": 0.067, "mass": 0.5, "first_hz": 2414.0} | changes
    (line,) = doubts(**values)
    assert line.startswith(told)
    assert line.endswith("; check the units: mesh in m, young in Pa, density in kg/m^3")


def test_reduced_models():
    assert model_doubts(0.148, 2414.0) == ()
    assert model_doubts(np.inf, 2414.0) == ()
    assert "set matrices.mass_scale = 1e3" in model_doubts(0.148e-3, 2414.0)[0]
    assert "the first frequency is 0.2 Hz" in model_doubts(0.148, 0.2)[0]


@pytest.fixture(scope="module")
def millimetres(tmp_path_factory):
    """The block with its coordinates in millimetres."""
    folder = tmp_path_factory.mktemp("millimetres")
    path = build(TaperedBlock(0.1, 0.02, 0.01, divisions=(6, 2, 1)), folder / "block.msh")
    with session("scale"):
        gmsh.merge(str(path))
        gmsh.model.mesh.affineTransform([1e3, 0, 0, 0, 0, 1e3, 0, 0, 0, 0, 1e3, 0])
        gmsh.write(str(folder / "mm.msh"))
    return folder / "mm.msh"


def modal(folder, capfd, mesh):
    text = BLOCK[: BLOCK.index("generator")] + mesh + BLOCK[BLOCK.index("[material") :]
    (folder / "case.toml").write_text(text)
    assert main(["modal", str(folder / "case.toml"), "--json", "-"]) == 0
    captured = capfd.readouterr()
    return json.loads(captured.out), captured.err


def test_a_gmsh_mesh_in_millimetres(millimetres, tmp_path, capfd):
    (tmp_path / "block.toml").write_text(BLOCK)
    assert main(["modal", str(tmp_path / "block.toml"), "--json", "-"]) == 0
    metres = json.loads(capfd.readouterr().out)
    scaled, error = modal(tmp_path, capfd, f'file = "{millimetres}"\nscale = 1e-3\n')
    assert error == ""
    assert scaled["frequency_hz"] == pytest.approx(metres["frequency_hz"], rel=1e-8)
    assert scaled["rigid"]["mass"] == pytest.approx(metres["rigid"]["mass"], rel=1e-8)
    plain, error = modal(tmp_path, capfd, f'file = "{millimetres}"\n')
    assert plain["warnings"][0] in error
    assert "the mesh measures 100 m; of a mesh in millimetres, set mesh.scale = 1e-3; the mass is 1.6e+08 kg" in error


def test_patches_of_a_scaled_mesh_are_in_square_metres(millimetres):
    steel = {"default": Material(2e11, 0.3, 8000.0)}
    tip = Solid(millimetres, steel, scale=1e-3).assemble({"root": "xyz"}, 0.0).patches["tip"]
    assert tip.area == pytest.approx(0.02 * 0.01, rel=1e-9)
    with pytest.raises(ElasticityError, match="scale: expected a positive number"):
        Solid(millimetres, steel, scale=-1.0)


def test_an_absurd_material_is_refused_with_its_key(tmp_path, capfd):
    (tmp_path / "case.toml").write_text(changed(BLOCK, ("density = 8000.0", "density = 8e-9")))
    assert main(["modal", str(tmp_path / "case.toml")]) == BAD_INPUT
    error = capfd.readouterr().err
    assert "case.toml: material.default.density: no solid has 8e-09 kg/m^3; 8000 kg/m^3, if this is in t/mm^3" in error
    assert error.count("\n") == 1


def test_reductions_tell_units_too(tmp_path, capfd):
    (tmp_path / "case.toml").write_text(
        changed(BLOCK, ("young = 2e11", "young = 2e5"), ("density = 8000.0", "density = 8000.0\ndamping_ratio = 0.01"))
    )
    assert main(["reduce", str(tmp_path / "case.toml"), "--modes", "4", "--json", "-"]) == 0
    captured = capfd.readouterr()
    assert "as when young is in MPa" in json.loads(captured.out)["warnings"][0]
    assert "as when young is in MPa" in captured.err
