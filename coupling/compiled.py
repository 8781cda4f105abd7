"""The one decorator of compiled functions: cached on disk between processes, divisions by zero give inf as in C."""

from numba import njit

kernel = njit(cache=True, error_model="numpy")
