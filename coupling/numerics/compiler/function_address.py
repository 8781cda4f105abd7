"""Functions of two numbers that compiled code calls by their address: one compiled caller serves them all."""

from __future__ import annotations

from collections.abc import Callable
from ctypes import CFUNCTYPE, c_double, c_void_p, cast
from functools import cache
from typing import Any

from llvmlite import ir
from numba import cfunc, config, types
from numba.extending import intrinsic, overload

_PROTOTYPE = CFUNCTYPE(c_double, c_double, c_double)


#: compiled functions, for ever: the code goes with them, and records hold its address
_KEPT: list[Any] = []


@cache
def address_of(function: Callable[[float, float], float]) -> int:
    """Return the address of a function of two floats, compiled at the first call; divisions by zero give inf."""
    if config.DISABLE_JIT:  # type: ignore[attr-defined]  # plain Python, for a debugger
        plain = _PROTOTYPE(function)
        _KEPT.append(plain)
        return int(cast(plain, c_void_p).value or 0)
    compiled: Any = cfunc(types.float64(types.float64, types.float64), error_model="numpy")(function)
    _KEPT.append(compiled)
    return int(compiled.address)


def call(address: int, first: float, second: float) -> float:
    """Return the value of the function at an address."""
    value: float = _PROTOTYPE(address)(first, second)
    return value


@overload(call, inline="always")
def _call_compiled(address, first, second):
    return lambda address, first, second: _jump(address, first, second)


@intrinsic
def _jump(typing_context, address, first, second):
    """Call the function at an address."""

    def code(context, builder, signature, values):
        number = ir.DoubleType()
        function = builder.inttoptr(values[0], ir.FunctionType(number, [number, number]).as_pointer())
        return builder.call(function, values[1:])

    return types.float64(types.int64, types.float64, types.float64), code
