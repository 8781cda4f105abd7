"""Numba: the decorators, machine code in memory and on disk, records, addresses of functions.

Nothing else in the package imports numba. Much of this is undocumented by numba; the list is
tests/coupling/numerics/compiler/test_numba.py, which names what a new version has changed.
"""
