"""Campbell diagrams: modes over speeds, veerings and crossings told apart, engine orders, against closed forms."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import linalg, sparse
from scipy.optimize import minimize_scalar

import vanedamp as vd
from tests.tools.small_structures import truss
from tests.tools.tiers import cases
from vanedamp.modal.campbell import CampbellError, campbell
from vanedamp.modal.gyroscopic import gyroscopic_modes
from vanedamp.modal.mode_tracking import Tracks
from vanedamp.modal.records.campbell import Campbell
from vanedamp.modal.rotating import RotatingMatrices, UnstableError
from vanedamp.modal.speed_range import SpeedRange

PI2 = 2.0 * np.pi


def point_mass(stiffness, centrifugal, gyroscopic=None):
    """A mass of 1 kg on springs at one node."""
    standing = vd.SystemMatrices(stiffness, np.eye(3), np.zeros((1, 3)), [], {}, 0.0)
    return rotating(standing, centrifugal, np.zeros((3, 3)) if gyroscopic is None else gyroscopic)


def rotating(standing, centrifugal, gyroscopic):
    return RotatingMatrices(
        standing, sparse.csr_array(centrifugal), sparse.csr_array(gyroscopic), np.zeros(standing.size),
        np.array([0.0, 0.0, 1.0]), np.zeros(3),
    )  # fmt: skip


def coupled(coupling):
    """Two modes of squared frequencies 2e4 -+ sqrt((5e3 - W^2)^2 + coupling^2), a third far away."""
    stiffness = np.diag([1.5e4, 2.5e4, 9e6])
    stiffness[0, 1] = stiffness[1, 0] = coupling
    return point_mass(stiffness, np.diag([1.0, -1.0, 0.0]))


@pytest.fixture(scope="module")
def shaken_truss():
    """Fourteen free masses; random changes of the stiffness with the speed, and random gyroscopic coupling."""
    standing, random = truss(nodes=18), np.random.default_rng(1)
    changes, coupling = random.standard_normal((2, standing.size, standing.size))
    return rotating(standing, 5e-4 * changes @ changes.T, 0.02 * (coupling - coupling.T))


@pytest.mark.parametrize("gyroscopic", [False, True])
def test_an_order_meets_a_mode_twice(gyroscopic):
    """Of a stiffness with a fourth power of the speed: a + h (W / W_g)^4 = (k W)^2, and a mode beside it."""
    a, b, h, greatest, order = 1e4, 2.3e4, 3.6e4, 100.0, 2.0
    structure = replace(
        point_mass(np.diag([a, b, 9e6]), np.zeros((3, 3))),
        greatest=greatest, higher=(sparse.csr_array(np.diag([h, 0.0, 0.0])),),
    )  # fmt: skip
    diagram = campbell(structure, [0.0, 50.0, greatest], [order], 2, gyroscopic)
    twice = np.sqrt(np.roots([h / greatest**4, -(order**2), a])[::-1])
    expected = sorted([*twice, np.sqrt(b) / order])
    assert [crossing.speed for crossing in diagram.crossings] == pytest.approx(expected, rel=1e-9)
    assert [crossing.mode for crossing in diagram.crossings] == [0, 1, 0]


# coarse speeds: both modes go straight on by their shapes, whatever the gap
COARSE = np.linspace(0.0, 110.0, 6)


@pytest.mark.parametrize("coupling", [1e3, 10.0, 0.1])
def test_veering_has_its_gap(coupling):
    """By the closed form: closest at equal diagonals, the shapes exchanged; the curves do not cross."""
    diagram = campbell(coupled(coupling), COARSE, count=2)
    (veering,) = diagram.veerings
    assert (veering.first, veering.second) == (0, 1) and len(diagram.approaches) == 1
    assert veering.speed == pytest.approx(np.sqrt(5e3), rel=1e-9)
    gap = (np.sqrt(2e4 + coupling) - np.sqrt(2e4 - coupling)) / PI2
    assert veering.gap_hz == pytest.approx(gap, rel=1e-6)
    # the mode at standstill holds sin^2 of half the angle of the other, and so does that at the end
    angles = [0.5 * np.arctan2(coupling, 5e3 - speed**2) for speed in (0.0, 110.0)]
    assert veering.exchange == pytest.approx(np.sin(angles[1] - angles[0]) ** 2, rel=1e-9)
    lower, upper = diagram.frequencies_hz
    root = np.sqrt((5e3 - diagram.speeds**2) ** 2 + coupling**2)
    assert lower == pytest.approx(np.sqrt(2e4 - root) / PI2, rel=1e-12)
    assert upper == pytest.approx(np.sqrt(2e4 + root) / PI2, rel=1e-12)


@pytest.mark.parametrize("last", [110.0, np.sqrt(5e3) * 10 / 7])
def test_modes_without_coupling_cross(last):
    """Each keeps its shape and its closed form, whether a speed of the list is that of the crossing or not."""
    speeds = np.linspace(0.0, last, 11)
    diagram = campbell(coupled(0.0), speeds, count=2)
    assert diagram.speeds == pytest.approx(speeds) and diagram.asked.all() and not diagram.warnings
    (crossing,) = diagram.approaches
    assert (crossing.kind, crossing.first, crossing.second, crossing.gap_hz) == ("crossing", 0, 1, 0.0)
    assert crossing.speed == pytest.approx(np.sqrt(5e3), rel=1e-9)
    assert crossing.frequency_hz == pytest.approx(np.sqrt(2e4) / PI2)
    assert diagram.frequencies_hz[0] == pytest.approx(np.sqrt(1.5e4 + speeds**2) / PI2, rel=1e-12)
    assert diagram.frequencies_hz[1] == pytest.approx(np.sqrt(2.5e4 - speeds**2) / PI2, rel=1e-12)


def test_multiple_modes_are_followed_as_such():
    """A pair of one frequency, in any mixture at every speed, is crossed by a third mode."""
    random = np.random.default_rng(0)
    turn = linalg.qr(random.standard_normal((3, 3)))[0]
    structure = point_mass(turn @ np.diag([2e4, 2e4, 1e4]) @ turn.T, turn @ np.diag([0.0, 0.0, 2.0]) @ turn.T)
    diagram = campbell(structure, np.linspace(0.0, 100.0, 8), count=3)
    assert not diagram.veerings and not diagram.warnings
    assert diagram.frequencies_hz[0] == pytest.approx(np.sqrt(1e4 + 2 * diagram.speeds**2) / PI2)
    assert diagram.frequencies_hz[1:] == pytest.approx(np.sqrt(2e4) / PI2)


def test_mode_that_comes_from_above():
    """It is followed back to standstill, where it is not among the lowest; numbers are places there."""
    structure = point_mass(np.diag([1e4, 2e4, 9e4]), np.diag([9.0, 9.0, 0.0]))
    diagram = campbell(structure, np.linspace(0.0, 120.0, 9), [2.0], count=1)
    assert diagram.modes.tolist() == [0, 2]
    assert diagram.frequencies_hz[1] == pytest.approx(300.0 / PI2)
    # the third mode meets the order at 150 rad/s, past the end
    assert not diagram.crossings


def test_engine_orders_in_closed_form():
    """f^2 = f0^2 + B n^2 meets the order k at n = f0 / sqrt(k^2 - B), n in revolutions a second."""
    squares, slopes = np.array([1e4, 2e4, 9e4]), np.array([3.0, 1.0, 0.5])
    diagram = campbell(point_mass(np.diag(squares), np.diag(slopes)), np.linspace(5.0, 220.0, 7), [1, 1.5, 2, 3], 3)
    expected = [
        (mode, order, np.sqrt(squares[mode] / (order**2 - slopes[mode])))
        for order in (1, 1.5, 2, 3)
        for mode in range(3)
        if order**2 > slopes[mode] and 5.0 <= np.sqrt(squares[mode] / (order**2 - slopes[mode])) <= 220.0
    ]
    assert len(expected) == 7
    found = sorted((crossing.order, crossing.mode, crossing.speed) for crossing in diagram.crossings)
    for (order, mode, speed), (wanted_mode, wanted_order, wanted) in zip(found, expected, strict=True):
        assert (mode, order) == (wanted_mode, wanted_order)
        assert speed == pytest.approx(wanted, rel=1e-12)
    assert all(crossing.frequency_hz == crossing.order * crossing.speed / PI2 for crossing in diagram.crossings)
    assert all(crossing.rpm == pytest.approx(60.0 * crossing.speed / PI2) for crossing in diagram.crossings)


def test_jeffcott_rotor():
    """In the rotating frame w0 -+ W, with the orders k: W = w0 / (k +- 1). The forward mode leaves the backward one."""
    coupling = np.array([[0.0, -2.0, 0.0], [2.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    structure = point_mass(np.diag([1e4, 1e4, 9e6]), np.diag([-1.0, -1.0, 0.0]), coupling)
    diagram = campbell(structure, np.linspace(0.0, 90.0, 10), [1, 2.5, 3], count=2, gyroscopic=True)
    assert diagram.frequencies_hz[0] == pytest.approx((100.0 - diagram.speeds) / PI2, rel=1e-9)
    assert diagram.frequencies_hz[1] == pytest.approx((100.0 + diagram.speeds) / PI2, rel=1e-9)
    assert not diagram.approaches
    found = {(crossing.mode, crossing.order): crossing.speed for crossing in diagram.crossings}
    expected = {(0, 1.0): 50.0, (0, 2.5): 100.0 / 3.5, (0, 3.0): 25.0, (1, 2.5): 100.0 / 1.5, (1, 3.0): 50.0}
    assert found == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("gyroscopic", [False, True])
def test_few_solutions_stand_for_all(shaken_truss, gyroscopic):
    """Frequencies at all speeds, and crossings, as the full matrices have them."""
    speeds, orders = np.linspace(0.0, 8.0, 17), [0.15, 0.2, 0.5]
    diagram = campbell(shaken_truss, speeds, orders, count=4, gyroscopic=gyroscopic, tolerance=1e-9)
    assert len(diagram.solved) < len(speeds) and diagram.error <= 1e-9
    for speed in speeds[[3, 8, 13]]:
        matrices = shaken_truss.at(speed)
        full = gyroscopic_modes(shaken_truss, speed, 4) if gyroscopic else vd.solve_modes(matrices, 4)
        found = np.sort(diagram.frequencies_hz[:, diagram.speeds == speed], axis=None)[:4]
        assert found == pytest.approx(full.frequencies_hz, rel=1e-8)
    free = shaken_truss.standing.free
    k0, k1, g, m = (
        matrix.toarray()[np.ix_(free, free)]
        for matrix in (
            shaken_truss.standing.stiffness, shaken_truss.centrifugal_stiffness, shaken_truss.gyroscopic,
            shaken_truss.standing.mass,
        )
    )  # fmt: skip
    # all crossings of an order at once: linear in the squared speed
    for order in orders:
        values = linalg.eigh(order**2 * m - k1 - 1j * order * g * gyroscopic, k0, eigvals_only=True)[::-1]
        expected = 1.0 / np.sqrt(values[values > 1.0 / 64.0][:4])
        met = [crossing for crossing in diagram.crossings if crossing.order == order]
        assert [crossing.speed for crossing in met] == pytest.approx(expected, rel=1e-8)
        assert met
        for crossing in met:
            curve = diagram.frequencies_hz[diagram.modes == crossing.mode][0]
            assert np.interp(crossing.speed, diagram.speeds, curve) == pytest.approx(crossing.frequency_hz, rel=0.01)


@pytest.mark.parametrize("gyroscopic", [False, True])
def test_error_estimate_bounds_the_error(shaken_truss, gyroscopic):
    """With the ends of the range solved only, at four speeds: at most ten times the error, which is no round-off."""
    with SpeedRange(shaken_truss, 0.0, 8.0, 3, gyroscopic) as source:
        for speed in (2.0, 4.0, 6.0, 7.0):
            if gyroscopic:
                exact = gyroscopic_modes(shaken_truss, speed, 3).frequencies_hz * PI2
            else:
                exact = vd.solve_modes(shaken_truss.at(speed), 3).angular_frequencies
            error = source.modes(speed).frequencies[:3] / exact - 1.0
            estimate = source.errors(speed)[:3]
            assert np.all(error > 1e-5)
            assert np.all(estimate >= error) and np.all(estimate <= 10.0 * error)


def test_slopes_are_derivatives(shaken_truss):
    with SpeedRange(shaken_truss, 0.0, 8.0, 3, True) as source:
        slopes = source.slopes(source.modes(5.0))
        differences = (source.modes(5.001).frequencies - source.modes(4.999).frequencies) / 0.002
    assert slopes == pytest.approx(differences, rel=1e-5)


def test_closest_approach_of_two_modes_among_many(shaken_truss):
    """Every veering is a minimum of the gap, found by minimising it."""
    diagram = campbell(shaken_truss, np.linspace(0.0, 8.0, 9), count=6)
    assert diagram.veerings
    with SpeedRange(shaken_truss, 0.0, 8.0, 6, False) as source:
        for speed in diagram.solved:
            source.add(speed)
        tracks = Tracks(source, np.linspace(0.0, 8.0, 9), 6, 1e-7)
        assert tracks.speeds == pytest.approx(diagram.speeds, abs=1e-6)
        for veering in diagram.veerings:
            place = int(np.searchsorted(source.modes(veering.speed).frequencies, PI2 * veering.frequency_hz)) - 1

            def gap(speed, place=place, source=source):
                return np.diff(source.modes(speed).frequencies[place : place + 2])[0] / PI2

            least = minimize_scalar(gap, bounds=(veering.speed - 0.3, veering.speed + 0.3), method="bounded")
            assert veering.speed == pytest.approx(least.x, abs=1e-3)
            assert veering.gap_hz == pytest.approx(least.fun, rel=1e-6)


def family(random, size=6):
    """Stiffness, its change with the squared speed, and gyroscopic coupling of modes that veer from each other."""
    first, second, coupling = random.standard_normal((3, size, size))
    stiffness = first @ first.T + np.diag(random.uniform(1.0, 10.0, size))
    return stiffness, 0.02 * second @ second.T, 0.2 * (coupling - coupling.T)


def family_spectrum(matrices, speed, gyroscopic):
    """All angular frequencies, by the first-order system."""
    stiffness, change, coupling = matrices
    zero = np.zeros_like(stiffness)
    turning = -speed * gyroscopic * coupling
    rates = linalg.eigvals(np.block([[zero, np.eye(len(zero))], [-stiffness - speed**2 * change, turning]]))
    return np.sort(rates.imag)[len(zero) :]


@pytest.mark.parametrize("gyroscopic", [False, True])
@pytest.mark.parametrize("seed", cases([3, 9, 27, 42], fast=[9, 27]))
def test_families_without_coupling(seed, gyroscopic):
    """Modes cross those of the other family and veer from their own: none leaves its family, all orders are met."""
    random = np.random.default_rng(seed)
    families, turn = [family(random), family(random)], linalg.qr(random.standard_normal((12, 12)))[0]
    stiffness, change, coupling = (turn @ linalg.block_diag(*pair) @ turn.T for pair in zip(*families, strict=True))
    standing = vd.SystemMatrices(0.5 * (stiffness + stiffness.T), np.eye(12), random.normal(size=(4, 3)), [], {}, 0.0)
    structure = rotating(standing, 0.5 * (change + change.T), coupling)
    diagram = campbell(structure, np.linspace(0.0, 20.0, 9), [0.1, 0.3, 1.0], count=5, gyroscopic=gyroscopic)
    assert {approach.kind for approach in diagram.approaches} == {"crossing", "veering"}

    def distances(omega, speed):
        """Of a frequency from those of either family, relative."""
        return [np.abs(family_spectrum(each, speed, gyroscopic) / omega - 1.0).min() for each in families]

    for curve in PI2 * diagram.frequencies_hz:
        known = np.flatnonzero(np.isfinite(curve))
        away = np.array([distances(curve[j], diagram.speeds[j]) for j in known])
        assert away.max(axis=0).min() < 1e-7
    for approach in diagram.approaches:
        middle, half = PI2 * approach.frequency_hz, 0.5 * PI2 * approach.gap_hz
        away = np.array([distances(middle + side * half, approach.speed) for side in (-1, 1)])
        both = away.max(axis=0) < 1e-6
        assert both.all() if approach.kind == "crossing" else both.any()
    # above every order at standstill, and below it at the end if they have met
    last = PI2 * diagram.frequencies_hz[:, -1]
    assert np.count_nonzero(np.isfinite(last)) >= 5 and np.isfinite(last).all() == (not diagram.warnings)
    for order in diagram.orders:
        met = {crossing.mode for crossing in diagram.crossings if crossing.order == order}
        assert met >= set(diagram.modes[last < order * 20.0]) and met.isdisjoint(diagram.modes[last > order * 20.0])


def test_record(tmp_path):
    diagram = campbell(coupled(10.0), COARSE, [1, 2], count=2)
    diagram.save(tmp_path / "campbell.h5")
    again = Campbell.load(tmp_path / "campbell.h5")
    assert again.to_json() == diagram.to_json()
    xarray = pytest.importorskip("xarray")
    with xarray.open_dataset(tmp_path / "campbell.h5", engine="h5netcdf") as data:
        assert data.frequency.dims == ("mode", "speed") and data.frequency.units == "Hz"
        assert data.speed.units == "rad/s" and data.crossing_speed.size == len(diagram.crossings)


@pytest.mark.parametrize(
    ("speeds", "orders", "count", "message"),
    [
        ([0.0], [1], 2, "speeds: expected at least two, rad/s"),
        ([0.0, 0.0], [1], 2, "speeds: expected them ascending"),
        ([-1.0, 1.0], [1], 2, "speeds: expected them ascending from zero or more"),
        ([0.0, 1.0], [0], 2, "orders: expected numbers above zero, not 0"),
        ([0.0, 1.0], [1], 4, r"count: expected 1 to 3 modes \(the free DOFs\), not 4"),
    ],
)
def test_bad_arguments(speeds, orders, count, message):
    with pytest.raises(CampbellError, match=message):
        campbell(coupled(1.0), speeds, orders, count)


def test_unstable_speed():
    with pytest.raises(UnstableError, match="the spin softening outweighs its stiffness above 158"):
        campbell(coupled(1.0), [0.0, 200.0], count=2)
