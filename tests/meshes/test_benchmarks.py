"""Blocks: named faces where they should be, with the areas of the drawing."""

import pytest

from vanedamp.meshes.benchmarks import TaperedBlock, build
from vanedamp.meshes.vane_cluster import ParameterError
from vanedamp.modal.elasticity import Material, assemble

UNIT_DENSITY = {"default": Material(young=1.0, poisson=0.25, density=1.0)}

SHAPES = [
    TaperedBlock(2.0, 0.4, 0.3, divisions=(3, 2, 1)),
    TaperedBlock(2.0, 0.4, 0.3, divisions=(3, 2, 1), hexahedra=True),
    TaperedBlock(2.0, 0.4, 0.3, tip_width=0.2, divisions=(3, 2, 1), hexahedra=True),
    TaperedBlock(2.0, 0.4, 0.3, tip_width=0.2, element_size=0.3),
]


@pytest.mark.parametrize("block", SHAPES)
def test_volume_and_faces(block, tmp_path):
    matrices = assemble(build(block, tmp_path / "block.msh"), UNIT_DENSITY, {}, degree=1)
    tip = block.tip_width or block.width
    flank = (block.length**2 + (0.5 * (block.width - tip)) ** 2) ** 0.5 * block.thickness
    plan = 0.5 * (block.width + tip) * block.length
    areas = {
        "root": block.width * block.thickness,
        "tip": tip * block.thickness,
        "left": flank,
        "right": flank,
        "bottom": plan,
        "top": plan,
    }
    assert matrices.total_mass == pytest.approx(plan * block.thickness, rel=1e-12)
    assert {name: patch.area for name, patch in matrices.patches.items()} == pytest.approx(areas, rel=1e-12)
    at = {name: matrices.coordinates[patch.nodes] for name, patch in matrices.patches.items()}
    assert at["root"][:, 0] == pytest.approx(0.0, abs=1e-12)
    assert at["tip"][:, 0] == pytest.approx(block.length)
    assert at["left"][:, 1].max() < 0.0 < at["right"][:, 1].min()
    assert at["bottom"][:, 2] == pytest.approx(0.0, abs=1e-12)
    assert at["top"][:, 2] == pytest.approx(block.thickness)


@pytest.mark.parametrize(
    ("changes", "name"),
    [({"length": 0.0}, "length"), ({"divisions": (0, 1, 1)}, "divisions"), ({"tip_width": float("nan")}, "tip_width")],
)
def test_refuses_by_name(changes, name):
    with pytest.raises(ParameterError, match=f"^{name}: "):
        TaperedBlock(**({"length": 1.0, "width": 1.0, "thickness": 1.0} | changes))
