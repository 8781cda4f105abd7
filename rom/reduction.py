"""One function for every reduction: `reduce(matrices, interface, basis=...)`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, get_args

from vanedamp.modal.matrices import SystemMatrices
from vanedamp.rom.bases import craig_bampton, free_interface
from vanedamp.rom.bases.projection import Factorize, ReductionError, superlu
from vanedamp.rom.interface import Interface, InterfaceCoordinate
from vanedamp.rom.reduced import ReducedModel
from vanedamp.rom.truncation import massless

Basis = Literal["craig-bampton", "rubin", "macneal", "truncated", "massless"]
BASES: tuple[str, ...] = get_args(Basis)


def reduce(
    matrices: SystemMatrices,
    interface: Interface | Sequence[InterfaceCoordinate],
    basis: str = "craig-bampton",
    modes: int = 12,
    factorize: Factorize = superlu,
    keep_recovery: bool = False,
    quasi_static: int = 0,
    characteristic: int = 6,
) -> ReducedModel:
    """Return the reduced model of a structure at its interface, or at a list of interface coordinates.

    basis  "craig-bampton"  constraint modes and fixed-interface modes (Craig and Bampton 1968)
           "rubin"          natural modes and residual attachment modes with their mass (Rubin 1975)
           "macneal"        the same without that mass, MacNeal (1971): a boundary without mass, whose flexibility is
                            ReducedModel.residual_flexibility
           "massless"       as "macneal", made of a Craig-Bampton model's own modes: after Monjaraz-Tec, Gross and Krack
                            (2022), for models that exist in Craig-Bampton form already
           "truncated"      natural modes only, no static part of the interface: the baseline

    modes           natural or fixed-interface modes kept
    quasi_static    further blocks of quasi-static coordinates, of the bases "craig-bampton" and "rubin"
    characteristic  characteristic constraint modes kept of patches of kind "full", of "craig-bampton" and "massless"

    Raises ReductionError for an unknown basis, and as bases.craig_bampton.reduce and bases.free_interface.reduce_free
    do.
    """
    check_basis(basis)
    if not isinstance(interface, Interface):
        interface = Interface.on_patches(matrices, interface)
    if basis in ("craig-bampton", "massless"):
        fixed = max(2 * modes, modes + 10) if basis == "massless" else modes
        most = interface.motions.shape[1] - len(interface.labels) - interface.full.size
        model = craig_bampton.reduce(
            matrices, interface, min(fixed, most) if basis == "massless" else modes, factorize, keep_recovery,
            quasi_static, characteristic,
        )  # fmt: skip
        return massless(model, modes) if basis == "massless" else model
    blocks = {"rubin": 1 + quasi_static, "macneal": 1, "truncated": 0}[basis]
    model = free_interface.reduce_free(matrices, interface, modes, factorize, keep_recovery, blocks)
    return massless(model, modes) if basis == "macneal" else model


def check_basis(basis: str) -> None:
    """Raise ReductionError for an unknown basis."""
    if basis not in BASES:
        raise ReductionError(f"basis: expected one of {', '.join(BASES)}, not {basis!r}")
