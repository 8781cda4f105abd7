"""Smaller models of a reduced model: with fewer of its modes, or its own natural modes and the rest statically."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from scipy import linalg

from vanedamp.modal.algebra import krylov, orthonormal, symmetric_part
from vanedamp.rom.checks import ReducedModelError
from vanedamp.rom.dense_modes import check_elastic, count_rigid_motions, spectrum
from vanedamp.rom.reduced import ReducedModel

# natural modes and the residual response belong to one stiffness
_AT_ONE_SPEED: dict[str, Any] = {"centrifugal_stiffness": None, "higher_stiffness": None, "greatest_speed": 0.0}


def truncated(model: ReducedModel, modes: int, blocks: int | None = None) -> ReducedModel:
    """Return the model with only its first `modes` modes and its first `blocks` blocks of quasi-static coordinates.

    The static interface stays exact: with fixed-interface modes anyway; of free-interface modes, the blocks and the
    residual flexibility take over the static part of the dropped ones. A damping ratio holds for the modes of the
    smaller model; any other C is cut. Raises ReducedModelError when more are asked for than there are.
    """
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
    retained = np.r_[0:lead, first : first + modes]
    return model.projected(np.eye(model.size)[:, retained], fixed_interface_modes=modes, blocks=model.blocks[:blocks])


def _free_truncated(model: ReducedModel, modes: int, blocks: int) -> ReducedModel:
    """Drop free-interface modes beyond `modes`, and rebuild the blocks in the space of the dropped ones."""
    first = model.size - model.free_modes
    retained = np.arange(first, first + modes)
    dropped = np.setdiff1d(np.arange(model.size), retained)
    changes: dict[str, Any] = {"free_modes": modes, "blocks": ()}
    inertia, rigidity = (matrix[np.ix_(dropped, dropped)] for matrix in (model.mass, model.stiffness))
    attachments: list[np.ndarray] = []
    if (blocks or model.residual_flexibility is not None) and dropped.size:
        check_elastic(count_rigid_motions(rigidity, *spectrum(inertia, rigidity)), 0)
        try:
            static = np.linalg.solve(rigidity, model.selection[:, dropped].T)
        except np.linalg.LinAlgError:  # singular to the last bit, where the count has seen no rigid motion
            check_elastic(1, 0)
            raise
        if model.residual_flexibility is not None:
            lost = np.zeros((model.size, len(model.interface)))
            lost[dropped] = static
            changes |= residual_fields(model, lost)
        attachments = krylov(static, partial(np.linalg.solve, rigidity), inertia, blocks)
    basis = np.zeros((model.size, sum(block.shape[1] for block in attachments) + modes))
    if attachments:
        basis[dropped, : basis.shape[1] - modes] = np.hstack(attachments)
    basis[retained, basis.shape[1] - modes :] = np.eye(modes)
    if basis.shape[1] == 0:
        raise ReducedModelError("modes: none are left, and nothing else")
    return model.projected(basis, **(changes | {"blocks": tuple(block.shape[1] for block in attachments)}))


def massless(model: ReducedModel, modes: int) -> ReducedModel:
    """Return a model's own lowest `modes` natural modes, with the rest of its flexibility as a massless boundary.

    MacNeal (1971), Computers and Structures 1(4), in modal coordinates eta with the interface's forces f,

        eta'' + C eta' + diag(omega^2) eta = Phi_b^T f,   u = Phi_b eta + G f,

    where G is the interface's flexibility that the modes lack. Monjaraz-Tec, Gross and Krack (2022), Computers and
    Structures 259: contact on it is quasi-static and needs no impact law. `boundary_form` has the singular mass.
    Of a model that rotates it is that at standstill: take the model at its speed first. Raises ReducedModelError for
    fewer modes than the structure has rigid motions.
    """
    squares, shapes = spectrum(model.mass, model.stiffness)
    if not 0 < modes <= model.size:
        raise ReducedModelError(f"modes: expected 1 to {model.size} (the modes of this model), not {modes}")
    check_elastic(model.rigid_modes, modes)
    static = shapes[:, modes:] / squares[modes:] @ (model.selection @ shapes[:, modes:]).T
    changes = {"fixed_interface_modes": 0, "free_modes": modes, "blocks": (), **_AT_ONE_SPEED}
    return model.projected(shapes[:, :modes], **changes, **residual_fields(model, static))


def with_attachment_modes(model: ReducedModel, modes: int) -> ReducedModel:
    """Return a model's own lowest `modes` natural modes after residual attachment modes, with their mass (Rubin 1975).

    As many more coordinates as the interface has independent ones; its flexibility stays exact. Of a model that rotates
    it is that at standstill: take the model at its speed first. Raises ReducedModelError for all of the modes, or
    fewer than the structure has rigid motions.
    """
    squares, shapes = spectrum(model.mass, model.stiffness)
    if not 0 < modes < model.size:
        raise ReducedModelError(f"modes: expected 1 to {model.size - 1} (fewer than all of this model), not {modes}")
    check_elastic(model.rigid_modes, modes)
    dropped = shapes[:, modes:]
    static = (model.selection @ dropped).T / squares[modes:, None]
    block = orthonormal(static, np.eye(len(static)))
    changes = {"fixed_interface_modes": 0, "free_modes": modes, "blocks": (block.shape[1],), **_AT_ONE_SPEED}
    return model.projected(np.hstack([dropped @ block, shapes[:, :modes]]), **changes)


def boundary_form(model: ReducedModel) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return mass (singular), damping and stiffness (k + n, k + n) in (u, eta) of a model with a massless boundary.

    Eliminates the forces, f = G^-1 (u - selection eta). Raises ReducedModelError unless G is positive definite.
    """
    residual = model.residual_flexibility
    if residual is None or linalg.eigvalsh(residual)[0] <= 0.0:
        raise ReducedModelError(
            "residual_flexibility: not positive definite, so that not every interface coordinate is without mass"
        )
    rows = np.hstack([np.eye(len(residual)), -model.selection])
    size = len(residual)
    mass, damping, stiffness = (
        linalg.block_diag(np.zeros((size, size)), matrix) for matrix in (model.mass, model.damping, model.stiffness)
    )
    return mass, damping, symmetric_part(stiffness + rows.T @ np.linalg.solve(residual, rows))


def residual_fields(model: ReducedModel, static: np.ndarray) -> dict[str, Any]:
    """Return the residual fields of a model after the response q = static @ f (n, k) has become part of them."""

    def grown(rows: np.ndarray | None, before: np.ndarray | None) -> np.ndarray | None:
        if rows is None:
            return None
        return rows @ static if before is None else rows @ static + before

    flexibility = grown(model.selection, model.residual_flexibility)
    assert flexibility is not None
    return {
        "residual_flexibility": symmetric_part(flexibility),
        "residual_recovery": grown(model.recovery, model.residual_recovery),
        "output_residual": grown(model.output_rows, model.output_residual),
    }
