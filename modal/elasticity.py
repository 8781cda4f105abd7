"""Linear elasticity on a mesh: stiffness and mass with supports and patches, and stresses of a displacement field."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy import sparse

from vanedamp.files.errors import VanedampError
from vanedamp.modal import fenicsx
from vanedamp.modal.algebra import cross_matrix, von_mises
from vanedamp.modal.eigen import SolverError
from vanedamp.modal.equilibrium import Deformation, Equilibria
from vanedamp.modal.fenicsx import ufl
from vanedamp.modal.matrices import Patch, SystemMatrices, unit_direction
from vanedamp.modal.rotating import RotatingMatrices, UnstableError, nodal_product, unstable_at
from vanedamp.modal.statics import Statics
from vanedamp.modal.stress_recovery import StressRecovery
from vanedamp.modal.temperature import Temperature, TemperatureError

DEFAULT = "default"
_COMPONENTS = "xyz"
# equilibria at speeds by which one that is hard to find is sought
_MOST_TRIES = 60
_NO_CENTRIFUGAL_SOLUTION = (
    "rotation: the structure is not held against every rigid motion, so that the centrifugal load has no static "
    "solution; clamp a group in [support], or give it springs"
)
_NO_THERMAL_SOLUTION = (
    "temperature: the structure is not held against every rigid motion, so that its thermal stress has no static "
    "solution; hold it in [support] as it can expand, or leave out expansion"
)


class ElasticityError(VanedampError):
    """A material, support or displacement field that does not fit; the message names it and the remedy."""


@dataclass(frozen=True)
class Material:
    """Isotropic linear elasticity: young (Pa), poisson (1), density (kg/m^3).

    expansion  1/K, thermal
    young_at   ((temperature, Pa), ...) in ascending order: the modulus, linear between these; empty: young throughout
    """

    young: float
    poisson: float
    density: float
    expansion: float = 0.0
    young_at: tuple[tuple[float, float], ...] = ()

    def __post_init__(self) -> None:
        for item in fields(self):
            if not np.all(np.isfinite(getattr(self, item.name))):
                raise ElasticityError(f"{item.name}: expected a finite number, not {getattr(self, item.name)}")
        if self.young <= 0.0:
            raise ElasticityError(f"young: expected a positive modulus in Pa, not {self.young}")
        if not -1.0 < self.poisson < 0.5:
            raise ElasticityError(f"poisson: expected -1 < ratio < 0.5, not {self.poisson}")
        if self.density <= 0.0:
            raise ElasticityError(f"density: expected a positive density in kg/m^3, not {self.density}")
        temperatures = [temperature for temperature, _ in self.young_at]
        if any(young <= 0.0 for _, young in self.young_at) or np.any(np.diff(temperatures) <= 0.0):
            raise ElasticityError("young_at: expected [temperature, modulus in Pa] with ascending temperatures")

    @property
    def lame(self) -> tuple[float, float]:
        """Lame's first parameter and the shear modulus, Pa."""
        shear = 0.5 * self.young / (1.0 + self.poisson)
        return 2.0 * shear * self.poisson / (1.0 - 2.0 * self.poisson), shear

    def to_json(self) -> dict[str, Any]:
        """Return it as plain data."""
        return asdict(self) | {"young_at": [list(entry) for entry in self.young_at]}

    def softening(self, temperatures: np.ndarray) -> np.ndarray:
        """Return the moduli (n,) at temperatures over `young`. Raises TemperatureError outside `young_at`."""
        if not self.young_at:
            return np.ones_like(temperatures)
        points, moduli = np.array(self.young_at).T
        low, high = temperatures.min(), temperatures.max()
        if low < points[0] or high > points[-1]:
            raise TemperatureError(
                f"young_at: reaches from {points[0]:g} to {points[-1]:g}, the temperatures from {low:g} to {high:g}; "
                "give the modulus at those, too"
            )
        return np.asarray(np.interp(temperatures, points, moduli)) / self.young


@dataclass(frozen=True)
class ElasticSupport:
    """Springs to the ground, spread over a facet group (a Winkler foundation), N/m^3: force per area and displacement.

    stiffness           along the axes x, y, z
    normal, tangential  across the facets, and along them in every direction; added to the ones along the axes

    Raises ElasticityError unless they are finite, not negative and not all zero.
    """

    stiffness: tuple[float, float, float] = (0.0, 0.0, 0.0)
    normal: float = 0.0
    tangential: float = 0.0

    def __post_init__(self) -> None:
        values = (*self.stiffness, self.normal, self.tangential)
        if len(values) != 5 or not all(math.isfinite(value) and value >= 0.0 for value in values) or not any(values):
            raise ElasticityError(
                f"stiffness: expected stiffnesses in N/m^3 along x, y, z, not negative and not all zero; not {self}"
            )


class Solid:
    """An elastic body on a mesh: its forms, and stresses and pictures that need the mesh after assembly.

    materials    volume group -> Material; the key "default" serves every group that is not named
    degree       of the displacements, 1 to 3; 2 is right for bending
    elastic      facet group -> ElasticSupport
    scale        metres per unit of length of the file
    temperature  of the structure: it changes the moduli, and what cannot expand is under stress
    source       the user's file of which the mesh is a copy, and files that it includes, for results and errors

    Elements may be curved (of geometric order 2). Raises modal.msh.MeshError for the mesh, TemperatureError for the
    temperature and ElasticityError for the rest.
    """

    def __init__(
        self,
        mesh: str | os.PathLike[str],
        materials: Mapping[str, Material],
        degree: int = 2,
        elastic: Mapping[str, ElasticSupport] | None = None,
        scale: float = 1.0,
        temperature: Temperature | None = None,
        source: Sequence[str] = (),
    ) -> None:
        if not (math.isfinite(scale) and scale > 0.0):
            raise ElasticityError(f"scale: expected a positive number of metres a unit of length, not {scale}")
        if degree not in (1, 2, 3):
            raise ElasticityError(f"degree: expected 1, 2 or 3, not {degree}")
        self.domain = fenicsx.read(mesh, scale, source)
        self.scale = scale
        self.degree = degree
        self.materials = _by_group(materials, self.domain)
        self.elastic = dict(elastic or {})
        self.space = fenicsx.vector_space(self.domain.mesh, degree)
        self._trial, self._test = ufl.TrialFunction(self.space), ufl.TestFunction(self.space)
        self.temperature = temperature
        self._static_stresses: dict[str, Any] = {}
        self._density = fenicsx.cell_constants(self.domain, {name: m.density for name, m in self.materials.items()})
        self._lame = fenicsx.cell_constants(self.domain, {name: m.lame[0] for name, m in self.materials.items()})
        self._shear = fenicsx.cell_constants(self.domain, {name: m.lame[1] for name, m in self.materials.items()})
        growth = None
        if temperature is not None:
            stretch = self._field(lambda material, values: 1.0 + material.expansion * (values - temperature.reference))
            # moduli refer to the expanded body: E d/dx and the volume leave one of three factors of the stretch
            softening = self._field(lambda material, values: material.softening(values)) / stretch
            self._lame, self._shear = softening * self._lame, softening * self._shear
            if any(material.expansion for material in self.materials.values()):
                growth = 0.5 * (stretch**2 - 1.0)
        self._deformation = Deformation(self.space, self._hooke, growth, degree)
        self._expanded = np.zeros(3 * len(fenicsx.node_coordinates(self.space)))

    def stress(self, displacement: Any) -> Any:
        """Return the UFL stress tensor of a UFL displacement, Pa."""
        return self._hooke(ufl.sym(ufl.grad(displacement)))

    def _hooke(self, strain: Any) -> Any:
        return self._lame * ufl.tr(strain) * ufl.Identity(3) + 2.0 * self._shear * strain

    def assemble(
        self, clamped: Mapping[str, str], damping_ratio: float, statics: Statics | None = None
    ) -> SystemMatrices:
        """Return unconstrained matrices, with every group as a patch, and the supports {group: "xyz" or components}.

        Groups are of facets, or of edges and points, whose nodes have the weight one; one of both can be held, but is
        no patch. Elastic supports are part of the stiffness, which is that about the equilibrium of a temperature: with
        the stress that it leaves between the supports, and the growth, from static solutions of `statics` (default: the
        body's own).
        Raises UnstableError for a temperature at which the structure has buckled.
        """
        # facets weigh their nodes by area, edges and points by one: both in one group have no common weights
        mixed = self.domain.facets.keys() & (self.domain.edges.keys() | self.domain.points.keys())
        patches = {name: self._patch(name) for name in self.domain.groups if name not in mixed}
        stiffness = self._material_stiffness(ufl.dx)
        for name in self.elastic:
            stiffness = stiffness + self._support_stiffness(name)
        unheated = SystemMatrices(
            stiffness=stiffness,
            mass=fenicsx.matrix(self._density * ufl.inner(self._trial, self._test) * ufl.dx),
            coordinates=fenicsx.node_coordinates(self.space),
            fixed=self._fixed(clamped),
            patches=patches,
            damping_ratio=damping_ratio,
            provenance={
                "mesh": os.path.basename(self.domain.path),
                "mesh_sha256": self.domain.sha256,
                "scale": self.scale,
                "degree": self.degree,
                "materials": {name: material.to_json() for name, material in self.materials.items()},
                "clamped": dict(clamped),
                "elastic": {name: asdict(support) for name, support in self.elastic.items()},
                "versions": fenicsx.versions(),
            }
            | ({} if self.temperature is None else {"temperature": self.temperature.to_json()}),
            vertices=fenicsx.vertex_weights(self.space) if self.degree > 1 else None,
        )
        return self._heated(unheated, statics or Statics())

    def rotating(
        self,
        matrices: SystemMatrices,
        axis: Sequence[float],
        point: Sequence[float],
        statics: Statics | None = None,
        speed: float = 0.0,
    ) -> RotatingMatrices:
        """Return the matrices of the structure rotating about an axis through a point (m), from those at standstill.

        They hold up to `speed` (rad/s). The stiffness is that about the centrifugal equilibrium, which `statics`
        (default: the body's own) finds, at that speed and at its half in the square, and a polynomial through these.
        Supports turn with the structure. Raises ElasticityError for a structure that is free to move, MatricesError for
        an axis of length zero, UnstableError for a speed without a stable equilibrium.
        """
        direction, origin, statics = unit_direction(axis), np.array(point, dtype=float), statics or Statics()
        softening = nodal_product(matrices.mass, np.eye(3) - np.outer(direction, direction))
        load = softening @ (matrices.coordinates - origin).ravel()
        still = RotatingMatrices(
            standing=matrices,
            centrifugal_stiffness=sparse.csr_array(matrices.mass.shape),
            gyroscopic=nodal_product(matrices.mass, 2.0 * cross_matrix(direction)),
            load=load,
            axis=direction,
            point=origin,
            statics=statics,
            greatest=speed,
        )
        standstill = self._expanded
        before = self._deformation.tangent(standstill)
        with self._equilibria(statics, matrices, matrices.stiffness - before, _NO_CENTRIFUGAL_SOLUTION) as equilibria:
            self._static_stresses["rotation"] = self.stress(fenicsx.field(self.space, equilibria.solve(load)))
            if not speed:
                return still
            quarter, half, whole = self._followed(equilibria, still, softening, before)
        linear, *higher = self._deformation.over((standstill, half, whole))
        rotating = replace(
            still,
            centrifugal_stiffness=sparse.csr_array(linear / speed**2 - softening),
            higher=tuple(higher),
        )
        exact = self._deformation.tangent(quarter) - before - 0.25 * speed**2 * softening
        return replace(rotating, neglected=sparse.csr_array(exact - rotating.added(0.5 * speed)))

    def stiffness_parts(self) -> dict[str, sparse.csr_array]:
        """Return the parts of the stiffness, (N, N) N/m each: "material.<volume group>" and "support.<facet group>".

        Each is proportional to its Young's modulus or to its support's stiffnesses: the derivatives of model updating.
        Thermal stress is not among them.
        """
        parts = {
            f"material.{name}": self._material_stiffness(fenicsx.over(self.domain, 3, cells))
            for name, cells in self.domain.volumes.items()
        }
        return parts | {f"support.{name}": self._support_stiffness(name) for name in self.elastic}

    def part(self, groups: Sequence[str]) -> tuple[sparse.csr_array, sparse.csr_array]:
        """Return stiffness and mass (N, N) of some volume groups. Thermal stress is not among them."""
        measures = [fenicsx.over(self.domain, 3, self.domain.volumes[name]) for name in groups]
        inertia = self._density * ufl.inner(self._trial, self._test)
        stiffness = sum(self._material_stiffness(measure) for measure in measures)
        return sparse.csr_array(stiffness), sparse.csr_array(sum(fenicsx.matrix(inertia * dx) for dx in measures))

    @cached_property
    def recovery(self) -> StressRecovery:
        """The places where stresses are given, and how they are recovered."""
        return StressRecovery(self.domain, self.degree)

    def von_mises(self, displacement: np.ndarray) -> np.ndarray:
        """Return von Mises stresses (k,), Pa, of displacements (N,) at the places of `recovery`."""
        return von_mises(self.stress_components(displacement))

    def stress_components(self, displacements: np.ndarray, points: np.ndarray | None = None) -> np.ndarray:
        """Return stresses xx, yy, zz, xy, yz, zx (6, k), Pa, of displacements (N,) at the places of `recovery`.

        Of several displacements (m, N) the stresses (m, 6, k). points: indices of the places wanted; default: all. They
        are linear in the displacements.
        """
        self._check_size(displacements, 2)
        fields = np.atleast_2d(displacements)
        moved = fenicsx.field(self.space, fields[0])
        components, stresses = self.recovery.mean(self.recovery.of_cells(self.stress(moved)), points), []
        for displacement in fields:
            moved.x.array[:] = displacement
            stresses.append(components())
        return np.array(stresses[0] if np.ndim(displacements) == 1 else stresses)

    def stress_errors(self, displacement: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Return an estimate (k,), Pa, of the error of von Mises stresses of displacements (N,) at places (indices)."""
        self._check_size(displacement)
        moved = fenicsx.field(self.space, displacement)
        return self.recovery.errors(self.recovery.of_cells(self.stress(moved)), points)

    def static_stresses(self, points: np.ndarray | None = None) -> dict[str, np.ndarray]:
        """Return stresses (6, k), as stress_components, of the static solutions that have given geometric stiffness.

        By cause: "temperature" in Pa, of `assemble`, and "rotation" in Pa per squared speed (rad/s), of `rotating`.
        """
        return {
            name: self.recovery.mean(self.recovery.of_cells(stress), points)()
            for name, stress in self._static_stresses.items()
        }

    def static_errors(self, points: np.ndarray) -> dict[str, np.ndarray]:
        """Return estimates (k,) of the errors of the von Mises stress of `static_stresses`, by cause."""
        return {
            name: self.recovery.errors(self.recovery.of_cells(stress), points)
            for name, stress in self._static_stresses.items()
        }

    def stress_points(self) -> np.ndarray:
        """Return the places (k, 3), m, of the values of `von_mises`."""
        return self.recovery.places

    def vtk_mesh(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return cells, VTK cell types and points in the order of the nodes, for pyvista.UnstructuredGrid."""
        return fenicsx.vtk_mesh(self.space)

    def write(self, fields: Mapping[str, np.ndarray], path: str | os.PathLike[str]) -> None:
        """Write named displacement fields (N,) for ParaView, as XDMF at the nodes of the mesh."""
        if os.path.splitext(path)[1] != ".xdmf":
            raise ElasticityError(f"path: expected a file name ending in .xdmf, not {path}")
        fenicsx.write_fields(self.space, fields, path)

    def _field(self, of: Callable[[Material, np.ndarray], np.ndarray]) -> Any:
        """Return a function of material and temperature on the mesh, linear in every cell."""
        assert self.temperature is not None
        at = self.temperature.at
        return fenicsx.cell_functions(self.domain, lambda name, points: of(self.materials[name], at(points)))

    def _heated(self, matrices: SystemMatrices, statics: Statics) -> SystemMatrices:
        """Return the matrices about the thermal equilibrium."""
        if self.temperature is None or not any(material.expansion for material in self.materials.values()):
            return matrices
        cold = self._deformation.deformed(self._expanded)
        springs = sparse.csr_array(matrices.stiffness - cold)
        with self._equilibria(statics, matrices, springs, _NO_THERMAL_SOLUTION) as equilibria:
            start = equilibria.solve(-self._deformation.force(self._expanded))
            equilibrium = equilibria.under(np.zeros(matrices.size), start)
        self._expanded = start if equilibrium is None else equilibrium
        self._static_stresses["temperature"] = self._deformation.stress(fenicsx.field(self.space, self._expanded))
        added = sparse.csr_array(self._deformation.tangent(self._expanded) - cold)
        share = statics.stable_share(matrices, added)
        if share < 1.0 or equilibrium is None:
            raise UnstableError(
                f"temperature: the structure buckles at {share:.3g} of its thermal stress; give it less, or supports "
                "that let it expand"
            )
        return replace(matrices, stiffness=sparse.csr_array(matrices.stiffness + added))

    def _equilibria(
        self, statics: Statics, matrices: SystemMatrices, springs: sparse.csr_array, without: str
    ) -> Equilibria:
        """Return the equilibria of the solid on its springs; without: the error where nothing holds it."""
        try:
            return Equilibria(self._deformation, statics, matrices, springs)
        except SolverError:
            raise ElasticityError(without) from None

    def _followed(
        self, equilibria: Equilibria, still: RotatingMatrices, softening: sparse.csr_array, before: sparse.csr_array
    ) -> list[np.ndarray]:
        """Return the displacements (N,) at 1/4, 1/2 and 1 times the maximum squared speed.

        Newton's method first goes there directly. If it fails, or ends at an unstable equilibrium, stable ones are
        followed in small steps, since others may exist beyond an instability; but only if the stress by itself leaves
        the structure stable. Raises UnstableError.
        """
        top, load, standing, standstill = still.greatest**2, still.load, still.standing, self._expanded
        slope = equilibria.solve(load)
        nodes = [0.25 * top, 0.5 * top, top]

        def stable(shape: np.ndarray, square: float) -> bool:
            tangent = standing.stiffness + self._deformation.tangent(shape) - before - square * softening
            return still.statics.stable(replace(standing, stiffness=sparse.csr_array(tangent)))

        shapes, low, here = [], 0.0, standstill
        for node in nodes:
            shape = equilibria.under(node * load, here + (node - low) * slope, node * softening)
            if shape is None:
                break
            shapes.append(shape)
            slope = (shape - here) / (node - low)
            low, here = node, shape
        else:
            if stable(here, top):
                return shapes
        slope = equilibria.solve(load)
        ahead, behind = (self._deformation.geometric(standstill + side * top * slope) for side in (1.0, -1.0))
        share = still.statics.stable_share(standing, sparse.csr_array(0.5 * (ahead - behind) - top * softening))
        if share < 1.0:
            raise unstable_at(still.greatest, math.sqrt(share * top))
        shapes, low, here, step = [], 0.0, standstill, 0.125 * top
        for _ in range(_MOST_TRIES):
            node = nodes[len(shapes)]
            to = min(low + step, node)
            shape = equilibria.under(to * load, here + (to - low) * slope, to * softening)
            if shape is None or not stable(shape, to):
                step = 0.5 * (to - low)
                continue
            slope = (shape - here) / (to - low)
            low, here, step = to, shape, 2.0 * step
            if to == node:
                shapes.append(shape)
            if to == top:
                return shapes
        raise unstable_at(still.greatest, math.sqrt(low))

    def _check_size(self, displacements: np.ndarray, most: int = 1) -> None:
        """Raise ElasticityError for displacements that are not (N,), or (m, N) where `most` is 2."""
        shape = np.shape(displacements)
        if not 1 <= len(shape) <= most or shape[-1] != 3 * len(fenicsx.node_coordinates(self.space)):
            raise ElasticityError(f"displacement: shape {shape} is not that of this mesh and degree")

    def _material_stiffness(self, measure: Any) -> sparse.csr_array:
        return fenicsx.matrix(ufl.inner(self.stress(self._trial), ufl.sym(ufl.grad(self._test))) * measure)

    def _support_stiffness(self, name: str) -> sparse.csr_array:
        support, domain, trial = self.elastic[name], self.domain, self._trial
        axes = fenicsx.constant(domain, support.stiffness)
        normal, tangential = (fenicsx.constant(domain, value) for value in (support.normal, support.tangential))
        outward = ufl.FacetNormal(domain.mesh)
        traction = ufl.as_vector([axes[i] * trial[i] for i in range(3)]) + tangential * trial
        traction += (normal - tangential) * ufl.inner(trial, outward) * outward
        return fenicsx.matrix(ufl.inner(traction, self._test) * fenicsx.over(domain, 2, domain.facet_group(name)))

    def _nodes(self, name: str) -> np.ndarray:
        nodes = [fenicsx.group_nodes(self.space, group, dimension) for dimension, group in self.domain.group(name)]
        return np.unique(np.concatenate(nodes)).astype(np.int64)

    def _patch(self, name: str) -> Patch:
        nodes, facets = self._nodes(name), self.domain.facets.get(name)
        if facets is None:
            return Patch(nodes, np.ones(nodes.size))
        weights = fenicsx.facet_weights(self.domain, self.space, facets)[nodes]
        return Patch(
            nodes, weights, fenicsx.facet_normal(self.domain, facets) / max(weights.sum(), np.finfo(float).tiny)
        )

    def _fixed(self, clamped: Mapping[str, str]) -> np.ndarray:
        fixed = [np.empty(0, dtype=np.int64)]
        for name, components in clamped.items():
            if not components or set(components) - set(_COMPONENTS):
                raise ElasticityError(f"support {name!r}: expected components out of 'xyz', not {components!r}")
            nodes = self._nodes(name)
            fixed.extend(3 * nodes + _COMPONENTS.index(component) for component in components)
        return np.unique(np.concatenate(fixed))


def assemble(
    mesh: str | os.PathLike[str],
    materials: Mapping[str, Material],
    clamped: Mapping[str, str],
    degree: int = 2,
    damping_ratio: float = 0.0,
    elastic: Mapping[str, ElasticSupport] | None = None,
) -> SystemMatrices:
    """Return the matrices of the elastic body on a gmsh mesh; arguments and errors as in Solid."""
    return Solid(mesh, materials, degree, elastic).assemble(clamped, damping_ratio)


def _by_group(materials: Mapping[str, Material], domain: fenicsx.Domain) -> dict[str, Material]:
    unknown = sorted(set(materials) - set(domain.volumes) - {DEFAULT})
    if unknown:
        raise ElasticityError(
            f"material {unknown[0]!r}: {domain.path} has no such volume group; "
            f"there are: {', '.join(sorted(domain.volumes))}"
        )
    missing = sorted(set(domain.volumes) - set(materials))
    if missing and DEFAULT not in materials:
        raise ElasticityError(f"material: volume group {missing[0]!r} has none; name it or give a {DEFAULT!r} material")
    return {name: materials[name if name in materials else DEFAULT] for name in domain.volumes}
