"""The bases of reduction by name: ours, and those that other packages add; other code asks them, never for a name.

An installed package adds one, a class derived from ReductionBasis, in its pyproject.toml:

    [project.entry-points."vanedamp.bases"]
    guyan = "acme.guyan:Guyan"
"""

from __future__ import annotations

from typing import ClassVar, NamedTuple

from vanedamp.files.extensions import Registry
from vanedamp.modal.matrices import SystemMatrices
from vanedamp.rom.bases import craig_bampton, free_interface
from vanedamp.rom.bases.projection import Factorize, ReductionError, superlu
from vanedamp.rom.interface import Interface
from vanedamp.rom.reduced import ReducedModel
from vanedamp.rom.rotation import SpeedBases
from vanedamp.rom.truncation import massless, truncated


class Structure(NamedTuple):
    """What is reduced; the fields are arguments of rom.reduction.reduce."""

    matrices: SystemMatrices
    interface: Interface
    factorize: Factorize = superlu
    keep_recovery: bool = False
    characteristic: int = 6

    def fixed_interface(self, modes: int, blocks: int) -> ReducedModel:
        """Return constraint modes, blocks of quasi-static modes, and fixed-interface modes."""
        return craig_bampton.reduce(
            self.matrices, self.interface, modes, self.factorize, self.keep_recovery, blocks, self.characteristic
        )  # fmt: skip

    def free_interface(self, modes: int, blocks: int) -> ReducedModel:
        """Return blocks of residual attachment modes, and natural modes."""
        return free_interface.reduce_free(
            self.matrices, self.interface, modes, self.factorize, self.keep_recovery, blocks
        )  # fmt: skip


class ReductionBasis:
    """Base of the bases: it keeps natural modes, and answers how it describes the rest of the structure."""

    #: what joins its bases at several speeds of rotation; None: it is that of one speed
    speeds: ClassVar[type[SpeedBases] | None] = None
    #: fewest modes that it keeps of a structure whose supports hold it
    least: ClassVar[int] = 1

    def reduce(self, structure: Structure, modes: int, quasi_static: int = 0) -> ReducedModel:
        """Return the model with that many modes; quasi_static: further blocks of quasi-static coordinates."""
        raise NotImplementedError(f"{type(self).__qualname__} does not reduce")

    def rich(self, structure: Structure, modes: int, blocks: int) -> ReducedModel:
        """Return the model that `cut` takes those up to `modes` of, with that many blocks of quasi-static modes."""
        return structure.free_interface(modes, blocks)

    def cut(self, rich: ReducedModel, modes: int) -> ReducedModel:
        """Return the model with that many modes, from a rich one."""
        return truncated(rich, modes, 1)

    def least_modes(self, rich: ReducedModel) -> int:
        """Return the fewest modes of a model from a rich one, the rigid motions that the supports leave included."""
        return max(rich.rigid_modes, self.least)


class CraigBampton(ReductionBasis):
    """Constraint modes and fixed-interface modes: whatever the supports leave, the interface holds."""

    speeds = SpeedBases

    def reduce(self, structure: Structure, modes: int, quasi_static: int = 0) -> ReducedModel:
        """Return that model."""
        return structure.fixed_interface(modes, quasi_static)

    def rich(self, structure: Structure, modes: int, blocks: int) -> ReducedModel:
        """Return one with more blocks; models that are cut from it have one."""
        return structure.fixed_interface(modes, blocks)

    def least_modes(self, rich: ReducedModel) -> int:
        """Return zero."""
        return 0


class Rubin(ReductionBasis):
    """Natural modes and residual attachment modes with their mass."""

    least = 0

    def reduce(self, structure: Structure, modes: int, quasi_static: int = 0) -> ReducedModel:
        """Return that model."""
        return structure.free_interface(modes, 1 + quasi_static)


class MacNeal(ReductionBasis):
    """The same without that mass: a boundary without mass."""

    def reduce(self, structure: Structure, modes: int, quasi_static: int = 0) -> ReducedModel:
        """Return that model."""
        return massless(structure.free_interface(modes, 1), modes)

    def cut(self, rich: ReducedModel, modes: int) -> ReducedModel:
        """Return its own lowest natural modes, and the rest of its flexibility."""
        return massless(rich, modes)


class Massless(MacNeal):
    """The same, made of a Craig-Bampton model's own modes, of which it takes about half."""

    def rich(self, structure: Structure, modes: int, blocks: int) -> ReducedModel:
        """Return a Craig-Bampton model with more modes and blocks."""
        return structure.fixed_interface(modes, blocks)

    def reduce(self, structure: Structure, modes: int, quasi_static: int = 0) -> ReducedModel:
        """Return that model."""
        interface = structure.interface
        most = interface.motions.shape[1] - len(interface.labels) - interface.full.size
        return massless(structure.fixed_interface(min(max(2 * modes, modes + 10), most), quasi_static), modes)


class Truncated(ReductionBasis):
    """Natural modes only."""

    def reduce(self, structure: Structure, modes: int, quasi_static: int = 0) -> ReducedModel:
        """Return that model."""
        return structure.free_interface(modes, 0)

    def cut(self, rich: ReducedModel, modes: int) -> ReducedModel:
        """Return the first modes of a rich model."""
        return truncated(rich, modes, 0)


#: the values of `basis`
BASES = Registry(
    "basis",
    {
        "craig-bampton": CraigBampton, "rubin": Rubin, "macneal": MacNeal, "truncated": Truncated,
        "massless": Massless,
    },
    "vanedamp.bases",
    ("reduce", "rich", "cut", "speeds"),
)  # fmt: skip
#: adds a basis, by its name and class
register = BASES.register


def basis_named(name: str) -> ReductionBasis:
    """Return a basis. Raises ReductionError for an unknown name."""
    if name not in BASES:
        raise ReductionError(f"basis: expected one of {', '.join(BASES.names())}, not {name!r}")
    basis: ReductionBasis = BASES.part(name)()
    return basis
