"""Engine orders and modes of a ring: the diameters that they excite, and where they meet."""

from dataclasses import replace

import numpy as np
import pytest

from tests.tools.plate_rings import plate_waves
from vanedamp.modal.records.campbell import Campbell, OrderCrossing
from vanedamp.modal.records.interference import Interference


def over_speed(modes, crossings):
    """A Campbell diagram of a ring's modes at two speeds."""
    nothing, speeds = np.zeros(2), [0.0, 500.0]
    return Campbell(
        speeds, [True, True], np.arange(len(modes)), np.ones((len(modes), 2)), nothing, speeds, (2.0,), crossings, (),
        diameters=modes.diameters, families=modes.families,
    )  # fmt: skip


@pytest.mark.parametrize("sectors", [8, 9])
def test_an_order_excites_the_wave_that_it_is_at_the_sectors(sectors):
    """Sampled at N sectors, cos(r j alpha) has no part in any cosine or sine but those of one diameter."""
    found = Interference(plate_waves(sectors), range(1, 3 * sectors + 1))
    angles = 2 * np.pi * np.arange(sectors) / sectors
    for order in found.orders:
        load = np.exp(1j * order * angles)
        parts = [abs(np.vdot(np.exp(1j * h * angles), load)) + abs(np.vdot(np.exp(-1j * h * angles), load))
                 for h in range(sectors // 2 + 1)]  # fmt: skip
        assert np.flatnonzero(np.array(parts) > 1e-9).tolist() == [found.excited(order)]
        assert order in found.exciting(found.excited(order))


@pytest.mark.parametrize("sectors", [8, 9])
def test_orders_lie_on_the_folded_line(sectors):
    """Order r at r speed / (2 pi): on the line through the corners, at the diameter that it excites."""
    found = Interference(plate_waves(sectors), range(1, 40))
    speed = 150.0
    corners, heights = found.zigzag(speed)
    assert heights[-1] == pytest.approx(found.top) and set(corners[:-1]) == {0.0, sectors / 2}
    for order in found.orders:
        frequency = order * speed / (2 * np.pi)
        if frequency < found.top:
            assert np.interp(frequency, heights, corners) == pytest.approx(found.excited(order), abs=1e-9)


def test_meetings_at_constant_frequencies():
    """Speed = 2 pi f / r, of all orders and modes within the range of operation."""
    modes = plate_waves(8)
    found = Interference(modes, operating=(100.0, 400.0))
    expected = sorted(
        2 * np.pi * f / r
        for h, f in zip(modes.diameters, modes.frequencies_hz, strict=True) for r in range(1, 9)
        if min(r % 8, -r % 8) == h and 100.0 <= 2 * np.pi * f / r <= 400.0
    )  # fmt: skip
    assert len(expected) > 5
    assert [each.speed for each in found.meetings] == pytest.approx(expected, rel=1e-12)
    assert found.in_operation == found.meetings
    assert Interference(modes).meetings == ()


def test_meetings_of_a_campbell_diagram():
    """Its crossings, of which those within the range of operation are in operation."""
    crossings = tuple(
        OrderCrossing(mode, 2.0, speed, speed / np.pi) for mode, speed in ((2, 100.0), (3, 250.0), (2, 400.0))
    )
    found = Interference(plate_waves(8), operating=(200.0, 300.0), campbell=over_speed(plate_waves(8), crossings))
    assert found.meetings == crossings and found.in_operation == crossings[1:2]


def test_the_diagram_has_the_modes_of_the_ring():
    """Curves in another order, one more and one less: rows and crossings belong to diameter and family."""
    modes, order = plate_waves(8), np.array([4, 2, 7, 0, 1, 3, 5, 6, 8])
    crossings = tuple(OrderCrossing(curve, 2.0, 10.0 + curve, 3.0) for curve in (1, 9, 0))
    curves = np.append(10.0 * order, 1e3)
    diagram = replace(
        over_speed(modes, crossings), modes=np.arange(10), diameters=np.append(modes.diameters[order], 9),
        families=np.append(modes.families[order], 0), frequencies_hz=np.column_stack([curves, curves + 1.0]),
    )  # fmt: skip
    found = Interference(modes, campbell=diagram)
    expected = np.append(10.0 * np.arange(9), np.nan)
    np.testing.assert_array_equal(found.over_speed_hz, np.column_stack([expected, expected + 1.0]))
    assert [(each.mode, each.speed) for each in found.crossings] == [(2, 11.0), (4, 10.0)]


def test_waves_that_turn_apart_are_met_by_their_own_orders():
    """Ring that turns: the order h runs against the turn, N - h with it."""
    modes = plate_waves(8, families=1)
    signed = np.concatenate([modes.diameters, -modes.diameters[1:4]])
    rows = np.r_[0:5, 1:4]
    split = type(modes)(8, modes.axis, modes.point, signed, np.zeros(8, int), modes.frequencies_hz[rows],
                        np.zeros(8), modes.shapes[rows])  # fmt: skip
    found = Interference(split)
    assert [found.excited(order) for order in range(1, 9)] == [1, 2, 3, 4, -3, -2, -1, 0]
    assert found.name(1) == "diameter 1 backward, family 1" and found.name(5) == "diameter 1 forward, family 1"
    assert found.exciting(-2) == [6]


def test_file_keeps_it(tmp_path):
    modes = plate_waves(8)
    diagram = over_speed(modes, (OrderCrossing(2, 3.0, 60.0, 28.6),))
    given = Interference(modes, [3, 5], speed=200.0, operating=(190.0, 210.0), campbell=diagram)
    given.save(tmp_path / "ring.h5")
    found = Interference.load(tmp_path / "ring.h5")
    assert found.to_json() == given.to_json() and found.orders == (3, 5) and found.crossings == diagram.crossings
    modes.save(tmp_path / "bare.h5")
    assert Interference.load(tmp_path / "bare.h5").to_json() == Interference(modes).to_json()
