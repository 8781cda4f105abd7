"""The number of modes that a reduction needs: all models of a basis with their error estimates, from one reduction.

The estimate is that of rom.error_estimate: the residual's response in the basis with two more blocks of quasi-static
modes.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vanedamp.modal.matrices import SystemMatrices
from vanedamp.rom.bases.projection import Factorize, superlu
from vanedamp.rom.basis import basis_named
from vanedamp.rom.error_estimate import Rung, frf_errors
from vanedamp.rom.interface import Interface
from vanedamp.rom.reduced import ReducedModel

#: blocks of quasi-static coordinates that the estimate of a model needs in addition to its own
BLOCKS = 2


def rich_model(
    matrices: SystemMatrices,
    interface: Interface,
    basis: str,
    modes: int,
    factorize: Factorize = superlu,
    keep_recovery: bool = False,
) -> ReducedModel:
    """Reduce a structure so far that every model of a basis up to `modes`, and its estimate, can be cut from it.

    Craig-Bampton models are those with one block of quasi-static modes. Other arguments: those of rom.reduction.reduce.
    """
    return basis_named(basis).rich(matrices, interface, modes, factorize, 1 + BLOCKS, keep_recovery)


def basis_model(rich: ReducedModel, basis: str, modes: int) -> ReducedModel:
    """Return the model of a basis with `modes` modes, cut from `rich_model`."""
    return basis_named(basis).cut(rich, modes)


def basis_ladder(
    rich: ReducedModel, basis: str, frequencies_hz: np.ndarray, labels: Sequence[str] | None = None
) -> list[Rung]:
    """Return the error of every model of a basis that `rich_model` holds, against the latter."""
    rungs = []
    for modes in range(basis_named(basis).least_modes(rich), rich.modes + 1):
        model = basis_model(rich, basis, modes)
        errors = frf_errors(model, rich, frequencies_hz, labels)
        rungs.append(Rung(modes, model.size, float(errors.max()), 0.0))
    return rungs
