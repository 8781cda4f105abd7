"""A case with its finite elements, the input of every stage."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from vanedamp.files.store import Variable
from vanedamp.modal.elasticity import Solid
from vanedamp.modal.matrices import SystemMatrices
from vanedamp.modal.rotating import RotatingMatrices
from vanedamp.studies.case.tables import Case


@dataclass(frozen=True, eq=False)
class Structure:
    """A case with its finite elements: the solid on its mesh, and the matrices.

    turning: matrices of a case that rotates, up to its speed, at which `matrices` holds.
    """

    case: Case
    solid: Solid
    matrices: SystemMatrices
    turning: RotatingMatrices | None = None

    @cached_property
    def rotating(self) -> RotatingMatrices | None:
        """Matrices of a rotating case, up to its highest speed. Raises the errors of `rotating_to`."""
        rotation, diagram = self.case.rotation, self.case.campbell
        if rotation is None or self.turning is None:
            return None
        highest = rotation.greatest if diagram is None else max(rotation.greatest, float(diagram.speeds[-1]))
        return self.rotating_to(highest)

    def rotating_to(self, speed: float) -> RotatingMatrices:
        """Return the matrices of a rotating case for speeds up to the given one (rad/s).

        Raises modal.rotating.UnstableError for a speed without a stable equilibrium.
        """
        rotating = self.turning
        assert rotating is not None
        if speed == rotating.greatest:
            return rotating
        return self.solid.rotating(
            rotating.standing, rotating.axis.tolist(), rotating.point.tolist(), rotating.statics, speed
        )

    def mesh(self) -> tuple[dict[str, Variable], int]:
        """Return the nodes and cells of the displacements as variables of a record, and the VTK type of the cells."""
        cells, types, points = self.solid.vtk_mesh()
        corners = cells.reshape(len(types), -1)[:, 1:]
        variables = {
            "coordinates": Variable(points, ("node", "axis"), "m"),
            "cell": Variable(corners, ("cells", "corner")),
        }
        return variables, int(types[0])
