"""A ring's modes in charts, in 3D and in a page: the data are those of the modes."""

import base64

import numpy as np
import pytest

import vanedamp as vd
from tests.tools.plate_rings import mesh_variables, plate_waves, sector_mesh
from vanedamp.modal.records.campbell import Campbell
from vanedamp.modal.records.interference import Interference
from vanedamp.studies.cli import main
from vanedamp.studies.kinds.ring_modes import view as module
from vanedamp.studies.kinds.ring_modes.charts import interference_figure, ring_campbell_figure
from vanedamp.studies.kinds.ring_modes.picture import interference_picture
from vanedamp.studies.kinds.ring_modes.view import ring_surface, ring_view, sector_table
from vanedamp.studies.ring_mesh import whole_ring

SECTORS = 8


@pytest.fixture
def modes():
    return plate_waves(SECTORS)


@pytest.fixture
def found(modes):
    speeds = np.array([0.0, 200.0, 400.0])
    over = np.sqrt(modes.frequencies_hz[:, None] ** 2 + 2.0 * (speeds / (2 * np.pi)) ** 2)
    crossings = Interference(modes, operating=(100.0, 400.0)).meetings
    diagram = Campbell(
        speeds, np.ones(3, bool), np.arange(len(modes)), over, np.zeros(3), speeds, (1.0,), crossings, (),
        diameters=modes.diameters, families=modes.families,
    )  # fmt: skip
    return Interference(modes, range(1, 9), speed=150.0, operating=(140.0, 180.0), campbell=diagram)


@pytest.fixture
def file(modes, found, tmp_path):
    found.save(tmp_path / "ring.h5", *mesh_variables(SECTORS))
    return tmp_path / "ring.h5"


@pytest.fixture
def surface(modes):
    return ring_surface(modes, dict(zip(("coordinates", "cell"), sector_mesh(SECTORS), strict=True)))


def traces(figure, beginning):
    return [trace for trace in figure.data if (trace.name or "").startswith(beginning)]


def test_diagram_has_modes_orders_and_meetings(modes, found):
    figure = interference_figure(found)
    families = traces(figure, "family")
    assert [trace.name for trace in families] == ["family 1", "family 2"]
    for trace in families:
        assert trace.x.tolist() == [0, 1, 2, 3, 4]
        assert trace.y == pytest.approx(modes.frequencies_hz[trace.customdata])
    for speed, (line, marks) in zip(
        (140.0, 180.0), zip(*[iter(traces(figure, "engine"))] * 2, strict=True), strict=True
    ):
        assert (line.x[-1], line.y[-1]) == (pytest.approx(found.zigzag(speed)[0][-1]), pytest.approx(found.top))
        orders = [int(text.split()[-1]) for text in marks.hovertext]
        assert list(marks.x) == [min(order % 8, -order % 8) for order in orders]
        assert list(marks.y) == pytest.approx([order * speed / (2 * np.pi) for order in orders])
    (met,) = traces(figure, "meetings")
    assert list(met.y) == [each.frequency_hz for each in found.in_operation] and len(met.y) > 0
    assert list(met.x) == [found.diameters[each.mode] for each in found.in_operation]


def test_campbell_diagram_has_a_line_per_mode(modes, found):
    figure = ring_campbell_figure(found)
    lines = traces(figure, "diameter")
    np.testing.assert_allclose([line.y for line in lines], found.over_speed_hz)
    assert [line.name for line in lines] == [f"diameter {h}" for h in modes.diameters]
    (met,) = traces(figure, "meetings")
    assert list(met.x) == pytest.approx([each.rpm for each in found.meetings])


def test_figure_of_modes_and_of_their_file(modes, found, file):
    shown = [vd.plot(of).to_json() for of in (found, file)]
    assert shown[0] == shown[1] == found.plot().to_json()
    assert [trace.name for trace in vd.plot(modes).data] == ["family 1", "family 2"]


def test_picture_has_the_families(found, tmp_path, pictures):
    interference_picture(found, tmp_path / "ring.png")
    (panel,) = pictures["ring"]
    assert (panel.x, panel.y) == ("nodal diameter", "natural frequency, Hz")
    np.testing.assert_allclose(panel.curves["family 1"].y, found.modes.frequencies_hz[:5])


def test_whole_ring_has_the_nodes_of_joints_once(modes):
    points, cells = sector_mesh(SECTORS)
    ring = whole_ring(modes, points, cells)
    joint = 3 * 2  # nodes of a face
    assert len(ring.points) == SECTORS * (len(points) - joint) and len(ring.cells) == SECTORS * len(cells)
    assert len(np.unique(ring.points.round(9), axis=0)) == len(ring.points)
    angle = np.arctan2(ring.points[:, 1], ring.points[:, 0])
    radius = np.hypot(ring.points[:, 0], ring.points[:, 1])
    for mode, (h, f) in enumerate(zip(modes.diameters, modes.families, strict=True)):
        wave = radius ** (f + 1) * np.exp(1j * h * angle)
        standing = 2 * h in (0, SECTORS)
        np.testing.assert_allclose(ring.shape(modes, mode)[:, 2], wave.real if standing else wave, atol=1e-12)
        assert np.isrealobj(ring.shape(modes, mode)) == standing


def test_nodes_on_the_axis_are_one(modes):
    """Wedges about the axis: two nodes on it, and one on the rim per sector."""
    rim = np.pi / 4 * np.arange(2)
    points = np.array([[0.0, 0, 0], [0, 0, 1], *np.column_stack([np.cos(rim), np.sin(rim), 0 * rim])])
    ring = whole_ring(modes, points, np.array([[0, 2, 3, 1]]))
    assert len(ring.points) == 2 + SECTORS and len(ring.cells) == SECTORS
    assert set(ring.cells[:, 0]) == {0} and set(ring.cells[:, 3]) == {1}
    assert sorted(ring.cells[:, 1]) == sorted(ring.cells[:, 2]) == list(range(2, 2 + SECTORS))


def test_surface_has_no_joints_inside(surface):
    """A closed surface: of every edge two triangles, and its area that of the plate's four sides."""
    edges = np.sort(np.vstack([surface.cells[:, [0, 1]], surface.cells[:, [1, 2]], surface.cells[:, [2, 0]]]), axis=1)
    assert set(np.unique(edges, axis=0, return_counts=True)[1]) == {2}
    a, b, c = (surface.points[surface.cells[:, k]] for k in range(3))
    steps = 3 * SECTORS  # of the circumference
    side, area = 2 * steps * np.sin(np.pi / steps), steps * np.sin(2 * np.pi / steps) / 2
    expected = 2 * area * (0.2**2 - 0.1**2) + side * 0.01 * (0.2 + 0.1)
    assert 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() == pytest.approx(expected, rel=1e-9)


def test_large_surfaces_become_coarser(modes, surface, monkeypatch):
    monkeypatch.setattr(module, "MOST_TRIANGLES", len(surface.cells) // 2)
    values = dict(zip(("coordinates", "cell"), sector_mesh(SECTORS), strict=True))
    coarse = ring_surface(modes, values)
    assert 0 < len(coarse.cells) <= len(surface.cells) // 2
    np.testing.assert_allclose(coarse.points, whole_points(modes)[coarse.sector, coarse.node], atol=1e-12)
    assert ring_surface(modes, {"coordinates": np.zeros((6, 3)), "cell": np.zeros((1, 6), int)}) is None


def whole_points(modes):
    """Nodes (N, n, 3) of all sectors, turned about z."""
    points, _ = sector_mesh(SECTORS)
    angles = 2 * np.pi * np.arange(SECTORS) / SECTORS
    turns = np.array([[[np.cos(a), -np.sin(a), 0], [np.sin(a), np.cos(a), 0], [0, 0, 1]] for a in angles])
    return np.einsum("sij,nj->sni", turns, points)


def unpacked(text, dtype):
    return np.frombuffer(base64.b64decode(text), dtype)


def test_view_has_what_its_script_needs(modes, surface):
    """Of every mode, Re(shape exp(i h j alpha)) turned is the displacement of `whole`, to a step of whole numbers."""
    figure = ring_view(modes, surface, 1)
    meta, drawn = figure.layout.meta, figure.data[0]
    sector, node = unpacked(meta["sector"], "<u2"), unpacked(meta["node"], "<u4")
    shapes = unpacked(meta["shapes"], "<i2").reshape(len(modes), -1, 3, 2) / meta["steps"]
    turns = np.reshape(meta["turns"], (SECTORS, 3, 3))
    for mode in range(len(modes)):
        wave = (shapes[mode, ..., 0] + 1j * shapes[mode, ..., 1])[node]
        local = (wave * np.exp(2j * np.pi * modes.diameters[mode] * sector / SECTORS)[:, None]).real
        expected = modes.whole(mode)[surface.sector, surface.node]
        largest = np.abs(modes.shapes[mode]).max()  # along z only
        np.testing.assert_allclose(np.einsum("nij,nj->ni", turns[sector], local), expected / largest, atol=1e-4)
    header, rows = sector_table(modes, surface, 3)
    rows = np.array(rows)
    angle, radius = np.arctan2(rows[:, 1], rows[:, 0]), np.hypot(rows[:, 0], rows[:, 1])
    assert header[5] == "dz real" and header[8] == "dz imaginary" and len(rows) == np.count_nonzero(surface.sector == 0)
    np.testing.assert_allclose(rows[:, 5] + 1j * rows[:, 8], radius * np.exp(3j * angle), atol=1e-12)
    moved = 1e3 * surface.points + meta["scale"] * modes.whole(1)[surface.sector, surface.node] / 0.2
    np.testing.assert_allclose(np.column_stack([drawn.x, drawn.y, drawn.z]), moved, atol=1e-3)


def test_page_turns_and_animates_the_wave(modes, file, surface, browser):
    """The frames in a browser are `whole` at their phases, for the mode that the slider or a click chooses."""
    page_file = file.with_suffix(".html")
    assert main(["explore", str(file), "-o", str(page_file), "--no-browser"]) == 0
    page = browser.new_page()
    errors = []
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.goto(page_file.as_uri())
    chart = "document.querySelector('#ring-0')"
    page.wait_for_function(f"{chart} && {chart}.data && document.querySelector('.ring output').textContent")

    def shown(mode, *phases):
        """The smallest distance of the frame from phases of a mode, over the largest displacement."""
        frame = np.array(page.evaluate(f"['x', 'y', 'z'].map(axis => Array.from({chart}.data[0][axis]))")).T
        scale = page.evaluate(f"{chart}.layout.meta.scale")
        moved = (frame - 1e3 * surface.points) / scale
        largest = np.abs(modes.shapes[mode]).max()
        waves = (modes.whole(mode, phase)[surface.sector, surface.node] / largest for phase in phases)
        return min(np.abs(moved - wave).max() for wave in waves)

    assert shown(1, 0.0) < 1e-3
    page.locator(".ring .diameter").fill("3")
    page.locator(".ring .family").select_option(index=1)
    assert "diameter 3, family 2: 290.000 Hz" in page.locator(".ring output").inner_text()
    assert shown(8, 0.0) < 1e-3
    page.evaluate("document.getElementById('interference-0').emit('plotly_click', {points: [{customdata: 2}]})")
    assert "diameter 2, family 1" in page.locator(".ring output").inner_text()
    page.locator(".ring .button").click()
    page.wait_for_timeout(300)
    page.locator(".ring .button").click()
    page.wait_for_timeout(300)  # the frame under way
    assert shown(2, *np.linspace(0, 2 * np.pi, 2001)) < 5e-3 < shown(2, 0.0)
    assert errors == []
    page.close()
