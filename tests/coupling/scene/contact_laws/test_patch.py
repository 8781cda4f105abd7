"""`stiffness = "patch"` against finite elements of a block bonded on a wall."""

import numpy as np
import pytest
from scipy.sparse.linalg import splu

import vanedamp as vd
from tests.tools.block_on_wall_mesh import write_block_on_wall
from vanedamp.coupling.system.assembly import assemble
from vanedamp.files.toml_input import InputError, validate
from vanedamp.modal.elasticity import Material, Solid
from vanedamp.rom.interface import Interface, InterfaceCoordinate
from vanedamp.rom.reduction import reduce

YOUNG, MODES = 2.1e11, 3
STEEL, LIGHT = Material(YOUNG, 0.3, 7800.0), Material(YOUNG, 0.3, 1e-6)


def scene(file, contact, **structure):
    data = {
        "structure": {"model": "rom", "file": str(file)} | structure,
        "excitation": {"frequency": 1000.0, "force": 1.0, "at": "patch"},
        "cavity": [{"name": "c", "gap": 1e-4, "floor": "patch"}], "damper": [{"cavity": "c", "mass": 0.01}],
        "contact": {"law": "compliant"} | contact,
    }  # fmt: skip
    return validate(vd.Scene, data, "scene.toml")


@pytest.mark.parametrize(("block", "measured"), [((0.01, 0.01, 0.01), 0.90), ((0.03, 0.01, 0.01), 0.94)])
def test_a_block_pressed_on_a_wall(tmp_path, block, measured):
    """The block's inertia presses it: displacement of its centre of mass less the part of the wall's kept modes.

    The patch carries a constant traction, and the block is a column: stresses in equilibrium, so that the flexibility
    is an upper bound (least complementary energy), and the stiffness a lower one.
    """
    write_block_on_wall(tmp_path, block, 0.007, 0.003)
    wall = Solid(tmp_path / "wall.msh", {"default": STEEL}).assemble({"clamp": "xyz"}, 0.002)
    both = Solid(tmp_path / "both.msh", {"default": LIGHT, "block": STEEL}).assemble({"clamp": "xyz"}, 0.002)
    interface = Interface.on_patches(wall, [InterfaceCoordinate("patch", "patch", (1, 0, 0))])
    model = reduce(wall, interface, "macneal", MODES)
    model.save(tmp_path / "rom.h5")
    inertia = (both.mass @ both.rigid_translations()[:, 0])[both.free]
    load = inertia / inertia.sum()
    stiffness = both.stiffness.tocsr()[both.free][:, both.free].tocsc()
    whole = float(load @ splu(stiffness).solve(load))
    squares, shapes = model.natural
    modal = float(((model.row("patch") @ shapes) ** 2 / squares).sum())
    pair = {"young": YOUNG, "length": block[0], "area": block[1] * block[2]}
    system = assemble(scene(tmp_path / "rom.h5", {"stiffness": "patch", "pair": pair}))
    exact = 1.0 / (whole - modal)
    assert np.all(system.spring == system.spring[0])
    assert 0.0 < system.spring[0] / exact < 1.0
    assert system.spring[0] / exact == pytest.approx(measured, abs=0.01)
    (numbers,) = vd.contact(scene(tmp_path / "rom.h5", {"stiffness": "patch", "pair": pair}))
    assert numbers.patch["stiffness"] == pytest.approx(system.spring[0], rel=1e-12)
    assert numbers.patch["wall_flexibility"] == pytest.approx(float(model.residual_flexibility[0, 0]), rel=1e-9)


def test_a_model_without_residual_flexibility_is_rejected(tmp_path):
    model = vd.ReducedModel.from_matrices(
        np.eye(2), np.diag([1e6, 4e6]), {"patch": [1.0, 0.5]}, damping_ratio=0.01,
        directions={"patch": (1, 0, 0)},
    )  # fmt: skip
    model.save(tmp_path / "rom.h5")
    pair = {"young": YOUNG, "length": 0.01, "area": 1e-4}
    with pytest.raises(InputError, match="contact: the reduced model lacks no flexibility at the walls"):
        assemble(scene(tmp_path / "rom.h5", {"stiffness": "patch", "pair": pair}))
