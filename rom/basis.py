"""The bases of reduction by name: ours, and those that other packages add; other code asks them, never for a name.

An installed package adds one, a ReductionBasis or an object that answers like one, in its pyproject.toml:

    [project.entry-points."vanedamp.bases"]
    guyan = "acme.guyan:GUYAN"
"""

from __future__ import annotations

from dataclasses import dataclass

from vanedamp.files.extensions import Registry
from vanedamp.modal.matrices import SystemMatrices
from vanedamp.rom.bases import craig_bampton, free_interface
from vanedamp.rom.bases.projection import Factorize, ReductionError
from vanedamp.rom.interface import Interface
from vanedamp.rom.reduced import ReducedModel
from vanedamp.rom.rotation import SpeedBases
from vanedamp.rom.truncation import massless, truncated


@dataclass(frozen=True)
class ReductionBasis:
    """What a basis keeps: modes, and how the rest of the structure follows statically.

    held: whether the modes are those with the interface held; attached: blocks of attachment modes of natural modes;
    without_mass: whether the rest is a boundary without mass; more: whether further blocks follow on the attached ones;
    least: fewest modes of a structure that its supports hold; speeds: what joins the bases at several speeds of
    rotation, None where the basis is that of one speed.
    """

    held: bool = False
    attached: int = 1
    without_mass: bool = False
    more: bool = False
    least: int = 1
    speeds: type[SpeedBases] | None = None

    def reduce(
        self, matrices: SystemMatrices, interface: Interface, modes: int, factorize: Factorize,
        keep_recovery: bool = False, quasi_static: int = 0, characteristic: int = 6,
    ) -> ReducedModel:  # fmt: skip
        """Return the model with that many modes. Arguments and errors: those of rom.reduction.reduce."""
        given = matrices, interface
        if self.held:
            most = interface.motions.shape[1] - len(interface.labels) - interface.full.size
            kept = min(max(2 * modes, modes + 10), most) if self.without_mass else modes
            model = craig_bampton.reduce(*given, kept, factorize, keep_recovery, quasi_static, characteristic)
        else:
            blocks = self.attached + (quasi_static if self.more else 0)
            model = free_interface.reduce_free(*given, modes, factorize, keep_recovery, blocks)
        return massless(model, modes) if self.without_mass else model

    def rich(
        self, matrices: SystemMatrices, interface: Interface, modes: int, factorize: Factorize, blocks: int,
        keep_recovery: bool = False,
    ) -> ReducedModel:  # fmt: skip
        """Return the model that `cut` takes those up to `modes` of, with that many blocks of quasi-static modes."""
        reduce = craig_bampton.reduce if self.held else free_interface.reduce_free
        return reduce(matrices, interface, modes, factorize, keep_recovery, blocks)

    def cut(self, rich: ReducedModel, modes: int) -> ReducedModel:
        """Return the model with that many modes, from a rich one."""
        return massless(rich, modes) if self.without_mass else truncated(rich, modes, self.attached)

    def least_modes(self, rich: ReducedModel) -> int:
        """Return the fewest modes of a model from a rich one: an interface that is held leaves no rigid motions."""
        return 0 if self.held and not self.without_mass else max(rich.rigid_modes, self.least)


#: the values of `basis` (rom.reduction.reduce says what they are)
BASES = Registry(
    "basis",
    {
        "craig-bampton": ReductionBasis(held=True, speeds=SpeedBases),
        "rubin": ReductionBasis(more=True, least=0),
        "macneal": ReductionBasis(without_mass=True),
        "truncated": ReductionBasis(attached=0),
        "massless": ReductionBasis(held=True, without_mass=True),
    },
    "vanedamp.bases",
    ("reduce", "rich", "cut", "least_modes", "speeds"),
)
#: adds a basis, by its name
register = BASES.register


def basis_named(name: str) -> ReductionBasis:
    """Return a basis. Raises ReductionError for an unknown name."""
    if name not in BASES:
        raise ReductionError(f"basis: expected one of {', '.join(BASES.names())}, not {name!r}")
    basis: ReductionBasis = BASES.part(name)
    return basis
