"""A bladed disk by one sector against the mesh of its whole ring: at rest, rotating, heated, under engine orders."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import special
from scipy.optimize import brentq
from scipy.sparse.linalg import splu
from scipy.spatial import cKDTree

from tests.modal.test_cyclic import STEEL, every
from tests.tools.ring_mesh import write_ring, write_tetrahedra
from vanedamp.meshes.sector import Sector, build
from vanedamp.modal.algebra import rotation
from vanedamp.modal.cyclic import cyclic_sector
from vanedamp.modal.cyclic_campbell import ring_campbell
from vanedamp.modal.cyclic_modes import ring_modes
from vanedamp.modal.cyclic_response import tuned_response
from vanedamp.modal.cyclic_rotation import gyroscopic_ring_modes
from vanedamp.modal.cyclic_statics import RingStatics
from vanedamp.modal.eigen import factorize, solve_modes
from vanedamp.modal.elasticity import ElasticSupport, Material, Solid
from vanedamp.modal.gyroscopic import gyroscopic_modes
from vanedamp.modal.matrices import patch_average
from vanedamp.modal.rotating import UnstableError
from vanedamp.modal.temperature import Temperature
from vanedamp.rom.interface import InterfaceCoordinate
from vanedamp.rom.ring.reduction import reduce_ring

SECTORS, SPEED = 6, 1500.0
Z, ORIGIN = np.array([0.0, 0.0, 1.0]), np.zeros(3)


def of_ring(matrices):
    """The sector of the ring with these matrices."""
    return cyclic_sector(matrices, "low", "high", SECTORS)


@pytest.fixture(scope="module")
def meshes(tmp_path_factory):
    """A sector with a blade and its ring, as meshes."""
    folder = tmp_path_factory.mktemp("ring")
    blade = Sector(SECTORS, 0.05, 0.1, 0.01, 0.05, blade_length=0.06, blade_thickness=0.012)
    path = build(blade, folder / "sector.msh")
    return path, write_ring(path, folder / "ring.msh", SECTORS)


@pytest.fixture(scope="module")
def solids(meshes):
    """Both as solids."""
    return [Solid(mesh, STEEL) for mesh in meshes]


@pytest.fixture(scope="module")
def standing(solids):
    """Their matrices, clamped at the bore."""
    supports = ({"bore": "xyz"}, {f"bore@{j}": "xyz" for j in range(SECTORS)})
    return [solid.assemble(held, 0.0) for solid, held in zip(solids, supports, strict=True)]


@pytest.fixture(scope="module")
def rotating(solids, standing):
    """Their matrices with rotation about the axis of the ring."""
    statics = (RingStatics(of_ring), None)
    both = zip(solids, standing, statics, strict=True)
    return [solid.rotating(matrices, Z, ORIGIN, given, 2.0 * SPEED) for solid, matrices, given in both]


def test_frequencies_are_those_of_the_whole_mesh(standing):
    sector, whole = standing
    assert whole.total_mass == pytest.approx(SECTORS * sector.total_mass, rel=1e-12)
    known = solve_modes(whole, 24).frequencies_hz
    found = every(modes := ring_modes(of_ring(sector), 4))
    assert found[:20] == pytest.approx(known[:20], rel=1e-9)
    last = 18 + int(np.argmax(np.diff(known[17:])))
    limited = every(ring_modes(of_ring(sector), max_frequency=0.5 * (known[last - 1] + known[last])))
    assert limited == pytest.approx(known[:last], rel=1e-9)
    assert modes.residuals.max() < 1e-6


def test_shapes_are_modes_of_the_whole_mesh(standing):
    """Turned into the ring, real and imaginary part of a shape are mass-normalised modes of the whole mesh."""
    sector, whole = standing
    modes = ring_modes(of_ring(sector), 2)
    places = [sector.coordinates @ rotation(Z, 2 * np.pi * j / SECTORS).T for j in range(SECTORS)]
    nodes = cKDTree(np.concatenate(places)).query(whole.coordinates)[1]
    for mode in range(len(modes)):
        standing_wave = modes.diameters[mode] in (0, SECTORS / 2)
        for phase in (0.0,) if standing_wave else (0.0, 0.5 * np.pi):
            shape = modes.whole(mode, phase).reshape(-1, 3)[nodes].ravel()
            assert shape @ whole.mass @ shape == pytest.approx(1.0, rel=1e-9)
            forces = (whole.stiffness @ shape)[whole.free]
            inertia = (2 * np.pi * modes.frequencies_hz[mode]) ** 2 * (whole.mass @ shape)[whole.free]
            assert np.linalg.norm(forces - inertia) < 1e-6 * np.linalg.norm(inertia)


def test_frequencies_at_a_speed(rotating):
    """With the stress of the ring, which a sector with free faces would not have."""
    sector, whole = (structure.at(SPEED) for structure in rotating)
    found = every(ring_modes(of_ring(sector), 4))
    assert found[:20] == pytest.approx(solve_modes(whole, 20).frequencies_hz, rel=1e-9)
    assert found[0] > 1.02 * solve_modes(rotating[1].standing, 1).frequencies_hz[0]


def test_waves_at_a_speed(rotating):
    """Every frequency of the whole mesh with the gyroscopic coupling; the wave against the turn has the higher one."""
    sector, whole = rotating
    modes = gyroscopic_ring_modes(of_ring(sector.standing), sector, SPEED, 3)
    known = gyroscopic_modes(whole, SPEED, 14)
    assert np.sort(modes.frequencies_hz)[:14] == pytest.approx(known.frequencies_hz, rel=1e-9)
    for h in (1, 2):
        against, along = (modes.frequencies_hz[modes.diameters == sign * h] for sign in (1, -1))
        assert against[0] > (1 + 1e-5) * along[0]
    standing = gyroscopic_ring_modes(of_ring(sector.standing), sector, 0.0, 2)
    pair = [standing.frequencies_hz[standing.diameters == h] for h in (1, -1)]
    assert pair[0] == pytest.approx(pair[1], rel=1e-9)


def test_wave_with_gyroscopic_coupling_moves_the_whole_mesh(rotating):
    """Re(z exp(i (omega t + h j alpha))), turned into the ring, solves its equations of motion."""
    sector, whole = rotating
    modes = gyroscopic_ring_modes(of_ring(sector.standing), sector, SPEED, 1)
    places = [sector.standing.coordinates @ rotation(Z, 2 * np.pi * j / SECTORS).T for j in range(SECTORS)]
    nodes = cKDTree(np.concatenate(places)).query(whole.standing.coordinates)[1]
    stiffness = whole.standing.stiffness + whole.added(SPEED)
    for mode in range(len(modes)):
        omega = 2 * np.pi * modes.frequencies_hz[mode]
        moved, quarter = (modes.whole(mode, phase).reshape(-1, 3)[nodes].ravel() for phase in (0.0, 0.5 * np.pi))
        forces = stiffness @ moved + SPEED * omega * (whole.gyroscopic @ quarter)
        rest = (forces - omega**2 * (whole.standing.mass @ moved))[whole.standing.free]
        assert np.linalg.norm(rest) < 1e-5 * np.linalg.norm(forces[whole.standing.free])


@pytest.mark.parametrize("gyroscopic", [False, True])
def test_campbell_diagram_by_nodal_diameter(rotating, gyroscopic):
    """Curves are the modes at every speed; at a crossing the whole mesh has the order's frequency."""
    sector, whole = rotating
    speeds = np.linspace(1000.0, 3000.0, 3)
    found = ring_campbell(of_ring(sector.standing), sector, speeds, [3, 5, 7, 10], 2, gyroscopic)
    assert found.error <= 1e-8 and not found.warnings
    for place, speed in enumerate(speeds):
        ring = of_ring(sector.standing)
        modes = (
            gyroscopic_ring_modes(ring, sector, speed, 2) if gyroscopic else ring_modes(of_ring(sector.at(speed)), 2)
        )
        assert np.array_equal(found.diameters, modes.diameters) and np.array_equal(found.families, modes.families)
        assert found.frequencies_hz[:, place] == pytest.approx(modes.frequencies_hz, rel=1e-8)
    excited = {crossing.order: {int(found.diameters[c.mode]) for c in found.crossings if c.order == crossing.order}
               for crossing in found.crossings}  # fmt: skip
    assert excited == {5.0: {-1} if gyroscopic else {1}, 7.0: {1}, 10.0: {-2} if gyroscopic else {2}}
    for crossing in found.crossings:
        known = gyroscopic_modes(whole, crossing.speed, 14) if gyroscopic else solve_modes(whole.at(crossing.speed), 14)
        assert np.abs(known.frequencies_hz / crossing.frequency_hz - 1).min() < 1e-7


def test_reduced_ring_at_a_speed(rotating):
    """Its modes are those of the sector at the speed, between the speeds of its equilibria."""
    sector, _ = rotating
    tip = InterfaceCoordinate("tip", "tip", (0.0, 0.0, 1.0))
    ring = reduce_ring(
        of_ring(sector.standing), [tip], 2, None, None, sector.centrifugal_stiffness, sector.greatest, factorize,
        higher=sector.higher,
    )  # fmt: skip
    found = np.sort(ring.tuned_families(SPEED).squares)[:6]
    known = ring_modes(of_ring(sector.at(SPEED)), 2)
    assert np.sqrt(found) / (2.0 * np.pi) == pytest.approx(every(known)[:6], rel=1e-6)


def test_engine_orders_move_the_whole_mesh_alike(standing):
    """And what other diameters have of the response is 1e-10 of it."""
    sector, whole = standing
    frequency, loss, free = 1234.5, 0.01, whole.free
    dynamic = (1 + 1j * loss) * whole.stiffness - (2 * np.pi * frequency) ** 2 * whole.mass
    solve = splu(whole.of_free(dynamic).tocsc()).solve
    along = np.array([0.2, 1.0, 0.5])
    turns = [rotation(Z, 2 * np.pi * j / SECTORS) for j in range(SECTORS)]
    nodes = [cKDTree(whole.coordinates).query(sector.coordinates @ turn.T)[1] for turn in turns]
    tips = [patch_average(whole, f"tip@{j}", turn @ along) for j, turn in enumerate(turns)]
    for order in (0, 1, 3, 5, 8):
        lag = np.exp(-2j * np.pi * order * np.arange(SECTORS) / SECTORS)
        moved = np.zeros(whole.size, dtype=complex)
        moved[free] = solve((lag @ np.array(tips))[free])
        own = np.array([moved.reshape(-1, 3)[at] @ turn for at, turn in zip(nodes, turns, strict=True)])
        found = tuned_response(of_ring(sector), patch_average(sector, "tip", along), order, frequency, loss)
        scale = np.abs(found).max()
        expected = lag[:, None, None] * found.reshape(-1, 3)
        assert np.abs(own - expected).max() < 1e-8 * scale
        # waves of sectors: only that of the order
        waves = np.abs(np.fft.fft(own, axis=0)).max(axis=(1, 2)) / SECTORS
        assert np.delete(waves, -order % SECTORS).max() < 1e-10 * waves.max()


def test_heated_ring(meshes):
    """A ring on springs, hotter than its casing: the thermal stress is that of the ring."""
    hot = {"default": Material(2e11, 0.3, 7800.0, expansion=1.2e-5)}
    springs, temperature = ElasticSupport((1e12, 1e12, 1e12)), Temperature(20.0, np.array(60.0))
    sector = Solid(meshes[0], hot, elastic={"bore": springs}, temperature=temperature)
    whole = Solid(meshes[1], hot, elastic={f"bore@{j}": springs for j in range(SECTORS)}, temperature=temperature)
    matrices = sector.assemble({}, 0.0, RingStatics(of_ring))
    found, known = every(ring_modes(of_ring(matrices), 3)), solve_modes(whole.assemble({}, 0.0), 14)
    assert found[:14] == pytest.approx(known.frequencies_hz, rel=1e-9)
    cold = Solid(meshes[0], STEEL, elastic={"bore": springs}).assemble({}, 0.0)
    assert abs(found[0] / every(ring_modes(of_ring(cold), 1))[0] - 1) > 1e-4


def test_speed_at_which_the_ring_is_unstable(rotating):
    """The limit is that of the whole mesh, whichever diameter has it."""
    limits = []
    for structure in rotating:
        compressed = replace(
            structure, centrifugal_stiffness=-1.0 * structure.centrifugal_stiffness, higher=(), greatest=np.inf
        )
        with pytest.raises(UnstableError, match="the structure is unstable") as caught:
            compressed.at(1e5)
        limits.append(float(str(caught.value).split(" above ")[1].split()[0]))
    assert limits[0] == pytest.approx(limits[1], rel=2e-3)


def kirchhoff(diameter, families):
    """Wave numbers k of an annular plate, clamped at 0.1 m and free at 0.2 m: roots of its determinant.

    w = (A J_n + B Y_n + C I_n + D K_n)(k r) cos n theta. Free edge: the radial moment and Kirchhoff's shear force
    vanish, M_r = w'' + nu (w' / r - n^2 w / r^2), V_r = (Laplace w)' - (1 - nu) n^2 / r^2 (w' - w / r).
    """
    inner, outer, nu, n = 0.1, 0.2, 0.3, diameter
    kinds = ((special.jvp, -1.0), (special.yvp, -1.0), (special.ivp, 1.0), (special.kvp, 1.0))

    def determinant(k):
        rows = np.empty((4, 4))
        for column, (kind, sign) in enumerate(kinds):
            scale = abs(kind(n, k * inner, 0))
            clamped = [kind(n, k * inner, 0), k * kind(n, k * inner, 1)]
            w, slope, bend = (k**d * kind(n, k * outer, d) for d in (0, 1, 2))
            moment = bend + nu * (slope / outer - n**2 * w / outer**2)
            # the Laplacian of each solution is sign k^2 times itself
            shear = sign * k**2 * slope - (1 - nu) * n**2 / outer**2 * (slope - w / outer)
            rows[:, column] = np.array([*clamped, moment, shear]) / scale
        rows /= np.abs(rows).max(axis=1, keepdims=True)
        return np.linalg.det(rows)

    grid = np.linspace(2.0, 120.0, 1200)
    values = np.array([determinant(k) for k in grid])
    places = np.flatnonzero(np.diff(np.sign(values)) != 0)[:families]
    return np.array([brentq(determinant, grid[i], grid[i + 1], xtol=1e-12) for i in places])


def plate_frequencies(diameter, families):
    """Natural frequencies (families,), Hz, of the thin plate of thickness 1 mm."""
    young, nu, density, thickness = 2e11, 0.3, 7800.0, 1e-3
    bending = young * thickness**3 / (12.0 * (1.0 - nu**2))
    return kirchhoff(diameter, families) ** 2 * np.sqrt(bending / (density * thickness)) / (2 * np.pi)


def plate_errors(folder, size):
    """Relative errors (diameters, families) of the annular plate's frequencies, by elements of a size (m)."""
    path = build(Sector(180, 0.1, 0.2, 0.001, size, order=2), folder / "plate.msh")
    matrices = Solid(path, STEEL).assemble({"bore": "xyz"}, 0.0)
    found = ring_modes(cyclic_sector(matrices, "low", "high", 180), 2, diameters=range(4)).table
    return found / np.array([plate_frequencies(h, 2) for h in range(4)]) - 1.0


def test_annular_plate_converges_to_kirchhoff(tmp_path):
    """From above, as the mesh is refined: nodal diameters 0 to 3, two families."""
    errors = [plate_errors(tmp_path, size) for size in (0.0125, 0.00625)]
    assert np.all((errors[1] > 0.0) & (errors[1] < 0.65 * errors[0]))
    assert errors[1].max() < 7e-3


@pytest.mark.slow
def test_annular_plate_on_a_fine_mesh(tmp_path):
    """To a thin plate's own error: solid elements have shear, and a clamp that is not quite rigid."""
    coarse, fine = (plate_errors(tmp_path, size) for size in (0.0036, 0.0018))
    assert coarse.max() < 2.2e-3 and np.abs(fine).max() < 1e-3


def test_curved_tetrahedra(tmp_path):
    path = write_tetrahedra(tmp_path / "sector.msh", SECTORS)
    whole = Solid(write_ring(path, tmp_path / "ring.msh", SECTORS), STEEL)
    held = {f"bore@{j}": "xyz" for j in range(SECTORS)}
    known = solve_modes(whole.assemble(held, 0.0), 20).frequencies_hz
    found = every(ring_modes(of_ring(Solid(path, STEEL).assemble({"bore": "xyz"}, 0.0)), 4))
    assert found[:16] == pytest.approx(known[:16], rel=1e-9)
