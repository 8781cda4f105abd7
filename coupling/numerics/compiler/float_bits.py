"""Functions of floats that compiled code computes from their bits, without a call."""

from __future__ import annotations

import math

from llvmlite import ir
from numba import types
from numba.extending import intrinsic, overload


def power_of_two(k):
    """Return 2^k of a whole number k from -1022 to 1023, a float."""
    return math.ldexp(1.0, int(k))


@overload(power_of_two, inline="always")
def _power_compiled(k):
    return lambda k: _float_of_exponent(k)


@intrinsic
def _float_of_exponent(typing_context, k):
    """Return the float with this exponent: its bits."""

    def code(context, builder, signature, values):
        integer = ir.IntType(64)
        # with 2^52 + 1023 added, the last bits of the sum are those of the exponent
        exponent = builder.fadd(values[0], ir.Constant(ir.DoubleType(), 2.0**52 + 1023.0))
        return builder.bitcast(
            builder.shl(builder.bitcast(exponent, integer), ir.Constant(integer, 52)), ir.DoubleType()
        )

    return types.float64(types.float64), code


def eighth_root_of_ratio(x, y):
    """Return (x/y)^(1/8) of positive numbers; compiled: to 7 percent, without a division or a root."""
    return (x / y) ** 0.125


@overload(eighth_root_of_ratio, inline="always")
def _ratio_compiled(x, y):
    return lambda x, y: _by_logarithms(x, y)


@intrinsic
def _by_logarithms(typing_context, x, y):
    """Return the eighth root of a ratio with the bits of doubles for their logarithms: linear between powers of two."""

    def code(context, builder, signature, values):
        integer, number = ir.IntType(64), ir.DoubleType()
        first, second = (builder.bitcast(value, integer) for value in values)
        share = builder.ashr(builder.sub(first, second), ir.Constant(integer, 3))
        return builder.bitcast(builder.add(share, ir.Constant(integer, 1023 << 52)), number)

    return types.float64(types.float64, types.float64), code
