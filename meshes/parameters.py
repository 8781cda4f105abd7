"""Parameters of the vane cluster, and what the parameters of all meshes share: keys and checks."""

import math
from dataclasses import dataclass, field, fields
from numbers import Integral
from numbers import Real as RealNumber
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import ConfigDict, Field

from vanedamp.files.errors import VanedampError
from vanedamp.files.toml_input import STRICT, Real, Whole

Degree = Annotated[Whole, Field(ge=1, le=3)]


class ParameterError(VanedampError):
    """A parameter of a mesh that is out of its range or does not fit the others; the message starts with its name."""


#: a machine with 100 GB of memory factorises as many; most models have some ten thousand
MOST_ELEMENTS = 5_000_000
#: tetrahedra of gmsh in a volume of the cube of their size: 7.2 in the shipped cluster
_PER_CUBE = 7.0


def check_elements(count: float, name: str) -> None:
    """Raise ParameterError for more elements than a machine can take."""
    if count > MOST_ELEMENTS:
        raise ParameterError(f"{name}: about {count:.2g} elements; at most {MOST_ELEMENTS:.2g}")


def expected_elements(size: float, volume: float) -> float:
    """Return about how many tetrahedra of a size (m) gmsh puts into a volume (m^3)."""
    return _PER_CUBE * volume / size / size / size


def check_size(size: float, volume: float) -> None:
    """Raise ParameterError for an element size (m) so small that a volume (m^3) has too many elements."""
    count = expected_elements(size, volume)
    if count > MOST_ELEMENTS:
        least = (_PER_CUBE * volume / MOST_ELEMENTS) ** (1 / 3)
        raise ParameterError(
            f"element_size: {size:g} m makes about {count:.2g} elements; at most {MOST_ELEMENTS:.2g}, of {least:.2g} m"
        )


@dataclass(frozen=True, kw_only=True)
class MeshParameters:
    """Base of the parameters of a mesh, which with these are the keys of [mesh]."""

    __pydantic_config__: ClassVar[ConfigDict] = STRICT
    generator: str
    degree: Degree = 2
    """polynomial degree of the displacements"""

    @property
    def own(self) -> list[Any]:
        """The fields of the geometry."""
        return [item for item in fields(self) if not item.kw_only]


_DAMPER = ("damper_width", "damper_height", "damper_depth")


@dataclass(frozen=True)
class VaneCluster(MeshParameters):
    """Vanes between two shrouds, SI units, angles in degrees. The defaults belong to the shipped `vane_cluster.msh`.

    Facet groups: `clamp` (outer surface of the outer shroud), `shroud` (inner surface of the inner shroud: its average
    tangential displacement is the response), `shroud_low` and `shroud_high` (end faces of the inner shroud, at the
    smaller and the larger angle from z to y), and for every cavity i from 1 `c<i>_left` and `c<i>_right` (walls normal
    to the tangential direction at its negative and positive end), `c<i>_floor` and `c<i>_roof` (walls at the smaller
    and the larger radius). Volume groups: `outer_shroud`, `airfoils`, `inner_shroud`, and `damper` for tied bodies.

    A cavity is a rectangular pocket, sunk from the axial end face at positive x into the middle of the inner shroud's
    wall, as an electrode erodes it; the lid that keeps the bodies in is not modelled. Cavities are spread evenly.

    With a damper's width, height and depth (tangential, radial, axial; all three or none) a body of that size is
    meshed into every cavity, tied to the middle of its floor, and to every other wall that it reaches. The part
    of a wall that it covers is no part of the wall's facet group.
    """

    generator: Literal["vane_cluster"] = field(default="vane_cluster", kw_only=True)
    """"vane_cluster": the parametric cluster"""
    airfoils: Whole = 4
    """number of airfoils"""
    pitch_deg: Real = 4.0
    """angle between two airfoils [degree]"""
    inner_radius: Real = 0.230
    """inner radius of the inner shroud [m]"""
    inner_thickness: Real = 0.010
    """radial thickness of the inner shroud [m]"""
    span: Real = 0.025
    """radial length of the airfoils between the shrouds [m]"""
    outer_thickness: Real = 0.008
    """radial thickness of the outer shroud [m]"""
    axial_length: Real = 0.024
    """axial length of the shrouds [m]"""
    chord: Real = 0.022
    """chord of the airfoils [m]"""
    thickness: Real = 0.00371
    """largest thickness of the airfoils [m]"""
    edge_thickness: Real = 0.0008
    """thickness of the airfoils at the trailing edge [m]"""
    camber_deg: Real = 20.0
    """angle between the ends of the airfoils' camber line, a circular arc [degree]"""
    stagger_deg: Real = 12.0
    """angle of the chord to the axis [degree]"""
    cavities: Whole = 1
    """number of cavities, spread evenly; 0: none"""
    cavity_width: Real = 0.014
    """tangential width of a cavity [m]"""
    cavity_height: Real = 0.005
    """radial height of a cavity [m]"""
    cavity_depth: Real = 0.012
    """axial depth of a cavity, from the end face at positive x [m]"""
    cavity_wall: Real = 0.001
    """least thickness of the wall around a cavity [m]"""
    damper_width: Real = 0.0
    """tangential width of a body tied into every cavity; 0: none [m]"""
    damper_height: Real = 0.0
    """radial height of the tied body [m]"""
    damper_depth: Real = 0.0
    """axial depth of the tied body [m]"""
    element_size: Real = 0.0026
    """size of the elements [m]"""
    order: Whole = 1
    """order of the elements' geometry: 1 straight, 2 curved"""

    def __post_init__(self) -> None:
        for item in self.own:
            value, least = getattr(self, item.name), 0 if item.name == "cavities" else 1
            if isinstance(item.default, int):
                if not isinstance(value, Integral) or value < least:
                    raise ParameterError(f"{item.name}: expected a whole number of at least {least}, not {value!r}")
            elif not isinstance(value, RealNumber) or not math.isfinite(value):
                raise ParameterError(f"{item.name}: expected a finite number, not {value!r}")
            elif item.name in _DAMPER:
                if value < 0.0:
                    raise ParameterError(f"{item.name}: expected a positive number, or 0 for no body; not {value}")
            elif item.name not in ("camber_deg", "stagger_deg") and value <= 0.0:
                raise ParameterError(f"{item.name}: expected a positive number, not {value}")
        self._check_angles()
        self._check_airfoils()
        if self.cavities:
            self._check_cavities()
        if any(self.damper_size):
            self._check_damper()
        check_size(self.element_size, self.volume)

    @property
    def volume(self) -> float:
        """Volume of the shrouds without cavities, m^3, which is nearly that of the cluster."""
        sector = 0.5 * math.radians(self.sector_deg) * self.axial_length
        inner = self.platform_radius**2 - self.inner_radius**2
        return sector * (inner + self.outer_radius**2 - self.casing_radius**2)

    @property
    def sector_deg(self) -> float:
        """Angle that the shrouds cover."""
        return self.airfoils * self.pitch_deg

    @property
    def platform_radius(self) -> float:
        """Outer radius of the inner shroud, where the airfoils end, m."""
        return self.inner_radius + self.inner_thickness

    @property
    def casing_radius(self) -> float:
        """Inner radius of the outer shroud, m."""
        return self.platform_radius + self.span

    @property
    def outer_radius(self) -> float:
        """Outer radius of the outer shroud, the clamped surface, m."""
        return self.casing_radius + self.outer_thickness

    @property
    def cavity_radius(self) -> float:
        """Radial position of the middle of the cavities, m."""
        return self.inner_radius + 0.5 * self.inner_thickness

    @property
    def damper_size(self) -> tuple[float, float, float]:
        """Axial, tangential and radial size of the tied body in every cavity, m; zeros without bodies."""
        return self.damper_depth, self.damper_width, self.damper_height

    @property
    def damper_volume(self) -> float:
        """Volume of the tied bodies in all cavities, m^3."""
        return self.cavities * math.prod(self.damper_size)

    def cavity_angles(self) -> np.ndarray:
        """Return the angular positions (cavities,) of the cavities, rad."""
        slot = math.radians(self.sector_deg) / max(self.cavities, 1)
        return (np.arange(self.cavities) - 0.5 * (self.cavities - 1)) * slot

    def profile(self, points: int = 24) -> tuple[np.ndarray, np.ndarray]:
        """Return suction and pressure side of the airfoil, (points, 2) each: axial, tangential, m, from its nose.

        Circular-arc camber line with the thickness of the NACA four-digit series (Abbott and von Doenhoff, Theory of
        Wing Sections, 1959, section 6.4; closed trailing edge), widened linearly to the given edge thickness.
        """
        share = 0.5 * (1.0 - np.cos(np.linspace(0.0, math.pi, points)))
        polynomial = np.polynomial.Polynomial([0.0, -0.1260, -0.3516, 0.2843, -0.1036])
        half = 5.0 * self.thickness * (0.2969 * np.sqrt(share) + polynomial(share)) + 0.5 * self.edge_thickness * share
        slope = math.radians(self.camber_deg) * (0.5 - share)
        if abs(self.camber_deg) > 1e-6:
            radius = 0.5 * self.chord / math.sin(0.5 * math.radians(self.camber_deg))
            line = radius * np.column_stack([-np.sin(slope), np.cos(slope)])
            line -= 0.5 * (line.min(axis=0) + line.max(axis=0))
        else:
            line = np.column_stack([self.chord * (share - 0.5), np.zeros(points)])
        normal = np.column_stack([-np.sin(slope), np.cos(slope)])
        stagger = math.radians(self.stagger_deg)
        rotation = np.array([[math.cos(stagger), math.sin(stagger)], [-math.sin(stagger), math.cos(stagger)]])
        return (line + half[:, None] * normal) @ rotation, (line - half[:, None] * normal) @ rotation

    def _check_angles(self) -> None:
        if self.order not in (1, 2):
            raise ParameterError(f"order: expected 1 (straight) or 2 (curved elements), not {self.order}")
        if self.sector_deg >= 180.0:
            raise ParameterError(
                f"pitch_deg: {self.airfoils} airfoils cover {self.sector_deg} degrees, 180 are too many"
            )
        if abs(self.camber_deg) > 90.0:
            raise ParameterError(f"camber_deg: expected at most 90, not {self.camber_deg}")
        if abs(self.stagger_deg) >= 90.0:
            raise ParameterError(f"stagger_deg: expected less than 90, not {self.stagger_deg}")

    def _check_airfoils(self) -> None:
        if self.thickness + self.edge_thickness >= 0.5 * self.chord:
            raise ParameterError(f"thickness: {self.thickness} m leaves no airfoil in a chord of {self.chord} m")
        corners = np.vstack(self.profile())
        axial, tangential = np.abs(corners).max(axis=0)
        if axial >= 0.5 * self.axial_length:
            raise ParameterError(
                f"axial_length: the airfoil needs {2 * axial:.4g} m, the shrouds have {self.axial_length} m"
            )
        pitch = self.platform_radius * math.sin(0.5 * math.radians(self.pitch_deg))
        if tangential >= pitch:
            raise ParameterError(
                f"pitch_deg: an airfoil needs {2 * tangential:.4g} m of circumference, a pitch has {2 * pitch:.4g} m"
            )
        sag = self.platform_radius - math.sqrt(self.platform_radius**2 - tangential**2)
        if sag >= 0.5 * self.inner_thickness:
            raise ParameterError(f"inner_thickness: {self.inner_thickness} m cannot hold the foot of an airfoil")

    def _check_cavities(self) -> None:
        half, floor = 0.5 * self.cavity_width, self.cavity_radius - 0.5 * self.cavity_height
        wall = self.cavity_wall
        if self.cavity_depth > self.axial_length - wall:
            raise ParameterError(
                f"cavity_depth: {self.cavity_depth} m leaves no wall of {wall} m in an axial length of "
                f"{self.axial_length} m"
            )
        corner = math.hypot(half, floor + self.cavity_height)
        if floor - wall < self.inner_radius or corner + wall > self.platform_radius:
            raise ParameterError(
                f"cavity_height: {self.cavity_height} m by a cavity_width of {self.cavity_width} m leaves no wall of "
                f"{wall} m in an inner shroud of {self.inner_thickness} m"
            )
        slot = floor * math.tan(0.5 * math.radians(self.sector_deg) / self.cavities) - wall
        if half > slot:
            raise ParameterError(
                f"cavity_width: {self.cavities} cavities of {self.cavity_width} m do not fit, "
                f"at most {2 * max(slot, 0.0):.4g} m each"
            )

    def _check_damper(self) -> None:
        for name in _DAMPER:
            size, room = getattr(self, name), getattr(self, name.replace("damper", "cavity"))
            if not self.cavities or not 0.0 < size <= room:
                raise ParameterError(f"{name}: expected more than 0 and at most the cavity's {room} m, not {size}")
