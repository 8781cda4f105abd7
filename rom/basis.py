"""The bases of reduction by name: ours and other packages'. Other code calls their methods, never compares names.

An installed package adds one, a ReductionBasis or an object with its methods, in its pyproject.toml:

    [project.entry-points."vanedamp.bases"]
    guyan = "acme.guyan:GUYAN"
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vanedamp.files.extensions import Registry
from vanedamp.modal.matrices import SystemMatrices
from vanedamp.rom.bases import craig_bampton, free_interface
from vanedamp.rom.bases.projection import Factorize, ReductionError
from vanedamp.rom.error_estimate import Rung, frf_errors
from vanedamp.rom.interface import Interface
from vanedamp.rom.reduced import ReducedModel
from vanedamp.rom.rotation import SpeedBases
from vanedamp.rom.truncation import massless, truncated


@dataclass(frozen=True)
class ReductionBasis:
    """A reduction basis: modes, and the static response of the remaining structure.

    held: whether the modes are those with the interface held; attached: blocks of attachment modes of natural modes;
    without_mass: whether the rest is a boundary without mass; more: whether further blocks follow on the attached ones;
    least: fewest modes of a structure that its supports hold; speeds: what joins the bases at several speeds of
    rotation, None if the basis holds at one speed.
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
        """Return the model with that many modes. Arguments and errors: see rom.reduction.reduce."""
        structure = matrices, interface
        if self.held:
            most = interface.motions.shape[1] - len(interface.labels) - interface.full.size
            enough = min(max(2 * modes, modes + 10), most) if self.without_mass else modes
            model = craig_bampton.reduce(*structure, enough, factorize, keep_recovery, quasi_static, characteristic)
        else:
            blocks = self.attached + (quasi_static if self.more else 0)
            model = free_interface.reduce_free(*structure, modes, factorize, keep_recovery, blocks)
        return massless(model, modes) if self.without_mass else model

    def rich(
        self, matrices: SystemMatrices, interface: Interface, modes: int, factorize: Factorize, blocks: int,
        keep_recovery: bool = False,
    ) -> ReducedModel:  # fmt: skip
        """Return the model from which `cut` takes those with up to `modes`, with that many quasi-static blocks.

        With 1 + BLOCKS, it has their error estimates as well (rom.error_estimate); Craig-Bampton models then have one.
        """
        reduce = craig_bampton.reduce if self.held else free_interface.reduce_free
        return reduce(matrices, interface, modes, factorize, keep_recovery, blocks)

    def cut(self, rich: ReducedModel, modes: int) -> ReducedModel:
        """Return the model with that many modes, from a rich one."""
        return massless(rich, modes) if self.without_mass else truncated(rich, modes, self.attached)

    def least_modes(self, rich: ReducedModel) -> int:
        """Return the fewest modes of a model from a rich one: an interface that is held leaves no rigid motions."""
        return 0 if self.held and not self.without_mass else max(rich.rigid_modes, self.least)


#: blocks of quasi-static coordinates that the error estimate of a model needs in addition to its own
BLOCKS = 2
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


def basis_ladder(
    rich: ReducedModel, basis: str, frequencies_hz: np.ndarray, labels: Sequence[str] | None = None
) -> list[Rung]:
    """Return the error of every model of a basis that can be cut from a rich one, against the latter."""
    reduction = basis_named(basis)
    models = [(modes, reduction.cut(rich, modes)) for modes in range(reduction.least_modes(rich), rich.modes + 1)]
    return [
        Rung(modes, model.size, float(frf_errors(model, rich, frequencies_hz, labels).max()), 0.0)
        for modes, model in models
    ]
