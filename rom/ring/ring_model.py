"""RingModel: a ring of equal sectors by one sector's data in the ring's waves; deviations make its ReducedModel."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any, ClassVar

import numpy as np
from scipy import linalg

from vanedamp.files.record import Array
from vanedamp.modal.algebra import added_by_speed, sector_rotations, symmetric_part
from vanedamp.rom.dense_modes import modal_damping
from vanedamp.rom.reduced import ReducedModel
from vanedamp.rom.ring.deviations import Deviations, RingError
from vanedamp.rom.ring.families import Families
from vanedamp.rom.ring.placement import SQUARE, ReducedRing
from vanedamp.rom.ring.waves import Waves


@dataclass(frozen=True, eq=False, repr=False)
class RingModel(ReducedRing):
    """A reduced ring of N equal sectors: n real waves of modal mass 1, and one sector's fields in them.

    The first `modes` waves are natural modes of the tuned ring at standstill, whole pairs, which `reduce_ring` sorts by
    frequency; the others add the static response to the interface's forces and to the forces of deviations.
    rom.ring.waves.Waves says how sectors see the waves. Raises RingError or rom.checks.ReducedModelError.
    """

    KIND: ClassVar[str] = "ring-model"
    diameters: Annotated[np.ndarray, Array(("coordinate",), dtype=np.int64)]
    """nodal diameters of the waves; pairs of waves are adjacent"""
    squares: Annotated[np.ndarray, Array(("coordinate",), "rad^2/s^2")]
    """squared angular frequencies of the tuned ring at standstill"""
    stiffness: Annotated[np.ndarray, Array(SQUARE, "N/m")]
    """stiffness of the deviating part of a sector, in sector 0's fields"""
    mass: Annotated[np.ndarray, Array(SQUARE, "kg")]
    """mass of that part"""
    centrifugal_stiffness: Annotated[np.ndarray | None, Array(SQUARE, "kg")] = None
    """of the whole ring: added stiffness per squared speed (rad/s); None: it does not rotate"""
    higher_stiffness: Annotated[np.ndarray | None, Array(("power", *SQUARE), "N/m")] = None
    """of the whole ring: as in ReducedModel"""
    greatest_speed: float = 0.0
    """speed up to which the waves hold [rad/s]"""

    def __post_init__(self) -> None:
        super().__post_init__()
        _check_waves(self)

    def _lengths(self) -> dict[str, int]:
        higher = () if self.higher_stiffness is None else self.higher_stiffness
        return {"coordinate": len(self.squares), "power": len(higher)}

    @property
    def size(self) -> int:
        """Number of waves n."""
        return len(self.squares)

    @property
    def waves(self) -> Waves:
        """The waves of the coordinates."""
        return Waves(self.sectors, self.diameters)

    @property
    def frequencies_hz(self) -> np.ndarray:
        """(modes,) natural frequencies of the tuned ring at standstill."""
        return np.sqrt(np.maximum(self.squares[: self.modes], 0.0)) / (2.0 * np.pi)

    def model(self, deviations: Deviations | None = None, speed: float | None = None) -> ReducedModel:
        """Return the reduced model of the whole ring with deviations of its sectors.

        Interface labels are "<label>@<sector>", of transverse motions and rotations "<label>@<sector>.normal" and
        ".rotation"; directions and positions are turned into place. A ring that does not rotate is given by its own
        lowest natural modes, as many as `modes`, and residual flexibility. One that rotates is given by all waves, so
        that ReducedModel.at_speed holds; with a speed, rad/s, by natural modes and residual flexibility there. The
        damping ratio holds for every mode; deviations of damping add the part's share to it. Raises RingError or
        ReducedModelError.
        """
        if speed is None and self.centrifugal_stiffness is not None:
            return self.whole(deviations)
        deviations = deviations or Deviations()
        rows = self.rows.reshape(-1, self.size)
        if deviations.any() or speed:
            mass, stiffness = self.matrices(deviations, speed or 0.0)
            squares, shapes = linalg.eigh(stiffness, mass, subset_by_index=[0, self.modes - 1])
            static = linalg.solve(stiffness, rows.T, assume_a="sym")
        else:
            squares, shapes = self.squares[: self.modes], np.eye(self.size)[:, : self.modes]
            static = (rows / self.squares).T
        added = self.added_damping(deviations)
        added = None if added is None else symmetric_part(shapes.T @ added @ shapes)
        return self.natural_model(squares, shapes, rows, static, self._base_load(deviations), added)

    def whole(self, deviations: Deviations | None = None) -> ReducedModel:
        """Return the reduced model in all n waves, without residual flexibility. Errors: as `model`."""
        deviations = deviations or Deviations()
        mass, stiffness = self.matrices(deviations)
        damping, added = modal_damping(mass, stiffness, self.damping_ratio), self.added_damping(deviations)
        if added is not None:
            damping = damping + added
        return ReducedModel(
            mass=mass, stiffness=stiffness, damping=damping, selection=self.rows.reshape(-1, self.size),
            base_load=self._base_load(deviations), damping_ratio=self.damping_ratio if added is None else None,
            centrifugal_stiffness=self.centrifugal_stiffness, higher_stiffness=self.higher_stiffness,
            greatest_speed=self.greatest_speed, **self.placed(), **self._turning(),
        )  # fmt: skip

    def matrices(self, deviations: Deviations, speed: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
        """Return mass and stiffness (n, n) of the whole ring with deviations, at a speed, rad/s. Raises RingError."""
        mass = np.eye(len(self.squares)) + self.around("mass", deviations.of("mass", self.sectors))
        stiffness = np.diag(self.squares) + self.around("stiffness", deviations.of("stiffness", self.sectors))
        if speed:
            if self.centrifugal_stiffness is None or not 0.0 < speed <= self.greatest_speed * (1.0 + 1e-12):
                raise RingError(f"speed: the ring holds up to {self.greatest_speed:.6g} rad/s, not at {speed:.6g}")
            higher = () if self.higher_stiffness is None else self.higher_stiffness
            added = added_by_speed(speed, self.greatest_speed, (self.centrifugal_stiffness, *higher))
            stiffness = symmetric_part(stiffness + added)
        return mass, stiffness

    def tuned_families(self, speed: float = 0.0) -> Families:
        """Return the natural modes of the tuned ring at a speed, rad/s, diameter by diameter. Raises RingError."""
        mass, stiffness = self.matrices(Deviations(), speed)
        numbers, squares, momenta, diameters = [], [], [], []
        for diameter in np.unique(self.diameters):
            members = np.flatnonzero(self.diameters == diameter)
            count = int(np.count_nonzero(members < self.modes))
            eigenvalues, shapes = linalg.eigh(
                stiffness[np.ix_(members, members)], mass[np.ix_(members, members)], subset_by_index=[0, count - 1]
            )
            paired = 0 < 2 * diameter < self.sectors
            numbers.append(np.arange(count) // (2 if paired else 1))
            squares.append(eigenvalues)
            momenta.append((mass[:, members] @ shapes).T)
            diameters.append(np.full(count, diameter))
        return Families(
            np.concatenate(numbers), np.concatenate(diameters), np.concatenate(squares), np.concatenate(momenta)
        )

    def added_damping(self, deviations: Deviations) -> np.ndarray | None:
        """Return the damping (n, n) that deviations add to the damping ratio's; None without such deviations.

        For a part as stiff as the sector, their sum over sectors is added to the modal damping of the waves.
        """
        damping = deviations.of("damping", self.sectors)
        if not damping.any():
            return None
        strained = np.where(self.squares > 0.0, self.squares, np.inf)
        share = np.sqrt(2.0 * self.damping_ratio) * strained**-0.25
        return share[:, None] * self.around("stiffness", damping) * share

    def around(self, name: str, weights: np.ndarray) -> np.ndarray:
        """Return the sum (n, n) over sectors, by weights (N,), of "stiffness" or "mass"."""
        if not np.any(weights):
            return np.zeros_like(self.stiffness)
        return self.waves.summed(self._travelling[name], weights)

    @cached_property
    def rows(self) -> np.ndarray:
        """(N, k, n) interface displacements of every sector."""
        return self.waves.in_sectors(self.selection)

    @cached_property
    def _travelling(self) -> dict[str, np.ndarray]:
        return {name: self.waves.travelling(getattr(self, name)) for name in ("stiffness", "mass")}

    def _base_load(self, deviations: Deviations) -> np.ndarray:
        """Return the load (n, 3) of the whole ring by an acceleration of the base along x, y, z."""
        lighter = deviations.of("mass", self.sectors)[:, None, None]
        loads = self.waves.in_sectors(self.base_load.T) + lighter * self.waves.in_sectors(self.part_load.T)
        return np.asarray(np.einsum("sai,sba->ib", loads, sector_rotations(self.axis, self.sectors)))

    def _turning(self) -> dict[str, Any]:
        """Return the axis of rotation as fields of a ReducedModel; none of a ring that does not rotate."""
        if self.centrifugal_stiffness is None:
            return {}
        return {"rotation_axis": self.axis, "rotation_point": self.point}


def _check_waves(ring: RingModel) -> None:
    """Raise RingError unless the waves of a ring are whole pairs."""
    if ring.sectors < 1 or np.any(2 * ring.diameters > ring.sectors) or np.any(ring.diameters < 0):
        raise RingError(f"diameters: expected 0 to {ring.sectors // 2}, half of the {ring.sectors} sectors")
    paired = np.flatnonzero((ring.diameters > 0) & (2 * ring.diameters < ring.sectors))
    first, second = paired[::2], paired[1::2]
    if len(paired) % 2 or np.any(second != first + 1) or np.any(ring.diameters[first] != ring.diameters[second]):
        raise RingError("diameters: waves between 0 and N/2 diameters must stand in adjacent pairs")
    if not 0 < ring.modes <= len(ring.squares) or ring.modes - 1 in first:
        raise RingError(f"modes: expected 1 to {len(ring.squares)} waves, whole pairs, not {ring.modes}")
