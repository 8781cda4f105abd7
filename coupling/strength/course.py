"""Stress of a motion that is known as polynomials: exact amplitudes and means of its periods, and its histories.

The motion is the course of k outputs (response.records): rows of a period's pieces, in turn, with the outputs and three
derivatives. Between two rows of a segment they are the polynomials of degree 7 that have these at both ends.
"""

from __future__ import annotations

import math

import numpy as np

from vanedamp.coupling.numerics.compiler.jit import comparing, entry, inlined, kernel, summing
from vanedamp.coupling.numerics.tolerances import PEAK
from vanedamp.coupling.quantities.stress import MEASURES
from vanedamp.coupling.strength.stress import PeriodStress

_VON_MISES, _PRINCIPAL = 6, 7
#: columns of a period's rows: the time of the piece, a measure and its slopes, a bound of its second derivative, the
#: product with the largest stress
_AHEAD, _VALUE, _UP, _DOWN, _BENDS, _GOES, _COLUMNS = range(7)
#: error of a peak by a cubic through the ends of a piece: the square of the second derivative over it, times this
_BEND = 0.05
#: of a bound
_ROUND_OFF = 1e-14
#: principal stress of pure shear, over two thirds of von Mises stress
_SHEAR = math.sqrt(0.75)
#: steps to a peak at most
_STEPS = 40
#: gain of a step to a peak, times its height, that is right enough to be added
_SURE = 1e-10
#: difference of principal stresses over the third's, below which they are equal
_EQUAL = 1e-10
_TINY = float(np.finfo(float).tiny)
#: points within a piece, over its length, at which histories are sampled
_SAMPLED = np.arange(4) / 4


def course_stress(course: np.ndarray, rows: np.ndarray) -> PeriodStress:
    """Return the stress of the periods p of a course (n, 2 + 4k); rows: (s, 6, k) Pa per output."""
    counts, spots = np.diff(np.flatnonzero(np.diff(course[:, 0], prepend=-1.0, append=np.inf))), len(rows)
    stress = PeriodStress(np.zeros((len(counts), spots, len(MEASURES))), np.zeros((len(counts), spots, 6)))
    outputs, places, columns = (np.empty((size, counts.max(initial=0))) for size in (4 * rows.shape[2], 24, _COLUMNS))
    _measure(course, rows, outputs, places, columns, np.zeros((3, 6)), *stress)
    return stress


def sampled_course(course: np.ndarray, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return periods (t,) and stresses (s, 6, t), Pa, of samples within the pieces of a course; arguments as there."""
    size, begins = rows.shape[-1], np.flatnonzero(course[:, 1])
    ahead = course[begins, 1]
    parts = [course[begins + end, 2 + d * size :][:, :size] * (ahead**d)[:, None] for end in (0, 1) for d in range(4)]
    weights = np.array([_weights(node)[:8] for node in _SAMPLED.tolist()])
    outputs = np.einsum("uw,wpk->puk", weights, np.array(parts)).reshape(-1, size)
    return np.repeat(course[begins, 0], len(_SAMPLED)), np.moveaxis(outputs @ np.swapaxes(rows, 1, 2), 1, 2)


@entry
def _measure(course, rows, outputs, places, columns, point, amplitude, mean):
    """Set amplitudes (p, s, 8) and means (p, s, 6) of the periods. Room for the rows n of a period at most, in turn:

    outputs: (4k, n) outputs and their derivatives by the time of the piece over its length; places: (24, n) the same of
    the stress; columns: (., n) further numbers; point: (3, 6) stress and slope at a time, and the largest stress.
    """
    size, begin, p = rows.shape[2], 0, 0
    while begin < len(course):
        n, length = 1, 0.0
        while begin + n < len(course) and course[begin + n, 0] == course[begin, 0]:
            n += 1
        for i in range(n):
            row = course[begin + i]
            ahead = row[1] if row[1] > 0.0 else course[begin + i - 1, 1]
            columns[_AHEAD, i], factor = row[1], 1.0
            length += row[1]
            for d in range(4):
                for k in range(size):
                    outputs[d * size + k, i] = factor * row[2 + d * size + k]
                factor *= ahead
        for spot in range(len(rows)):
            for c in range(6):
                mean[p, spot, c] = 0.0
                for k in range(size):
                    if rows[spot, c, k] != 0.0:
                        integral = _integral(outputs, size, k, columns[_AHEAD], n)
                        mean[p, spot, c] += rows[spot, c, k] * integral / length
            _set_places(rows[spot], outputs, places, mean[p, spot], n)
            _measure_period(places, columns, point, amplitude[p, spot], n)
        begin, p = begin + n, p + 1


@summing
def _integral(outputs, size, k, ahead, n):
    """Return the integral of an output over the period."""
    total, x, u, v, w = 0.0, outputs[k], outputs[size + k], outputs[2 * size + k], outputs[3 * size + k]
    for i in range(n - 1):
        total += ahead[i] * (
            (0.5 * (x[i] + x[i + 1]) + (3 / 28) * (u[i] - u[i + 1]))
            + ((1 / 84) * (v[i] + v[i + 1]) + (1 / 1680) * (w[i] - w[i + 1]))
        )  # fmt: skip
    return total


@kernel
def _set_places(rows, outputs, places, mean, n):
    """Set the stresses, about their mean, and their derivatives."""
    size = rows.shape[1]
    for d in range(4):
        for c in range(6):
            place = places[6 * d + c]
            _fill(place, -mean[c] if d == 0 else 0.0, n)
            for k in range(size):
                if rows[c, k] != 0.0:
                    _add_multiple(place, rows[c, k], outputs[d * size + k], n)


@summing
def _fill(place, value, n):
    for i in range(n):
        place[i] = value


@summing
def _add_multiple(place, factor, other, n):
    for i in range(n):
        place[i] += factor * other[i]


@kernel
def _measure_period(places, columns, point, amplitude, n):
    """Set the amplitudes of a spot."""
    _fill(columns[_GOES], 0.0, n)
    for c in range(6):
        _set_size(places, 12 + c, columns[_BENDS], n)
        top = _highest(places, columns, point, places[c], places[6 + c], places[6 + c], n, c, 1.0, 0.0)
        other = _highest(places, columns, point, places[c], places[6 + c], places[6 + c], n, c, -1.0, 0.0)
        amplitude[c] = 0.5 * (top + other)
    value, up, down = columns[_VALUE], columns[_UP], columns[_DOWN]
    _set_von_mises(places, value, up, n)
    _set_bends(places, value, columns[_BENDS], n)
    top = _highest(places, columns, point, value, up, up, n, _VON_MISES, 1.0, 0.0)
    _set_products(places, point[2], columns[_GOES], n)
    other = _highest(places, columns, point, value, up, up, n, _VON_MISES, 1.0, -1.0)
    amplitude[_VON_MISES] = 0.5 * (top + other)
    _set_bounds(places, value, up, down, n)
    top = _highest(places, columns, point, value, up, down, n, _PRINCIPAL, 1.0, 1.0)
    other = _highest(places, columns, point, value, up, down, n, _PRINCIPAL, 1.0, -1.0)
    amplitude[_PRINCIPAL] = 0.5 * (top + other)


@summing
def _set_size(places, row, bends, n):
    for i in range(n):
        bends[i] = abs(places[row, i])


@summing
def _set_von_mises(p, value, slope, n):
    """Set von Mises stress and its slope."""
    for i in range(n):
        a, b, c = p[0, i] - p[1, i], p[1, i] - p[2, i], p[2, i] - p[0, i]
        square = 0.5 * (a * a + b * b + c * c) + 3.0 * (p[3, i] * p[3, i] + p[4, i] * p[4, i] + p[5, i] * p[5, i])
        half = 0.5 * (a * (p[6, i] - p[7, i]) + b * (p[7, i] - p[8, i]) + c * (p[8, i] - p[6, i])) + 3.0 * (
            p[3, i] * p[9, i] + p[4, i] * p[10, i] + p[5, i] * p[11, i]
        )
        value[i] = math.sqrt(square)
        slope[i] = half / max(value[i], _TINY)


@comparing
def _set_bends(p, value, bends, n):
    """Set bounds of second derivatives of von Mises and principal stresses where these are largest."""
    most = _TINY
    for i in range(n):
        most = max(most, value[i])
    for i in range(n):
        turn = p[6, i] * p[6, i] + p[7, i] * p[7, i] + p[8, i] * p[8, i]
        turn += 2.0 * (p[9, i] * p[9, i] + p[10, i] * p[10, i] + p[11, i] * p[11, i])
        bend = p[12, i] * p[12, i] + p[13, i] * p[13, i] + p[14, i] * p[14, i]
        bend += 2.0 * (p[15, i] * p[15, i] + p[16, i] * p[16, i] + p[17, i] * p[17, i])
        bends[i] = 1.25 * math.sqrt(bend) + 1.5 * turn / most


@summing
def _set_products(places, stress, goes, n):
    """Set the products of the stresses with another one."""
    _fill(goes, 0.0, n)
    for c in range(6):
        _add_multiple(goes, stress[c] if c < 3 else 2.0 * stress[c], places[c], n)


@comparing
def _set_bounds(p, value, up, down, n):
    """Set bounds of the largest magnitude of a principal stress, and of its slope, as it grows and as it falls.

    The first is exact for tension and for shear. The slope is that of a stress in proportion, and at most the size of
    what turns the stress.
    """
    for i in range(n):
        mean = (p[0, i] + p[1, i] + p[2, i]) / 3.0
        a, b, c, d, e, f = p[0, i] - mean, p[1, i] - mean, p[2, i] - mean, p[3, i], p[4, i], p[5, i]
        determinant = a * (b * c - e * e) - d * (d * c - e * f) + f * (d * e - b * f)
        second = 0.5 * (a * a + b * b + c * c) + d * d + e * e + f * f
        radius = math.sqrt(second / 3.0)
        third = determinant / max(2.0 * radius * radius * radius, _TINY)
        # tangents of cos(acos(third)/3), which is concave
        high, low = min(1.0, _SHEAR + third / 6.0), min(1.0, _SHEAR - third / 6.0)
        value[i] = (1.0 + _ROUND_OFF) * max(2.0 * radius * high + mean, 2.0 * radius * low - mean)
        square = p[0, i] * p[0, i] + p[1, i] * p[1, i] + p[2, i] * p[2, i] + 2.0 * (d * d + e * e + f * f)
        along = p[0, i] * p[6, i] + p[1, i] * p[7, i] + p[2, i] * p[8, i]
        along = (along + 2.0 * (d * p[9, i] + e * p[10, i] + f * p[11, i])) / max(square, _TINY)
        rate = p[6, i] * p[6, i] + p[7, i] * p[7, i] + p[8, i] * p[8, i]
        rate += 2.0 * (p[9, i] * p[9, i] + p[10, i] * p[10, i] + p[11, i] * p[11, i])
        turns = math.sqrt(max(rate - along * along * square, 0.0))
        up[i], down[i] = max(along * value[i], 0.0) + turns, -max(-along * value[i], 0.0) - turns


@kernel
def _highest(places, columns, point, value, up, down, n, kind, sign, side):
    """Return the largest value of a measure times a sign over the period; at least zero.

    value, up, down: the measure, its slope as it grows and as it falls, or bounds of them. side 1: where the stress
    goes with that of the largest von Mises stress, -1: against it. Of this largest one itself, side 0, the stress is
    kept in point[2].
    """
    goes, bends, ahead, first = columns[_GOES], columns[_BENDS], columns[_AHEAD], 0
    top = max(_top_row(value, goes, sign, side, n), 0.0)
    if kind == _PRINCIPAL or (kind == _VON_MISES and side == 0.0):
        while value[first] != top and first < n - 1:
            first += 1
        _set_row(places, first, point)
        if kind == _PRINCIPAL:
            top = _magnitude(point[0])[0]
        else:
            _copy(point[2], point[0])
    share = _BEND / max(top, _TINY)
    least = top - (4 / 27) * (_size(up, n) + _size(down, n)) - share * _size(bends, n) ** 2
    for i in range(n - 1):
        high = max(sign * value[i], sign * value[i + 1])
        if high <= least or ahead[i] == 0.0 or (side * goes[i] < 0.0 and side * goes[i + 1] < 0.0):
            continue
        a, b, bend = sign * up[i], sign * down[i + 1], max(bends[i], bends[i + 1])
        # where the slope does not vanish the largest value is that of an end
        inside = a > 0.0 > b or abs(a) + abs(b) < bend or abs(side) * goes[i] * goes[i + 1] < 0.0
        if inside and high + (4 / 27) * (max(a, 0.0) + max(-b, 0.0)) + share * bend * bend > top:
            top = _piece(places, goes, point, i, kind, sign, side, top)
    return top


@comparing
def _size(column, n):
    """Return the largest magnitude in a column."""
    most = 0.0
    for i in range(n):
        most = max(most, abs(column[i]))
    return most


@comparing
def _top_row(value, goes, sign, side, n):
    """Return the largest value of all rows on a side."""
    top = 0.0
    for i in range(n):
        top = max(top, sign * value[i] if side * goes[i] >= 0.0 else 0.0)
    return top


@kernel
def _piece(places, goes, point, i, kind, sign, side, top):
    """Return the largest value in piece i, and before."""
    _set_row(places, i, point)
    a, value_a, slope_a, with_a = _taken(point, 0.0, kind, sign, side)
    _set_row(places, i + 1, point)
    b, value_b, slope_b, with_b = _taken(point, 1.0, kind, sign, side)
    if side * with_a < 0.0 or side * with_b < 0.0:
        turn = _turn(places, point, i, a, with_a, b, with_b)
        if side * with_a < 0.0:
            a, value_a, slope_a, with_a = _at(places, point, i, turn, kind, sign, side)
        else:
            b, value_b, slope_b, with_b = _at(places, point, i, turn, kind, sign, side)
    top = max(top, max(value_a, value_b))
    if slope_a > 0.0 > slope_b:
        return _peak(places, point, i, a, value_a, slope_a, b, value_b, slope_b, kind, sign, side, top)
    # the slope may change its sign twice
    middle, value, slope, _ = _at(places, point, i, 0.5 * (a + b), kind, sign, side)
    top = max(top, value)
    if slope_a > 0.0 > slope:
        return _peak(places, point, i, a, value_a, slope_a, middle, value, slope, kind, sign, side, top)
    if slope > 0.0 > slope_b:
        return _peak(places, point, i, middle, value, slope, b, value_b, slope_b, kind, sign, side, top)
    return top


@kernel
def _peak(places, point, i, a, value_a, slope_a, b, value_b, slope_b, kind, sign, side, top):
    """Return the value where the slope vanishes between a and b, or the old one.

    By Newton's method from the cubic through the ends, with its curvature: what a step still gains is right to some
    hundredths.
    """
    begin, h, rise = a, b - a, value_b - value_a
    start = h * slope_a
    bend, third = 6.0 * rise - 4.0 * start - 2.0 * h * slope_b, 3.0 * (start + h * slope_b) - 6.0 * rise
    down = math.sqrt(max(bend * bend - 4.0 * third * start, 0.0)) - bend
    u = 2.0 * start / down if down > 0.0 else 0.5
    t = begin + h * u if 0.0 < u < 1.0 else a + h * slope_a / (slope_a - slope_b)
    for _ in range(_STEPS):
        _, value, slope, _ = _at(places, point, i, t, kind, sign, side)
        curve = (bend + 2.0 * third * (t - begin) / h) / (h * h)
        gain = -0.5 * slope * slope / curve if curve < 0.0 else math.inf
        sure = gain <= _SURE * value
        height = value + gain if sure else value
        if height > top:
            top = height
            if kind == _VON_MISES and side == 0.0:
                _copy(point[2], point[0])
        if sure:
            break
        if slope > 0.0:
            a, slope_a = t, slope
        else:
            b, slope_b = t, slope
        step = t - slope / curve if curve < 0.0 else a
        t = step if a < step < b else 0.5 * (a + b)
    return top


@kernel
def _turn(places, point, i, a, with_a, b, with_b):
    """Return where in a piece, from a to b, the stress begins to go against the largest one, or with it."""
    last = 0
    for _ in range(_STEPS):
        t = a + (b - a) * with_a / (with_a - with_b)
        _set_point(places, point, i, t, 0, 6)
        goes = _product(point[2], point[0])
        if goes == 0.0 or min(t - a, b - t) <= PEAK:
            return t
        if (goes > 0.0) == (with_a > 0.0):
            a, with_a, with_b, last = t, goes, 0.5 * with_b if last == 1 else with_b, 1
        else:
            b, with_b, with_a, last = t, goes, 0.5 * with_a if last == -1 else with_a, -1
    return t


@kernel
def _at(places, point, i, t, kind, sign, side):
    """Return the time t in piece i, over its length, a measure there, its slope, and the product with the largest."""
    first, last = (kind, kind + 1) if kind < _VON_MISES else (0, 6)
    _set_point(places, point, i, t, first, last)
    return _taken(point, t, kind, sign, side)


@kernel
def _taken(point, t, kind, sign, side):
    if kind < _VON_MISES:
        return t, sign * point[0, kind], sign * point[1, kind], 0.0
    goes = _product(point[2], point[0]) if side != 0.0 else 0.0
    value, slope = _von_mises(point) if kind == _VON_MISES else _magnitude_and_slope(point)
    return t, value, slope, goes


@inlined
def _set_row(places, i, point):
    for c in range(6):
        point[0, c], point[1, c] = places[c, i], places[6 + c, i]


@kernel
def _set_point(places, point, i, t, first, last):
    """Set stress and slope at a time t in piece i, over its length, of some components."""
    a0, a1, a2, a3, b0, b1, b2, b3, c0, c1, c2, c3, d0, d1, d2, d3 = _weights(t)
    for c in range(first, last):
        x, y, z, w = places[c, i], places[6 + c, i], places[12 + c, i], places[18 + c, i]
        p, q, r, s = places[c, i + 1], places[6 + c, i + 1], places[12 + c, i + 1], places[18 + c, i + 1]
        point[0, c] = (a0 * x + a1 * y + a2 * z + a3 * w) + (b0 * p + b1 * q + b2 * r + b3 * s)
        point[1, c] = (c0 * x + c1 * y + c2 * z + c3 * w) + (d0 * p + d1 * q + d2 * r + d3 * s)


@entry
def _weights(t):
    """Return the weights of value and three derivatives at both ends in a polynomial and its slope, t in [0, 1]."""
    u, t2, u2 = 1.0 - t, t * t, (1.0 - t) * (1.0 - t)
    t3, u3, flat = t * t2, u * u2, 140.0 * t * t2 * (1.0 - t) * (1.0 - t) * (1.0 - t)
    t4, u4 = t2 * t2, u2 * u2
    return (
        u4 * (1.0 + t * (4.0 + t * (10.0 + 20.0 * t))), u4 * t * (1.0 + t * (4.0 + 10.0 * t)),
        u4 * t2 * (0.5 + 2.0 * t), u4 * t3 * (1 / 6),
        t4 * (1.0 + u * (4.0 + u * (10.0 + 20.0 * u))), -t4 * u * (1.0 + u * (4.0 + 10.0 * u)),
        t4 * u2 * (0.5 + 2.0 * u), -t4 * u3 * (1 / 6),
        -flat, u3 * (1.0 + t * (3.0 + t * (6.0 - 70.0 * t))), u3 * t * (1.0 + t * (3.0 - 14.0 * t)),
        u3 * t2 * (0.5 - (7 / 6) * t),
        flat, t3 * (1.0 + u * (3.0 + u * (6.0 - 70.0 * u))), -t3 * u * (1.0 + u * (3.0 - 14.0 * u)),
        t3 * u2 * (0.5 - (7 / 6) * u),
    )  # fmt: skip


@inlined
def _copy(one, other):
    for c in range(6):
        one[c] = other[c]


@inlined
def _product(one, other):
    """Return the product of two symmetric tensors."""
    return one[0] * other[0] + one[1] * other[1] + one[2] * other[2] + 2.0 * (
        one[3] * other[3] + one[4] * other[4] + one[5] * other[5]
    )  # fmt: skip


@inlined
def _von_mises(place):
    """Return von Mises stress and its slope, of a stress and its slope."""
    s, r = place[0], place[1]
    a, b, c = s[0] - s[1], s[1] - s[2], s[2] - s[0]
    square = 0.5 * (a * a + b * b + c * c) + 3.0 * (s[3] * s[3] + s[4] * s[4] + s[5] * s[5])
    value = math.sqrt(square)
    half = 0.5 * (a * (r[0] - r[1]) + b * (r[1] - r[2]) + c * (r[2] - r[0])) + 3.0 * (
        s[3] * r[3] + s[4] * r[4] + s[5] * r[5]
    )
    return value, half / value if value > 0.0 else 0.0


@kernel
def _magnitude(stress):
    """Return the largest magnitude of a principal stress (strength.stress.scalar_stresses), and the stress itself."""
    s = stress
    mean = (s[0] + s[1] + s[2]) / 3.0
    a, b, c = s[0] - mean, s[1] - mean, s[2] - mean
    determinant = a * (b * c - s[4] * s[4]) - s[3] * (s[3] * c - s[4] * s[5]) + s[5] * (s[3] * s[4] - b * s[5])
    radius = math.sqrt((0.5 * (a * a + b * b + c * c) + s[3] * s[3] + s[4] * s[4] + s[5] * s[5]) / 3.0)
    third = min(max(determinant / max(2.0 * radius * radius * radius, _TINY), -1.0), 1.0)
    angle = math.acos(third) / 3.0
    high, low = mean + 2.0 * radius * math.cos(angle), mean + 2.0 * radius * math.cos(angle + 2.0 * math.pi / 3.0)
    return (high, high) if high >= -low else (-low, low)


@inlined
def _magnitude_and_slope(point):
    size, value = _magnitude(point[0])
    return size, _along(point, value) if value > 0.0 else -_along(point, value)


@kernel
def _along(point, value):
    """Return the slope of a principal stress: with the adjugate of the stress less this one, a square of its direction.

    Of two that are equal it is the mean, of all three as well.
    """
    s, r = point[0], point[1]
    a, b, c, d, e, f = s[0] - value, s[1] - value, s[2] - value, s[3], s[4], s[5]
    x, y, z = b * c - e * e, a * c - f * f, a * b - d * d
    turned = r[0] * x + r[1] * y + r[2] * z
    turned += 2.0 * (r[3] * (e * f - d * c) + r[4] * (d * f - a * e) + r[5] * (d * e - b * f))
    size, single = a * a + b * b + c * c + 2.0 * (d * d + e * e + f * f), a + b + c
    if abs(x + y + z) > _EQUAL * size:
        return turned / (x + y + z)
    total = r[0] + r[1] + r[2]
    if single == 0.0:
        return total / 3.0
    along = (r[0] * a + r[1] * b + r[2] * c + 2.0 * (r[3] * d + r[4] * e + r[5] * f)) / single
    return 0.5 * (total - along)
