"""Elastic supports against closed forms, and the parts that a stiffness is made of."""

import numpy as np
import pytest
from scipy.sparse.linalg import spsolve

from tests.tools.two_cubes_mesh import write_boxes
from vanedamp.files.formats.meshes.labelled_mesh import MeshError
from vanedamp.meshes.benchmarks import TaperedBlock, build
from vanedamp.modal.eigen import solve_modes
from vanedamp.modal.elasticity import ElasticityError, ElasticSupport, Material, Solid, assemble
from vanedamp.modal.matrices import patch_average

ROLLERS = {"left": "y", "right": "y", "bottom": "z", "top": "z"}
TAPERED = TaperedBlock(0.3, 0.2, 0.1, tip_width=0.1, element_size=0.08)


@pytest.mark.parametrize("degree", [1, 2, 3])
def test_rod_on_springs(tmp_path, degree):
    """Rod and springs in series under a tip force: F (L / (E A) + 1 / (k A))."""
    path = build(TaperedBlock(2.0, 0.5, 0.4, divisions=(2, 1, 1)), tmp_path / "rod.msh")
    springs = {"root": ElasticSupport(stiffness=(3.0, 0.0, 0.0))}
    rod = assemble(path, {"default": Material(5.0, 0.3, 1.0)}, ROLLERS, degree, elastic=springs)
    average, free = patch_average(rod, "tip", [1, 0, 0]), rod.free
    stretch = average[free] @ spsolve(rod.stiffness[free][:, free].tocsc(), average[free])
    confined = 5.0 * (1 - 0.3) / (1.3 * (1 - 0.6))
    assert stretch == pytest.approx(2.0 / (confined * 0.2) + 1.0 / (3.0 * 0.2), rel=1e-10)


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize(
    ("support", "tensor"),
    [
        (ElasticSupport(stiffness=(1.0, 2.0, 3.0)), lambda n: np.diag([1.0, 2.0, 3.0])),
        (ElasticSupport(normal=5.0), lambda n: 5.0 * np.outer(n, n)),
        (ElasticSupport(tangential=7.0), lambda n: 7.0 * (np.eye(3) - np.outer(n, n))),
        (ElasticSupport((1.0, 0.0, 0.0), 5.0, 5.0), lambda n: np.diag([6.0, 5.0, 5.0])),
    ],
)
def test_energy_of_translations_on_a_slanted_face(tmp_path, support, tensor, order):
    path = build(TaperedBlock(0.3, 0.2, 0.1, tip_width=0.1, element_size=0.08, order=order), tmp_path / "block.msh")
    material = {"default": Material(1e-3, 0.3, 1.0)}
    matrices = assemble(path, material, {}, elastic={"right": support})
    normal = np.array([0.05, 0.3, 0.0]) / np.hypot(0.05, 0.3)
    translations = matrices.rigid_translations()
    expected = np.hypot(0.05, 0.3) * 0.1 * tensor(normal)
    assert translations.T @ (matrices.stiffness @ translations) == pytest.approx(expected, abs=1e-10)


def test_block_bounces_on_its_bed(tmp_path):
    """A block, stiff against its bed, on rollers: the bounce is at sqrt(k / (density thickness)) / 2 pi."""
    path = build(TaperedBlock(1.0, 0.5, 0.2, divisions=(3, 2, 1), hexahedra=True), tmp_path / "block.msh")
    held = {"root": "x", "tip": "x", "left": "y", "right": "y"}
    springs = {"bottom": ElasticSupport(stiffness=(0.0, 0.0, 8e6))}
    block = assemble(path, {"default": Material(2e11, 0.3, 8000.0)}, held, elastic=springs)
    # the series of its own compliance and the bed's lowers it by k h / (6 E_confined), 1e-6
    assert solve_modes(block, 1).frequencies_hz[0] == pytest.approx(np.sqrt(8e6 / 1600.0) / (2 * np.pi), rel=1e-5)


def test_stiff_springs_become_a_clamp_from_below(tmp_path):
    path = build(TaperedBlock(0.5, 0.05, 0.05, divisions=(6, 1, 1), hexahedra=True), tmp_path / "beam.msh")
    steel = {"default": Material(2e11, 0.3, 8000.0)}
    clamped = solve_modes(assemble(path, steel, {"root": "xyz"}), 3).frequencies_hz
    missing = []
    for stiffness in (1e14, 1e15, 1e16):
        support = ElasticSupport(stiffness=(stiffness,) * 3)
        held = solve_modes(assemble(path, steel, {}, elastic={"root": support}), 3).frequencies_hz
        missing.append(1.0 - held / clamped)
    assert np.min(missing) > 0.0
    # the stress at the edges of the clamp is singular: a little less than in inverse proportion
    assert np.divide(missing[:-1], missing[1:]) == pytest.approx(9.0, abs=1.2)
    assert np.max(missing[2]) < 1e-3


def test_parts_sum_to_the_stiffness(tmp_path):
    springs = {"root": ElasticSupport(normal=1e12, tangential=1e11), "tip": ElasticSupport((1e10, 2e10, 3e10))}
    solid = Solid(build(TAPERED, tmp_path / "b.msh"), {"default": Material(2e11, 0.3, 8e3)}, elastic=springs)
    parts, whole = solid.stiffness_parts(), solid.assemble({}, 0.0).stiffness
    assert set(parts) == {"material.block", "support.root", "support.tip"}
    assert abs(sum(parts.values()) - whole).max() < 1e-14 * abs(whole).max()
    assert all(abs(part - part.T).max() < 1e-13 * abs(part).max() for part in parts.values())


def test_parts_are_proportional_to_what_they_are_named_after(tmp_path):
    path = write_boxes(tmp_path / "rods.msh", {"soft": [1], "hard": [2]}, {"left": [(0, 1, 1)], "right": [(4, 1, 1)]})
    soft, springs = Material(1.0, 0.2, 1.0), ElasticSupport((1.0, 2.0, 3.0))

    def parts(hard, factor):
        support = ElasticSupport(tuple(factor * value for value in springs.stiffness))
        solid = Solid(path, {"hard": Material(hard, 0.2, 1.0), "default": soft}, elastic={"left": support})
        return solid.stiffness_parts(), solid.assemble({}, 0.0).stiffness

    first, whole = parts(4.0, 1.0)
    second, other = parts(8.0, 3.0)
    assert abs(sum(first.values()) - whole).max() < 1e-13 * abs(whole).max()
    predicted = first["material.soft"] + 2.0 * first["material.hard"] + 3.0 * first["support.left"]
    assert abs(predicted - other).max() < 1e-13 * abs(other).max()
    assert abs(second["material.hard"] - 2.0 * first["material.hard"]).max() < 1e-13


@pytest.mark.parametrize(
    "values", [{}, {"normal": -1.0}, {"tangential": float("nan")}, {"stiffness": (1.0, 2.0)}, {"normal": float("inf")}]
)
def test_refuses_springs(values):
    with pytest.raises(ElasticityError, match=r"^stiffness: "):
        ElasticSupport(**values)


def test_refuses_unknown_groups(tmp_path):
    path = build(TAPERED, tmp_path / "b.msh")
    with pytest.raises(MeshError, match="no facet group 'clamp'; there are: bottom, left"):
        assemble(path, {"default": Material(1.0, 0.3, 1.0)}, {}, elastic={"clamp": ElasticSupport(normal=1.0)})
