"""Bodies fixed in their cavities: meshed with the cluster, compared with masses added to a reduced model.

Scenes assume the second for a sticking body. It includes only the tangential motion of the floor; the meshed
body also moves radially, rotates, and stiffens the shroud that it is bonded to. The record separates both effects.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from vanedamp.files.toml_input import InputError
from vanedamp.meshes.parameters import VaneCluster
from vanedamp.modal.eigen import solve_modes
from vanedamp.modal.participation import first_bending
from vanedamp.studies.case.stages import assemble, reduction
from vanedamp.studies.case.tables import Case, InterfaceTable

SOFTENED = 1e-2
WEIGHTLESS = 1e-6
_GROUP = "damper"


@dataclass(frozen=True)
class TiedComparison:
    """First bending frequencies, Hz, of one cluster.

    mass            kg, of all bodies
    free_hz         without bodies
    added_mass_hz   without bodies, their mass added to the reduced model's cavity floors, along the tangent
    tied_hz         with meshed bodies
    soft_hz         ... of a hundredth of their modulus: their mass counts, their stiffness hardly
    weightless_hz   ... of a millionth of their density: their stiffness only
    """

    mass: float
    free_hz: float
    added_mass_hz: float
    tied_hz: float
    soft_hz: float
    weightless_hz: float

    @property
    def difference(self) -> float:
        """Relative difference of the frequency with meshed bodies from that with added masses."""
        return self.tied_hz / self.added_mass_hz - 1.0

    @property
    def stiffening(self) -> float:
        """Relative rise of the frequency due to the bodies' stiffness only."""
        return self.weightless_hz / self.free_hz - 1.0


def compare_tied(case: Case, modes: int = 12) -> TiedComparison:
    """Compare the two models of fixed bodies for a case whose generated cluster has them (`damper_width` and so on).

    modes  fixed-interface modes of the reduced model. Raises InputError for a case without such bodies.
    """
    mesh = case.mesh
    if not isinstance(mesh, VaneCluster) or not mesh.damper_volume:
        raise InputError(
            "mesh.damper_width: the comparison needs the generator vane_cluster with width, height and depth of a body"
        )
    material = case.material.get(_GROUP) or case.material.get("default")
    if material is None:
        raise InputError(f"material.{_GROUP}: missing; the bodies need a material")
    mass = material.density * mesh.damper_volume
    free = reduction(assemble(_without_bodies(case, mesh)), modes)
    loaded = free.with_masses((floor, mass / len(free.interface)) for floor in free.interface)
    soft = replace(material, young=SOFTENED * material.young)
    weightless = replace(material, density=WEIGHTLESS * material.density)
    return TiedComparison(
        mass=mass,
        free_hz=float(free.natural_frequencies_hz[0]),
        added_mass_hz=float(loaded.natural_frequencies_hz[0]),
        tied_hz=_first_bending_hz(case),
        soft_hz=_first_bending_hz(replace(case, material=dict(case.material) | {_GROUP: soft})),
        weightless_hz=_first_bending_hz(replace(case, material=dict(case.material) | {_GROUP: weightless})),
    )


def _first_bending_hz(case: Case) -> float:
    matrices = assemble(case).matrices
    modes = solve_modes(matrices, case.modes.count or 3)
    return float(modes.frequencies_hz[first_bending(modes, matrices, case.modes.direction)])


def _without_bodies(case: Case, mesh: VaneCluster) -> Case:
    """Return the case with empty cavities, its interface the tangential motion of their floors."""
    materials = {group: table for group, table in case.material.items() if group != _GROUP}
    floors = {}
    for number, angle in enumerate(mesh.cavity_angles(), start=1):
        floor = f"c{number}_floor"
        floors[floor] = InterfaceTable(floor, (0.0, math.cos(angle), -math.sin(angle)))
    bare, table = replace(mesh, damper_width=0.0, damper_height=0.0, damper_depth=0.0), replace(case.modes, at=None)
    return replace(case, mesh=bare, material=materials, interface=floors, modes=table)
