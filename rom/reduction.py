"""One function for every reduction: `reduce(matrices, interface, basis=...)`."""

from __future__ import annotations

from collections.abc import Sequence

from vanedamp.modal.matrices import SystemMatrices
from vanedamp.rom.bases.projection import Factorize, superlu
from vanedamp.rom.basis import basis_named
from vanedamp.rom.interface import Interface, InterfaceCoordinate
from vanedamp.rom.reduced import ReducedModel


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
    reduction = basis_named(basis)
    if not isinstance(interface, Interface):
        interface = Interface.on_patches(matrices, interface)
    return reduction.reduce(matrices, interface, modes, factorize, keep_recovery, quasi_static, characteristic)
