"""Boundaries without mass: natural modes, and what the interface yields under its forces besides."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from scipy import linalg

from rom.fields import ReducedModelError
from rom.spectrum import check_elastic, halved, krylov, spectrum

if TYPE_CHECKING:
    from rom.reduced import ReducedModel


def massless(model: ReducedModel, modes: int) -> ReducedModel:
    """ReducedModel.massless."""
    squares, shapes = spectrum(model.mass, model.stiffness)
    if not 0 < modes <= model.size:
        raise ReducedModelError(f"modes: expected 1 to {model.size} (the modes of this model), not {modes}")
    check_elastic(model.rigid_modes, modes)
    static = shapes[:, modes:] / squares[modes:] @ (model.selection @ shapes[:, modes:]).T
    kept = {"fixed_interface_modes": 0, "free_modes": modes, "blocks": ()}
    return model.projected(shapes[:, :modes], **kept, **residual_fields(model, static))


def attached(model: ReducedModel, modes: int) -> ReducedModel:
    """ReducedModel.attached."""
    squares, shapes = spectrum(model.mass, model.stiffness)
    if not 0 < modes < model.size:
        raise ReducedModelError(f"modes: expected 1 to {model.size - 1} (fewer than all of this model), not {modes}")
    check_elastic(model.rigid_modes, modes)
    dropped = shapes[:, modes:]
    static = (model.selection @ dropped).T / squares[modes:, None]
    block = np.hstack(krylov(static, np.diag(squares[modes:]), np.eye(len(static)), 1))
    kept = {"fixed_interface_modes": 0, "free_modes": modes, "blocks": (block.shape[1],)}
    return model.projected(np.hstack([dropped @ block, shapes[:, :modes]]), **kept)


def boundary_form(model: ReducedModel) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """ReducedModel.boundary_form."""
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
    return mass, damping, halved(stiffness + rows.T @ np.linalg.solve(residual, rows))


def residual_fields(model: ReducedModel, static: np.ndarray) -> dict[str, Any]:
    """The residual fields of a model after the response q = static @ f (n, k) has become part of them."""

    def grown(rows: np.ndarray | None, before: np.ndarray | None) -> np.ndarray | None:
        if rows is None:
            return None
        return rows @ static if before is None else rows @ static + before

    flexibility = grown(model.selection, model.residual_flexibility)
    assert flexibility is not None
    return {
        "residual_flexibility": halved(flexibility),
        "residual_recovery": grown(model.recovery, model.residual_recovery),
        "output_residual": grown(model.output_rows, model.output_residual),
    }
