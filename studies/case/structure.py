"""A case with its finite elements, as every stage takes it."""

from __future__ import annotations

from dataclasses import dataclass

from vanedamp.files.store import Variable
from vanedamp.modal.elasticity import Solid
from vanedamp.modal.matrices import SystemMatrices
from vanedamp.modal.rotating import RotatingMatrices
from vanedamp.studies.case.tables import Case


@dataclass(frozen=True, eq=False)
class Structure:
    """A case with its finite elements: the solid on its mesh, and the matrices.

    rotating: matrices of a case that rotates; `matrices` holds at its speed.
    """

    case: Case
    solid: Solid
    matrices: SystemMatrices
    rotating: RotatingMatrices | None = None

    def mesh(self) -> tuple[dict[str, Variable], int]:
        """Return the nodes and cells of the displacements as variables of a record, and the VTK type of the cells."""
        cells, types, points = self.solid.vtk_mesh()
        corners = cells.reshape(len(types), -1)[:, 1:]
        variables = {
            "coordinates": Variable(points, ("node", "axis"), "m"),
            "cell": Variable(corners, ("cells", "corner")),
        }
        return variables, int(types[0])
