"""The one decorator of compiled functions.

Cached on disk between processes; divisions by zero give inf as in C; no reference counting, which would cost more than
the arithmetic: a compiled function allocates nothing and works in the arrays that it is given (coupling.state.Scratch).
"""

from numba import njit

kernel = njit(cache=True, error_model="numpy", _nrt=False)  # type: ignore[call-overload]  # _nrt is not in its stubs
