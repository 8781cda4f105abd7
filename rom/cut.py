"""A reduced model with fewer of its modes: `ReducedModel.truncated`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from rom.boundary import residual_fields
from rom.fields import ReducedModelError
from rom.spectrum import check_elastic, krylov, rigid_motions, spectrum

if TYPE_CHECKING:
    from rom.reduced import ReducedModel


def truncated(model: ReducedModel, modes: int, blocks: int | None = None) -> ReducedModel:
    """ReducedModel.truncated."""
    if not 0 <= modes <= model.modes:
        kind = "free" if model.free_modes else "fixed"
        raise ReducedModelError(
            f"modes: expected 0 to {model.modes} (the {kind}-interface modes of this model), "
            f"not {modes}; reduce again to keep more"
        )
    blocks = len(model.blocks) if blocks is None else blocks
    if not 0 <= blocks <= len(model.blocks):
        raise ReducedModelError(f"blocks: expected 0 to {len(model.blocks)} (those of this model), not {blocks}")
    if model.free_modes:
        return _free_truncated(model, modes, blocks)
    lead = model.size - model.modes - sum(model.blocks) + sum(model.blocks[:blocks])
    first = model.size - model.modes
    kept = np.r_[0:lead, first : first + modes]
    return model.projected(np.eye(model.size)[:, kept], fixed_interface_modes=modes, blocks=model.blocks[:blocks])


def _free_truncated(model: ReducedModel, modes: int, blocks: int) -> ReducedModel:
    """Free-interface modes beyond `modes` go; the blocks are built anew in the space of what is dropped."""
    first = model.size - model.free_modes
    kept = np.arange(first, first + modes)
    dropped = np.setdiff1d(np.arange(model.size), kept)
    changes: dict[str, Any] = {"free_modes": modes, "blocks": ()}
    inertia, rigidity = (matrix[np.ix_(dropped, dropped)] for matrix in (model.mass, model.stiffness))
    own: list[np.ndarray] = []
    if (blocks or model.residual_flexibility is not None) and dropped.size:
        check_elastic(rigid_motions(rigidity, *spectrum(inertia, rigidity)), 0)
        static = np.linalg.solve(rigidity, model.selection[:, dropped].T)
        if model.residual_flexibility is not None:
            lost = np.zeros((model.size, len(model.interface)))
            lost[dropped] = static
            changes |= residual_fields(model, lost)
        own = krylov(static, rigidity, inertia, blocks)
    basis = np.zeros((model.size, sum(block.shape[1] for block in own) + modes))
    if own:
        basis[dropped, : basis.shape[1] - modes] = np.hstack(own)
    basis[kept, basis.shape[1] - modes :] = np.eye(modes)
    if basis.shape[1] == 0:
        raise ReducedModelError("modes: none are left, and nothing else")
    return model.projected(basis, **(changes | {"blocks": tuple(block.shape[1] for block in own)}))
