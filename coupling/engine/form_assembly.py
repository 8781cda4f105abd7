"""Antiderivatives of energies, harmonics and means in a subsystem, as forms of the amplitudes (engine.energy_forms).

A segment's integral is the form at its end less the form at its start. Where the rate by which a product of two modes
changes vanishes relative to the frequency, the form would cancel: such pairs are left out of the forms, and listed.
Flows and scratch space are either engine's.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np

from vanedamp.coupling.numerics.codes import (
    CALM,
    DIFFERENCE,
    FREE_MOMENTUM_MAP,
    HARMONIC_MAP,
    MEAN_MAP,
    MOMENTUM_MAP,
    SINGLE,
    SUM,
    WORK_MAP,
)
from vanedamp.coupling.numerics.compiler.jit import inlined, kernel, summing
from vanedamp.coupling.numerics.compiler.record import record, room
from vanedamp.coupling.numerics.elimination import reciprocal
from vanedamp.coupling.numerics.tolerances import SLOW


@record
class FormScratch(NamedTuple):
    """Space for the forms of m modes: each of N coordinates, of products with w factors."""

    inverse_rate: Annotated[np.ndarray, "m", complex]  # reciprocals of the eigenvalues
    speed: Annotated[np.ndarray, "m N", complex]  # of the coordinates that loads act on
    free: Annotated[np.ndarray, "m", complex]  # momentum of bodies whose motion has a part besides the modes
    along: Annotated[np.ndarray, "m", complex]  # of the rate of a product with a harmonic
    against: Annotated[np.ndarray, "m", complex]  # and of one with its conjugate
    integral: Annotated[np.ndarray, "4 m", complex]
    frame: Annotated[np.ndarray, "m", int]  # harmonic with which a mode turns, -1: none
    span: Annotated[np.ndarray, "m 2", int]  # first factor of a mode that is not zero, and the last plus 1
    left: Annotated[np.ndarray, "2 m w"]  # real and imaginary parts of the factors of a product of modes
    right: Annotated[np.ndarray, "2 m w"]
    reciprocals: Annotated[np.ndarray, "2 m m", complex]  # of the rates of products of modes, SUM and DIFFERENCE
    products: Annotated[np.ndarray, "2 m m", complex]  # of modes k <= j


def new_form_scratch(modes: int, coordinates: int, factors: int) -> FormScratch:
    """Return space for the forms of so many modes."""
    return room(FormScratch, {"m": modes, "N": coordinates, "w": max(factors, 1)})


@kernel
def take_factor(left, right, weight, index, m, forms):
    """Take two functionals of the modes as factors `index`, the last ones, of their products, by a weight."""
    for j in range(m):
        forms.left[0, j, index], forms.left[1, j, index] = left[j].real, left[j].imag
        forms.right[0, j, index], forms.right[1, j, index] = weight * right[j].real, weight * right[j].imag
        forms.span[j, 0], forms.span[j, 1] = 0, index + 1


@inlined
def _is_slow(rate, period):
    """Whether a product with this rate hardly changes over a period."""
    return rate.real * rate.real + rate.imag * rate.imag < (SLOW / period) * (SLOW / period)


@kernel
def set_linear(system, flows, s, m, forms):
    """Set the linear maps, by the columns of numerics.codes."""
    e, linear, driven, load = len(system.frequency), flows.linear[s], flows.driven[s], flows.load[s]
    along, against, integral = forms.along, forms.against, forms.integral
    for j in range(m):
        rate, free = flows.eigenvalue[s, j], forms.free[j]
        along[j] = 0.0j if _is_slow(rate, system.period) else forms.inverse_rate[j]
        integral[0, j] = flows.response[s, j]
        linear[j, FREE_MOMENTUM_MAP], linear[j, FREE_MOMENTUM_MAP + 1] = free.real, -free.imag
    _integrate(integral[0], along, driven, load, m)
    for j in range(m):
        linear[j, MEAN_MAP], linear[j, MEAN_MAP + 1] = 2.0 * integral[0, j].real, -2.0 * integral[0, j].imag
    for h in range(e):
        turn = flows.eigenvalue[s, h]
        for j in range(m):
            rate, with_load, with_conjugate = flows.eigenvalue[s, j], 0.0j, 0.0j
            sum_, difference = rate + turn, rate - turn
            along[j] = 0.0j if _is_slow(sum_, system.period) else reciprocal(sum_)
            # a harmonic and the modes that it drives turn together: a product of one with a conjugate one is slow
            slow = forms.frame[j] == h or _is_slow(difference, system.period)
            against[j] = 0.0j if slow else reciprocal(difference)
            for i in range(system.load.shape[1]):
                with_load += system.load[h, i] * forms.speed[j, i]
                with_conjugate += system.load[h, i].conjugate() * forms.speed[j, i]
            flows.work[s, h, j], integral[0, j], integral[1, j] = with_conjugate, with_load, with_conjugate
        _integrate(integral[0], along, driven, load, m)
        _integrate(integral[1], against, driven, load, m)
        for j in range(m):
            on_x, on_y = 0.5 * (integral[0, j] + integral[1, j]), 0.5j * (integral[0, j] - integral[1, j])
            first = WORK_MAP + 4 * h
            linear[j, first], linear[j, first + 1] = on_x.real, -on_x.imag
            linear[j, first + 2], linear[j, first + 3] = on_y.real, -on_y.imag
        if h == 0:
            for j in range(m):
                integral[0, j], integral[1, j] = flows.response[s, j], flows.response[s, j]
                integral[2, j], integral[3, j] = flows.momentum[s, j], flows.momentum[s, j]
            for i in range(4):
                _integrate(integral[i], against if i % 2 == 0 else along, driven, load, m)
            for j in range(m):
                _set_map(linear[j], HARMONIC_MAP, 0.5 * integral[0, j], 0.5 * integral[1, j].conjugate())
                _set_map(linear[j], MOMENTUM_MAP, 0.5 * integral[2, j], 0.5 * integral[3, j].conjugate())


@inlined
def _set_map(row, first, a, b):
    """Set the map a c + b conj(c): its real part by Re c and Im c, and its imaginary part."""
    row[first], row[first + 1] = (a + b).real, (b - a).imag
    row[first + 2], row[first + 3] = (a + b).imag, (a - b).real


@summing
def _integrate(values, reciprocals, driven, load, m):
    """Replace a functional of the amplitudes by the one with this rate; `reciprocals` of the rates of its terms.

    By parts: a driven mode's rate has a term in its harmonic.
    """
    for j in range(m):
        values[j] *= reciprocals[j]
    for h in range(len(driven) - 1):
        for j in range(driven[h], driven[h + 1]):
            values[h] -= values[j] * load[j] * reciprocals[h]


@kernel
def invert_rates(flows, s, m, period, forms):
    """Set the reciprocals of the rates of products of modes k <= j, 0 for slow ones. List these; return how many."""
    e, count, frame = flows.driven.shape[1] - 1, 0, forms.frame
    for kind in range(2):
        sign = 1.0 if kind == SUM else -1.0
        for j in range(m):
            for k in range(j + 1):
                one, other = flows.eigenvalue[s, j], flows.eigenvalue[s, k]
                rate = complex(one.real + other.real, one.imag + sign * other.imag)
                together = kind == DIFFERENCE and frame[j] == frame[k] and frame[j] >= 0
                if not (together or _is_slow(rate, period)):
                    forms.reciprocals[kind, j, k] = reciprocal(rate)
                    continue
                forms.reciprocals[kind, j, k] = 0.0
                flows.slow[s, count, 0], flows.slow[s, count, 1], flows.slow[s, count, 2] = j, k, kind
                # a mode that is slow relative to a harmonic, or to modes that it drives, is seen from its frame
                flows.slow[s, count, 3] = frame[k] if kind == DIFFERENCE and j >= e else -1
                flows.slow_loss[s, count], flows.slow_dashpot[s, count] = 0.0, 0.0
                count += 1
    return count


@kernel
def list_single(flows, s, m, period, count):
    """List the modes that are left out of means, and calm modes, behind the pairs. Return the number of all."""
    # calm modes hardly change over a period. They swing far out where they are quick to cross: the square of their sum
    # is taken at once (line.energy_balance)
    for i in range(count):
        j, k = flows.slow[s, i, 0], flows.slow[s, i, 1]
        if _is_slow(2.0 * flows.eigenvalue[s, j], period) and _is_slow(2.0 * flows.eigenvalue[s, k], period):
            flows.slow_square[s, i] = 0.0
    for kind in (SINGLE, CALM):
        for j in range(m):
            rate = flows.eigenvalue[s, j]
            calm = _is_slow(2.0 * rate, period)
            if calm or (kind == SINGLE and _is_slow(rate, period)):
                flows.slow[s, count, 0], flows.slow[s, count, 1] = j, 0
                flows.slow[s, count, 2], flows.slow[s, count, 3] = kind, -1
                flows.slow_loss[s, count], flows.slow_dashpot[s, count] = 0.0, 0.0
                flows.slow_square[s, count] = 0.0j if calm else 2.0 * flows.response[s, j]
                count += 1
    return count


@summing
def split(values, parts):
    """Set the real and imaginary parts (2, m, n) of numbers (m, n)."""
    for j in range(values.shape[0]):
        for i in range(values.shape[1]):
            parts[0, j, i], parts[1, j, i] = values[j, i].real, values[j, i].imag


@summing
def damp(damping, left, right, span, m, n, proportional):
    """Set the damping forces of speeds, real and imaginary parts (2, m, n)."""
    for part in range(2):
        for j in range(m):
            first, last = span[j, 0], span[j, 1]
            for i in range(n):
                total = damping[i, i] * left[part, j, i]
                if not proportional:
                    total = 0.0
                    for l in range(first, last):
                        total += damping[i, l] * left[part, j, l]
                right[part, j, i] = total


@kernel
def set_form(flows, s, m, forms, form, slow, pairs):
    """Set the form of a product of modes (FormScratch.left, right), and the parts of the listed slow pairs."""
    products, reciprocals = forms.products, forms.reciprocals
    _multiply(forms.left, forms.right, forms.span, m, products[0], products[1])
    if flows.driven[s, flows.driven.shape[1] - 1] > flows.driven[s, 0]:
        for kind in range(2):
            _integrate_by_parts(products[kind], reciprocals[kind], flows.driven[s], flows.load[s], m, kind == SUM)
    for i in range(pairs):
        j, k, kind = flows.slow[s, i, 0], flows.slow[s, i, 1], flows.slow[s, i, 2]
        slow[i] = products[kind, j, k] * (0.5 if j == k else 1.0)
    _compose(products[0], products[1], reciprocals[0], reciprocals[1], form, m)


@summing
def _multiply(left, right, span, m, both, mixed):
    """Set the products of modes k <= j, left_j right_k and left_j conj(right_k), summed over their factors."""
    for j in range(m):
        first, last = span[j, 0], span[j, 1]
        for k in range(j + 1):
            rr, ii, ri, ir = 0.0, 0.0, 0.0, 0.0
            for i in range(first, last):
                rr += left[0, j, i] * right[0, k, i]
                ii += left[1, j, i] * right[1, k, i]
                ri += left[0, j, i] * right[1, k, i]
                ir += left[1, j, i] * right[0, k, i]
            both[j, k], mixed[j, k] = complex(rr - ii, ri + ir), complex(rr + ii, ir - ri)


@summing
def _integrate_by_parts(product, reciprocals, driven, load, m, plain):
    """Add driven modes to the products of their harmonics; plain: symmetric products, otherwise Hermitian."""
    e = len(driven) - 1
    for j in range(m - 1, -1, -1):  # harmonics, with which these products are summed, last
        for h in range(min(j + 1, e)):
            for k in range(driven[h], driven[h + 1]):
                product[j, h] -= _integral(product, reciprocals, j, k, plain) * _kept(load[k], plain)
            if j < e:
                for k in range(driven[j], driven[j + 1]):
                    product[j, h] -= load[k] * (product[k, h] * reciprocals[k, h])


@inlined
def _kept(value, plain):
    """Return a number, or its conjugate."""
    return value if plain else value.conjugate()


@inlined
def _integral(product, reciprocals, j, k, plain):
    """Return the integral of a product of two modes."""
    if k <= j:
        return product[j, k] * reciprocals[j, k]
    return _kept(product[k, j] * reciprocals[k, j], plain)


@summing
def _compose(both, mixed, of_both, of_mixed, form, m):
    """Set the matrix of Re(c_j (both_jk c_k + mixed_jk conj(c_k)))/2 by real and imaginary parts, integrated."""
    for j in range(m):
        for k in range(j + 1):
            a, b = both[j, k] * of_both[j, k], mixed[j, k] * of_mixed[j, k]
            form[2 * j, 2 * k], form[2 * j, 2 * k + 1] = 0.5 * (a.real + b.real), 0.5 * (b.imag - a.imag)
            form[2 * j + 1, 2 * k], form[2 * j + 1, 2 * k + 1] = -0.5 * (a.imag + b.imag), 0.5 * (b.real - a.real)
    for j in range(2 * m):
        for k in range(j + 1, 2 * m):
            form[j, k] = form[k, j]


@summing
def kick(change, form, kick):
    """Set the product (2m,) of the changes (m,) by a unit impulse with a form."""
    m = len(change)
    for i in range(2 * m):
        kick[i] = 0.0
    for j in range(m):
        x, y = change[j].real, change[j].imag
        if x != 0.0 or y != 0.0:
            for i in range(2 * m):
                kick[i] += x * form[2 * j, i] + y * form[2 * j + 1, i]
