"""The parametric cluster: its groups are where the drawing says, and what does not fit is refused by name."""

import math

import gmsh
import pytest

from vanedamp.files.formats.meshes.labelled_mesh import MeshError
from vanedamp.meshes import vane_cluster
from vanedamp.meshes.parameters import VaneCluster
from vanedamp.meshes.vane_cluster import SHIPPED, ParameterError, build
from vanedamp.modal import fenicsx
from vanedamp.modal.elasticity import Material, assemble
from vanedamp.modal.msh import session

UNIT_DENSITY = {"default": Material(young=1.0, poisson=0.25, density=1.0)}
COARSE = {"element_size": 0.008, "airfoils": 2}


@pytest.fixture(scope="module")
def curved(tmp_path_factory):
    """Three cavities in a cluster of three, with curved elements: areas to the accuracy of a quadratic arc."""
    parameters = VaneCluster(airfoils=3, cavities=3, cavity_width=0.010, element_size=0.006, order=2)
    path = build(parameters, tmp_path_factory.mktemp("cluster") / "cluster.msh")
    return parameters, assemble(path, UNIT_DENSITY, {"clamp": "xyz"}, degree=1)


def test_areas_of_the_drawing(curved):
    parameters, matrices = curved
    sector = math.radians(parameters.sector_deg)
    areas = {
        "clamp": sector * parameters.outer_radius * parameters.axial_length,
        "shroud": sector * parameters.inner_radius * parameters.axial_length,
    }
    areas["shroud_low"] = areas["shroud_high"] = parameters.inner_thickness * parameters.axial_length
    for number in (1, 2, 3):
        areas[f"c{number}_left"] = areas[f"c{number}_right"] = parameters.cavity_height * parameters.cavity_depth
        areas[f"c{number}_floor"] = areas[f"c{number}_roof"] = parameters.cavity_width * parameters.cavity_depth
    assert {name: patch.area for name, patch in matrices.patches.items()} == pytest.approx(areas, rel=1e-6)


def test_volume_of_the_drawing(curved):
    parameters, matrices = curved
    sector = math.radians(parameters.sector_deg)

    def ring(inner, outer):
        return 0.5 * sector * (outer**2 - inner**2) * parameters.axial_length

    shrouds = ring(parameters.inner_radius, parameters.platform_radius)
    shrouds += ring(parameters.casing_radius, parameters.outer_radius)
    pocket = parameters.cavity_width * parameters.cavity_height * parameters.cavity_depth
    suction, pressure = parameters.profile(400)
    outline = [*suction, *pressure[::-1]]
    section = 0.5 * abs(sum(a[0] * b[1] - b[0] * a[1] for a, b in zip(outline, outline[1:] + outline[:1], strict=True)))
    volume = shrouds - 3 * pocket + 3 * section * parameters.span
    # the platforms are arcs, the airfoils' ends follow them: the span is nominal to half a per mille of the volume
    assert matrices.total_mass == pytest.approx(volume, rel=2e-3)


def test_walls_face_the_tangential_direction(curved):
    parameters, matrices = curved
    for number, angle in enumerate(parameters.cavity_angles(), start=1):
        for side, sign in (("left", -1.0), ("right", 1.0)):
            points = matrices.coordinates[matrices.patches[f"c{number}_{side}"].nodes]
            tangential = points[:, 1] * math.cos(angle) - points[:, 2] * math.sin(angle)
            assert tangential == pytest.approx(sign * 0.5 * parameters.cavity_width, abs=1e-12)
        points = matrices.coordinates[matrices.patches[f"c{number}_floor"].nodes]
        radial = points[:, 1] * math.sin(angle) + points[:, 2] * math.cos(angle)
        assert radial == pytest.approx(parameters.cavity_radius - 0.5 * parameters.cavity_height, abs=1e-12)


def test_cluster_is_centred_on_z(curved):
    parameters, matrices = curved
    angles = [math.atan2(y, z) for _, y, z in matrices.coordinates]
    half = 0.5 * math.radians(parameters.sector_deg)
    assert (min(angles), max(angles)) == pytest.approx((-half, half), abs=1e-9)


def test_groups_of_the_shipped_mesh():
    domain = fenicsx.read(SHIPPED)
    assert set(domain.facets) == {
        "clamp",
        "shroud",
        "shroud_low",
        "shroud_high",
        "c1_left",
        "c1_right",
        "c1_floor",
        "c1_roof",
    }
    assert set(domain.volumes) == {"outer_shroud", "airfoils", "inner_shroud"}
    facets = [facet for members in domain.facets.values() for facet in members]
    assert len(facets) == len(set(facets))


def test_without_cavities(tmp_path):
    domain = fenicsx.read(build(VaneCluster(cavities=0, **COARSE), tmp_path / "solid.msh"))
    assert set(domain.facets) == {"clamp", "shroud", "shroud_low", "shroud_high"}


def test_same_parameters_same_file(tmp_path):
    first = build(VaneCluster(**COARSE), tmp_path / "a.msh").read_bytes()
    assert build(VaneCluster(**COARSE), tmp_path / "b.msh").read_bytes() == first


@pytest.mark.parametrize(
    ("changes", "name"),
    [
        ({"span": -0.01}, "span"),
        ({"chord": float("nan")}, "chord"),
        ({"airfoils": 0}, "airfoils"),
        ({"cavities": 1.5}, "cavities"),
        ({"cavities": -1}, "cavities"),
        ({"pitch_deg": "4"}, "pitch_deg"),
        ({"order": 3}, "order"),
        ({"airfoils": 60}, "pitch_deg"),
        ({"pitch_deg": 1.0}, "pitch_deg"),
        ({"thickness": 0.012}, "thickness"),
        ({"axial_length": 0.020}, "axial_length"),
        ({"stagger_deg": 95.0}, "stagger_deg"),
        ({"cavity_depth": 0.0235}, "cavity_depth"),
        ({"cavity_height": 0.0095}, "cavity_height"),
        ({"cavities": 5}, "cavity_width"),
        ({"damper_width": 0.010}, "damper_height"),
        ({"damper_width": 0.015, "damper_height": 0.004, "damper_depth": 0.01}, "damper_width"),
        ({"damper_width": -0.01, "damper_height": 0.004, "damper_depth": 0.01}, "damper_width"),
        ({"damper_width": 0.010, "damper_height": 0.004, "damper_depth": 0.01, "cavities": 0}, "damper_width"),
    ],
)
def test_refuses_by_name(changes, name):
    with pytest.raises(ParameterError, match=f"^{name}: "):
        VaneCluster(**changes)


def test_tied_bodies_share_the_nodes_of_the_floor(tmp_path):
    """Bodies on the floors of two cavities: their volume, one connected mesh, and what is left of each floor."""
    size = {"damper_width": 0.008, "damper_height": 0.004, "damper_depth": 0.010}
    parameters = VaneCluster(cavities=2, cavity_width=0.010, **COARSE, **size)
    path = build(parameters, tmp_path / "tied.msh")
    assert set(fenicsx.read(path).volumes) == {"outer_shroud", "airfoils", "inner_shroud", "damper"}
    materials = UNIT_DENSITY | {"damper": Material(young=1.0, poisson=0.25, density=1001.0)}
    heavy = assemble(path, materials, {"clamp": "xyz"}, degree=1)
    light = assemble(path, UNIT_DENSITY, {"clamp": "xyz"}, degree=1)
    assert parameters.damper_volume == pytest.approx(2 * 0.008 * 0.004 * 0.010)
    assert (heavy.total_mass - light.total_mass) / 1000.0 == pytest.approx(parameters.damper_volume, rel=1e-9)
    for number in (1, 2):
        floor, roof = (heavy.patches[f"c{number}_{side}"].area for side in ("floor", "roof"))
        assert (floor, roof) == pytest.approx((0.010 * 0.012 - 0.008 * 0.010, 0.010 * 0.012), rel=1e-9)


def test_a_body_that_fills_its_cavity_covers_the_walls(tmp_path):
    size = {"damper_width": 0.014, "damper_height": 0.005, "damper_depth": 0.012}
    domain = fenicsx.read(build(VaneCluster(**COARSE, **size), tmp_path / "full.msh"))
    assert set(domain.facets) == {"clamp", "shroud", "shroud_low", "shroud_high"}


def test_five_cavities_fit_when_the_message_is_followed():
    with pytest.raises(ParameterError, match=r"at most (\S+) m each") as refused:
        VaneCluster(cavities=5)
    widest = float(str(refused.value).split("at most ")[1].split()[0])
    assert VaneCluster(cavities=5, cavity_width=0.99 * widest).cavities == 5


def test_failure_keeps_the_old_file_and_ends_the_session(tmp_path, monkeypatch, capfd):
    path = tmp_path / "cluster.msh"
    path.write_text("old")
    facets = vane_cluster.facets

    def overlapping(parameters):
        found = facets(parameters)
        return found | {"again": found["clamp"]}

    monkeypatch.setattr(vane_cluster, "facets", overlapping)
    with pytest.raises(MeshError, match="facet groups 'clamp' and 'again' share"):
        build(VaneCluster(**COARSE), path)
    assert path.read_text() == "old"
    assert [item.name for item in tmp_path.iterdir()] == ["cluster.msh"]
    assert not gmsh.isInitialized()
    assert capfd.readouterr() == ("", "")


def test_refuses_other_suffixes(tmp_path):
    with pytest.raises(ParameterError, match=r"\.msh"):
        build(VaneCluster(**COARSE), tmp_path / "cluster.vtk")


def test_session_within_a_session_leaves_the_outer_model(tmp_path):
    with session("outer"):
        gmsh.model.geo.addPoint(0, 0, 0, tag=7)
        gmsh.model.geo.synchronize()
        build(VaneCluster(**COARSE), tmp_path / "cluster.msh")
        assert gmsh.model.getCurrent() == "outer"
        assert gmsh.model.getEntities(0) == [(0, 7)]
