"""A program that fails on the first rank while the other one waits for a task; run by tests/commands/test_mpi.py."""

from vanedamp.modal.petsc import ranks

with ranks() as first:
    if first:
        raise RuntimeError("a fault of the program")
