"""The case file: mesh, materials, supports, modes and interface of a structure (SI units), as frozen records."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import field, fields, replace
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import AfterValidator, BeforeValidator, Discriminator, Field, GetPydanticSchema, Tag
from pydantic.dataclasses import dataclass

from vanedamp.coupling.scene.mistuning import DEVIATIONS, Mistuning
from vanedamp.coupling.strength.material import Fatigue
from vanedamp.files.key_tables import documented
from vanedamp.files.toml_input import (
    STRICT,
    Axes,
    Direction,
    InputError,
    NonNegative,
    Positive,
    Real,
    Whole,
    nearest,
    read_toml,
    validate,
)
from vanedamp.meshes.generators import Generated
from vanedamp.meshes.parameters import Degree
from vanedamp.meshes.sector import Sector
from vanedamp.modal.units import absurdity, strength_absurdity
from vanedamp.studies.case.calibration_tables import CalibrationTable, HotSpotTable
from vanedamp.studies.case.operation_tables import CampbellTable, RotationTable, TemperatureTable
from vanedamp.studies.case.ring_tables import RingTable

Ratio = Annotated[Real, Field(ge=0, lt=1)]
# 1/K: no solid expands more
_EXPANSION = 1e-3
# by which `young` and `young_at` may differ at the reference temperature, relative
_SAME_MODULUS = 1e-3


@dataclass(frozen=True, config=STRICT)
class MeshFile:
    """A mesh from a file."""

    file: str
    """mesh file, relative to the case's: gmsh (.msh), or another program's (.inp, .bdf, .cdb, .unv, .med ...)"""
    degree: Degree = 2
    """polynomial degree of the displacements"""
    scale: Positive = 1.0
    """metres per unit of length of the file: 1e-3 for millimetres [m]"""

    @property
    def foreign(self) -> bool:
        """Whether the file was written by another program than gmsh."""
        return not self.file.lower().endswith(".msh")

    @property
    def files(self) -> list[str]:
        """The file, and those that it includes. Raises MeshError."""
        from vanedamp.files.formats.meshes.registry import mesh_files

        return [str(file) for file in mesh_files(self.file)]


#: keys that name a file: the mesh, and measurements
FILES = (
    ("mesh", "file"),
    ("modes", "shape"),
    ("calibration", "damping", "frf"),
    ("calibration", "tune", "shapes"),
    ("temperature", "file"),
    *(("mistuning", name, "file") for name in DEVIATIONS),
)


def _source(mesh: Any) -> str:
    """Return where a mesh comes from, which messages name."""
    generated = "generator" in mesh if isinstance(mesh, Mapping) else hasattr(mesh, "generator")
    return "a generator" if generated else "a file"


def _one_source(mesh: Any) -> Any:
    if isinstance(mesh, Mapping) and ("file" in mesh) == ("generator" in mesh):
        raise ValueError("give one of file and generator")
    return mesh


Mesh = Annotated[
    Annotated[MeshFile, Tag("a file")] | Annotated[Generated, Tag("a generator")],
    Discriminator(_source),
    BeforeValidator(_one_source),
]


@dataclass(frozen=True, config=STRICT)
class MaterialTable:
    """Isotropic material of a volume group; "default" is that of groups without a table of their own."""

    young: Positive
    """Young's modulus [Pa]"""
    poisson: Annotated[Real, Field(gt=-1, lt=0.5)]
    """Poisson's ratio [-]"""
    density: Positive
    """density [kg/m^3]"""
    damping_ratio: Ratio | None = None
    """modal damping of every mode, as a fraction of critical damping; overridden by that of [modes] [-]"""
    fatigue_strength: Positive | None = None
    """fatigue strength, by which `vanedamp calibrate` sets the excitation [Pa]"""
    fatigue: Fatigue | None = None
    """fatigue data (default: those of [material.fatigue], which are for all materials)"""
    expansion: Annotated[Real, Field(gt=-_EXPANSION, lt=_EXPANSION)] = 0.0
    """coefficient of thermal expansion, for [temperature] [1/K]"""
    young_at: tuple[tuple[Real, Positive], ...] = ()
    """modulus over the temperature, [[temperature, modulus], ...], linear between them (default: `young` throughout) [K
    or degree C, Pa]"""

    def __post_init__(self) -> None:
        temperatures = [temperature for temperature, _ in self.young_at]
        if len(temperatures) == 1 or any(b <= a for a, b in pairwise(temperatures)):
            raise ValueError("young_at: expected [[temperature, modulus], ...], at least two, temperatures ascending")

    def fatigue_data(self, strength: float | None) -> Fatigue | None:
        """Return the fatigue data, complete, or only the fatigue strength; None without either.

        strength: the fatigue strength if the material has none, Pa. Raises ValueError for data without any.
        """
        strength = self.fatigue_strength or strength
        fatigue = self.fatigue or (None if strength is None else Fatigue())
        return None if fatigue is None else fatigue.completed(strength)

    @property
    def own_strength(self) -> float | None:
        """The fatigue strength of the fatigue data, or else the material's; None without either, Pa."""
        return (None if self.fatigue is None else self.fatigue.strength) or self.fatigue_strength


_STRENGTHS = ("strength", "tensile_strength", "yield_strength")
#: keys by which a table below [material] is a material, or fatigue data
_MATERIAL_KEYS = {"young", "poisson", "density"}
_FATIGUE_KEYS = {item.name for item in fields(Fatigue)}


def _kind_of_material(table: Any) -> str:
    keys = table.keys() if isinstance(table, Mapping) else set()
    return (
        "fatigue" if isinstance(table, Fatigue) or (keys & _FATIGUE_KEYS and not keys & _MATERIAL_KEYS) else "material"
    )


def without_strengths(materials: Mapping[str, Any]) -> dict[str, Any]:
    """Return the tables of [material] without fatigue strengths and fatigue data."""
    plain = {name: dict(table) for name, table in materials.items() if _kind_of_material(table) == "material"}
    return {name: {key: plain[name][key] for key in plain[name] if not key.startswith("fatigue")} for name in plain}


def _one_kind(table: Any) -> Any:
    """Reject a table that mixes a material and fatigue data."""
    if isinstance(table, Mapping) and table.keys() & _MATERIAL_KEYS and (stray := table.keys() & _FATIGUE_KEYS):
        raise ValueError(f"{min(stray)}: is fatigue data; head it [material.<group>.fatigue]")
    return table


def _spread(materials: dict[str, MaterialTable | Fatigue]) -> dict[str, MaterialTable]:
    """Return the materials with the fatigue data of [material.fatigue] where they have none of their own."""
    common = materials.get("fatigue")
    common = common if isinstance(common, Fatigue) else None
    spread = {}
    for group, table in materials.items():
        if isinstance(table, Fatigue):
            if group != "fatigue":
                raise ValueError(f"{group}: has fatigue data only; head them [material.{group}.fatigue]")
            continue
        spread[group] = replace(table, fatigue=table.fatigue or common)
    if not spread:
        raise ValueError("no material; add [material.default] with young, poisson and density")
    least = _least_strength(spread)
    for group, material in spread.items():
        try:
            material.fatigue_data(least)
        except ValueError as error:
            raise ValueError(f"{group}.fatigue.{error}") from None
    return spread


def _least_strength(materials: Mapping[str, MaterialTable]) -> float | None:
    return min((t.own_strength for t in materials.values() if t.own_strength is not None), default=None)


def _with_fatigue(schema: dict[str, Any]) -> None:
    """Let the schema of [material] accept [material.fatigue] as fatigue data, and materials under other names."""
    material, fatigue = schema["additionalProperties"]["oneOf"]
    schema |= {"properties": {"fatigue": fatigue}, "additionalProperties": material}


_Material = Annotated[
    Annotated[MaterialTable, Tag("material")] | Annotated[Fatigue, Tag("fatigue")],
    Discriminator(_kind_of_material),
    BeforeValidator(_one_kind),
]
#: tables of [material]: materials, and fatigue data for all of them, which `_spread` merges into the former
_Materials = Annotated[
    dict[
        str,
        Annotated[MaterialTable, GetPydanticSchema(lambda _, handler: handler(_Material))],
    ],
    Field(min_length=1, json_schema_extra=_with_fatigue),
    AfterValidator(_spread),
]


#: facet groups with their fixed components
_Components = dict[str, Annotated[str, Field(pattern="^[xyz]+$")]]
_Clamped = _Components | list[str | _Components]


def _components(clamped: Any) -> Any:
    """Return {facet group: components} from a list of groups and of such tables."""
    merged: dict[Any, Any] = {}
    for entry in [clamped] if isinstance(clamped, Mapping) else clamped if isinstance(clamped, list) else [None]:
        if not isinstance(entry, str | Mapping):
            raise ValueError("expected a list of facet groups, such as ['clamp'] or [{ clamp = 'y' }]")
        merged |= {entry: "xyz"} if isinstance(entry, str) else entry
    for group, components in merged.items():
        if not components or not isinstance(components, str) or set(components) - set("xyz"):
            raise ValueError(f"{group}: expected components out of 'xyz', not {components!r}")
    return merged


@dataclass(frozen=True, config=STRICT)
class ElasticTable:
    """Springs spread over a facet group."""

    stiffness: Axes = (0.0, 0.0, 0.0)
    """stiffness per unit of area, in all directions or [x, y, z] [N/m^3]"""
    normal: NonNegative = 0.0
    """stiffness per unit of area, normal to the facets [N/m^3]"""
    tangential: NonNegative = 0.0
    """stiffness per unit of area along the facets [N/m^3]"""

    def __post_init__(self) -> None:
        if not any((*self.stiffness, self.normal, self.tangential)):
            raise ValueError("stiffness: expected N/m^3, such as 1e12 or [1e12, 5e11, 1e12], or normal and tangential")


@dataclass(frozen=True, config=STRICT)
class Support:
    """What holds the structure."""

    clamped: Annotated[_Components, BeforeValidator(_components, json_schema_input_type=_Clamped)] = field(
        default_factory=dict
    )
    """groups of facets, edges or points that are held: ["clamp"], single components as in [{clamp = "y"}] or
    {clamp = "y"}, where "xyz" are all"""
    elastic: dict[str, ElasticTable] = field(default_factory=dict)
    """springs, by the facet group that they are spread over"""

    def __post_init__(self) -> None:
        for group in self.elastic:
            if set(self.clamped.get(group, "")) == set("xyz"):
                raise ValueError(f"elastic.{group}: the group is clamped, so that springs do nothing; choose one")


@dataclass(frozen=True, config=STRICT)
class ModesTable:
    """Which modes are computed, and which of them is the first bending.

    A multiple mode is turned so that one of its shapes has all the motion of the interface coordinate `at`.
    """

    count: Annotated[Whole, Field(ge=1)] | None = None
    """number of modes, the lowest; or give `max_frequency`"""
    max_frequency: Positive | None = None
    """frequency up to which all modes are computed [Hz]"""
    min_frequency: NonNegative = 0.0
    """frequency from which on modes are computed, with `max_frequency` [Hz]"""
    direction: Direction = (0.0, 1.0, 0.0)
    """direction of the first bending, which is the mode with most effective mass along it [-]"""
    damping_ratio: Ratio | None = None
    """modal damping of every mode, as a fraction of critical damping (default: the materials') [-]"""
    at: str | None = None
    """interface coordinate of the rigid model (default: the only one, or "shroud")"""
    shape: str | None = None
    """file of measured shapes, the first of which the first bending is most like, in place of `direction`"""
    solver: Literal["factor", "iterative", "auto"] = "auto"
    """"factor": by factors of the stiffness, which prove that no mode is missed; "iterative": without them, in less
    memory; "auto": iterative where factors are estimated to need more than half of the memory"""
    pair_tolerance: Annotated[Real, Field(ge=0, le=0.1)] = 1e-3
    """relative difference of frequencies up to which they are one multiple mode [-]"""

    def __post_init__(self) -> None:
        if self.count is not None and self.max_frequency is not None:
            raise ValueError("give one of count and max_frequency")
        if self.min_frequency and not self.min_frequency < (self.max_frequency or 0.0):
            raise ValueError("min_frequency: expected a max_frequency above it, the two ends of a range")


def _groups(facets: Any) -> Any:
    """Return a list of groups as a tuple, a single group as it is."""
    if isinstance(facets, str):
        return facets
    if not isinstance(facets, list | tuple) or not facets or not all(isinstance(group, str) for group in facets):
        raise ValueError("expected a group, such as 'c1_floor', or a list of groups")
    return tuple(facets)


@dataclass(frozen=True, config=STRICT)
class InterfaceTable:
    """One interface coordinate, its table's name: the displacement of a group of the mesh along a direction, or its
    rotation about it (rom.interface).

    Kind "patch" and "cavity" give three coordinates, of the motion in a plane, and "node" with a `normal` the first two
    of them (rom.interface.plane_motion). Kind "pair" gives four for a [[joint]] at two sides that touch: NAME_1,
    NAME_1_across, NAME_2 and NAME_2_across, and with `sideways` NAME_1_sideways, NAME_2_sideways
    (rom.pair.pair_motions).
    """

    facets: Annotated[str | Annotated[tuple[str, ...], Field(min_length=1)], BeforeValidator(_groups)]
    """facet group, or several as one; or else a group of edges or points (a node set); of a pair its two sides"""
    direction: Annotated[Direction | str, Field(union_mode="left_to_right")]
    """direction of the motion, that from the left wall of a cavity to its right one, of a pair that in which it slips;
    "normal": the facets' own; or a facet group, whose outward normal it is [-]"""
    kind: Literal["average", "rigid", "node", "full", "patch", "cavity", "pair"] = "average"
    """"average": mean displacement; "rigid": moves as a rigid body; "node": that nearest to the centroid; "full": every
    node is kept; "patch", "cavity": along, across and rotation in a plane; "pair": along and across of two sides"""
    motion: Literal["translation", "rotation"] = "translation"
    """"translation" along the direction, or "rotation" about it"""
    normal: Annotated[Direction | str, Field(union_mode="left_to_right")] | None = None
    """direction across, out of the floor into the cavity, or of a pair out of its second side into its first, or a
    facet group with that outward normal (default: the facets' own) [-]"""
    points: Annotated[Whole, Field(ge=1)] | None = None
    """of a pair, number of pairs of nodes, spread over the sides, each with its labels: NAME.1_1 ... (default: the mean
    motions of the sides)"""
    tolerance: Positive | None = None
    """largest distance of the two sides of a pair (default: a hundredth of the first one's extent) [m]"""
    next_sector: bool = False
    """whether the second side of a pair is that of the next sector of the ring"""
    sideways: bool = False
    """whether a pair has a second direction along, at right angles to `direction`"""

    def __post_init__(self) -> None:
        if self.paired:
            if isinstance(self.facets, str) or len(self.facets) != 2:
                raise ValueError('facets: kind = "pair" has two sides, such as ["platform_low", "platform_high"]')
            if self.direction == "normal" or self.motion == "rotation":
                key = "direction" if self.direction == "normal" else "motion"
                raise ValueError(f'{key}: kind = "pair" slips along a direction in its plane; give three numbers')
            return
        for key in ("points", "tolerance", "next_sector", "sideways"):
            if getattr(self, key):
                raise ValueError(f'{key}: is for kind = "pair"; leave it out')
        if self.kind in ("patch", "cavity") and self.motion == "rotation":
            raise ValueError(f'motion: kind = "{self.kind}" has the rotation in the plane besides; leave it out')
        if self.normal is not None and self.kind not in ("patch", "cavity", "node"):
            raise ValueError(f'normal: kind = "{self.kind}" moves along its direction only; take kind = "patch"')

    @property
    def groups(self) -> tuple[str, ...]:
        """The groups of `facets`."""
        return (self.facets,) if isinstance(self.facets, str) else self.facets

    @property
    def planar(self) -> bool:
        """Whether it is the motion of a cavity's surface across its direction, too."""
        return self.kind in ("patch", "cavity") or (self.normal is not None and not self.paired)

    @property
    def paired(self) -> bool:
        """Whether it has two sides."""
        return self.kind == "pair"

    @property
    def guides(self) -> dict[str, str]:
        """The facet groups that give directions, by key."""
        directions = {"direction": self.direction, "normal": self.normal}
        return {key: group for key, group in directions.items() if isinstance(group, str) and group != "normal"}


@documented
@dataclass(frozen=True, config=STRICT)
class Case:
    """Everything that modes and reduction of a structure need."""

    mesh: Mesh
    """mesh from a file or a generator"""
    material: _Materials
    """materials, by volume group; "default" for all that have none of their own, "fatigue" for fatigue data of all"""
    support: Support = field(default_factory=Support)
    """what holds the structure (default: nothing)"""
    modes: ModesTable = field(default_factory=ModesTable)
    """modes that are computed, and which is the first bending"""
    interface: dict[str, InterfaceTable] = field(default_factory=dict)
    """interface coordinates, by their labels: where loads and contacts act on a reduced model"""
    calibration: CalibrationTable | None = None
    """measurements of `vanedamp calibrate`"""
    hot_spots: HotSpotTable = field(default_factory=HotSpotTable)
    """where hot spots may lie"""
    rotation: RotationTable | None = None
    """axis and speed of rotation"""
    campbell: CampbellTable | None = None
    """speeds and engine orders of `vanedamp campbell`"""
    temperature: TemperatureTable | None = None
    """temperature of the structure"""
    ring: RingTable | None = None
    """the ring of equal sectors of which the structure is one"""
    mistuning: Mistuning | None = None
    """deviations of the sectors of the ring"""

    def __post_init__(self) -> None:
        ratios = {table.damping_ratio for table in self.material.values()} - {None}
        if self.modes.damping_ratio is None and len(ratios) > 1:
            raise ValueError("material: the damping ratios differ; set the one of the modes in [modes] damping_ratio")
        at, labels = self.modes.at, [label for label, table in self.interface.items() if not table.paired]
        if at is not None and at not in labels:
            raise ValueError(f"modes.at: no interface '{at}'; {nearest(at, labels)}")
        for label, table in self.interface.items():
            if table.next_sector and self.ring is None:
                raise ValueError(f"interface.{label}.next_sector: needs [ring] with sectors, low and high")
        if self.campbell is not None and self.rotation is None:
            raise ValueError("campbell: needs a table [rotation] with the axis of the speeds, such as axis = [1, 0, 0]")
        if self.rotation is not None and self.rotation.gyroscopic and self.modes.min_frequency:
            raise ValueError("modes.min_frequency: modes with the gyroscopic coupling are the lowest; leave it out")
        if self.ring is not None and self.rotation is not None and (self.ring.axis or self.ring.point):
            raise ValueError("ring.axis: a ring that rotates has the axis of [rotation]; leave out axis and point")
        meshed = self.mesh.sectors if isinstance(self.mesh, Sector) else None
        if self.ring is not None and meshed not in (None, self.ring.sectors):
            raise ValueError(f"ring.sectors: the mesh is a sector of {meshed}, not of {self.ring.sectors}")
        if self.mistuning is not None and self.ring is None:
            raise ValueError("mistuning: deviations are those of sectors; give [ring] with sectors, low and high")
        if self.ring is not None and self.modes.min_frequency:
            raise ValueError("modes.min_frequency: families of a ring count from the lowest mode; leave it out")
        stressed = self.temperature is not None or (self.rotation is not None and self.rotation.omega)
        if stressed and self.calibration is not None and self.calibration.tune is not None:
            raise ValueError(
                "calibration.tune: takes frequencies measured at standstill and without [temperature]; leave them out"
            )
        if self.temperature is not None:
            _check_materials(self.material, self.temperature.reference)

    @classmethod
    def load(cls, path: str | Path) -> Case:
        """Read the case in a TOML file; a mesh file is relative to it. Raises InputError, for absurd units too."""
        data = read_toml(path)
        missing = [told for keys in FILES if (told := _find_file(data, keys, path))]
        case = validate(cls, data, str(path))
        if missing:
            raise InputError(f"{path}: {missing[0]}")
        for group, table in case.material.items():
            absurd = absurdity(table.young, table.density)
            if absurd is not None:
                raise InputError(f"{path}: material.{group}.{absurd}; give young in Pa and density in kg/m^3")
            strengths = {"fatigue_strength": table.fatigue_strength}
            strengths |= {f"fatigue.{key}": getattr(table.fatigue, key, None) for key in _STRENGTHS}
            for key, strength in strengths.items():
                absurd = None if strength is None else strength_absurdity(strength, table.young)
                if absurd is not None:
                    raise InputError(f"{path}: material.{group}.{key}: {absurd}; give both in Pa")
        return case

    @property
    def files(self) -> list[str]:
        """The files that the case names: mesh, with those that it includes, and measurements. Raises MeshError."""
        mesh = self.mesh.files if isinstance(self.mesh, MeshFile) else []
        measured = (_value(self, keys) for keys in FILES[1:])
        return mesh + [file for file in measured if file is not None]

    @property
    def damping_ratio(self) -> float:
        """Modal damping ratio of every mode; zero when the file names none."""
        if self.modes.damping_ratio is not None:
            return self.modes.damping_ratio
        return next((t.damping_ratio for t in self.material.values() if t.damping_ratio is not None), 0.0)

    @property
    def fatigue_strength(self) -> float | None:
        """The least of the materials' fatigue strengths, Pa."""
        return _least_strength(self.material)

    def strengths(self, volumes: Iterable[str]) -> dict[str, float]:
        """Return the fatigue strength of every volume group, Pa; the least of all where a group's material has none."""
        least = self.fatigue_strength
        if least is None:
            return {}
        tables = {name: self.material.get(name, self.material.get("default")) for name in volumes}
        return {name: (table.own_strength if table else None) or least for name, table in tables.items()}

    def without_strength(self, volumes: Iterable[str]) -> list[str]:
        """Return the volume groups that use the lowest strength of the others; none if there is no strength."""
        tables = {name: self.material.get(name, self.material.get("default")) for name in volumes}
        rated = self.fatigue_strength is not None
        return [name for name, table in tables.items() if rated and (table is None or table.own_strength is None)]

    def fatigue(self, volume: str) -> Fatigue | None:
        """Return the complete fatigue data of a volume group's material; None without any.

        A material without a fatigue strength uses the lowest of all (`strengths`).
        """
        table = self.material.get(volume, self.material.get("default"))
        return None if table is None else table.fatigue_data(self.fatigue_strength)

    @property
    def response_label(self) -> str | None:
        """The interface coordinate of the rigid model: the one named, the only one, or `shroud`; none of a pair.

        None without any interface. Raises InputError if the choice is ambiguous.
        """
        labels = [label for label, table in self.interface.items() if not table.paired]
        if self.modes.at is not None or not labels:
            return self.modes.at
        if len(labels) == 1 or "shroud" in labels:
            return "shroud" if "shroud" in labels else labels[0]
        raise InputError(f"modes.at: name the interface of the rigid model, one of {', '.join(labels)}")

    @property
    def facet_groups(self) -> set[str]:
        """Every group that supports, hot spots, interfaces and the ring name."""
        named = [group for table in self.interface.values() for group in (*table.groups, *table.guides.values())]
        ring = self.ring.groups.values() if self.ring is not None else ()
        return {*self.support.clamped, *self.support.elastic, *self.hot_spots.exclude, *named, *ring}

    @property
    def volume_groups(self) -> set[str]:
        """Every volume group that materials and the ring name; "unnamed": the elements outside all groups."""
        return {*self.material, *(self.ring.deviating if self.ring is not None else ())} - {"default", "unnamed"}

    def check_groups(
        self, facets: Iterable[str], volumes: Iterable[str], lower: Mapping[str, Iterable[str]] | None = None
    ) -> None:
        """Raise InputError for a group that the mesh does not have; lower: kind ("edge", "point") -> groups."""
        surfaces = {"facet": list(facets)}
        groups = surfaces | {kind: list(names) for kind, names in (lower or {}).items()}
        for group in self.support.clamped:
            _check_group("support.clamped", group, groups)
        for group in self.hot_spots.exclude:
            _check_group("hot_spots.exclude", group, groups)
        mixed = {
            group for group in surfaces["facet"] if any(group in groups[kind] for kind in groups if kind != "facet")
        }
        for group in self.support.elastic:
            _check_group(f"support.elastic.{group}", group, surfaces)
            if group in mixed:
                raise InputError(
                    f"support.elastic.{group}: holds edges or points besides its facets, which have no area; take them "
                    "out of the set"
                )
        for label, table in self.interface.items():
            for group in table.groups:
                _check_group(f"interface.{label}.facets", group, groups)
            # facet groups weight their nodes by area, other groups equally
            kinds = [kind for kind, names in groups.items() if set(table.groups) & set(names)]
            if "facet" in kinds and len(kinds) > 1:
                raise InputError(
                    f"interface.{label}.facets: groups of several kinds ({', '.join(sorted(kinds))}), whose nodes have "
                    "no common weights; take groups of one kind"
                )
            for key, group in table.guides.items():
                _check_group(f"interface.{label}.{key}", group, surfaces)
        for key, group in (self.ring.groups if self.ring is not None else {}).items():
            _check_group(f"ring.{key}", group, surfaces)
            if group in mixed:
                raise InputError(f"ring.{key}: holds edges or points besides its facets; take them out of the set")
        for group in self.ring.deviating if self.ring is not None else ():
            _check_group("ring.deviating", group, {"volume": [*volumes]})
        for group in self.material:
            if group != "default":
                _check_group(f"material.{group}", group, {"volume": [*volumes, "default"]})


def _value(table: Any, keys: Iterable[str]) -> Any:
    """Return the value of a key of nested tables; None if one of them is missing."""
    for key in keys:
        table = getattr(table, key, None)
    return table


def check_interface(case: Case) -> None:
    """Raise InputError for a case without interface coordinates, which cannot be reduced."""
    if not case.interface:
        raise InputError("interface: missing; a reduction needs at least one [interface.<label>] table")


def _check_materials(materials: Mapping[str, MaterialTable], reference: float) -> None:
    """Raise ValueError if no material depends on temperature, or if moduli at the reference temperature contradict."""
    if not any(table.expansion or table.young_at for table in materials.values()):
        raise ValueError("temperature: changes nothing; give a material its expansion (1/K) or young_at")
    for group, table in materials.items():
        if not table.young_at:
            continue
        (low, _), *_, (high, _) = table.young_at
        if not low <= reference <= high:
            raise ValueError(
                f"material.{group}.young_at: holds from {low:g} to {high:g}, without the reference {reference:g}"
            )
        modulus = float(np.interp(reference, *np.transpose(table.young_at)))
        if abs(modulus / table.young - 1.0) > _SAME_MODULUS:
            raise ValueError(
                f"material.{group}.young: is the modulus at the reference temperature, {modulus:.6g} Pa by young_at"
            )


def _find_file(data: dict[str, Any], keys: tuple[str, ...], path: str | Path) -> str:
    """Resolve a file name relative to the case; return what is wrong if there is no such file, else ""."""
    table: Any = data
    for key in keys[:-1]:
        table = table.get(key) if isinstance(table, dict) else None
    name = table.get(keys[-1]) if isinstance(table, dict) else None
    if isinstance(name, str):
        table[keys[-1]] = str(Path(path).parent / name)
        if not Path(table[keys[-1]]).is_file():
            remedy = "; `vanedamp mesh` writes one" if keys[0] == "mesh" else ""
            return f"{'.'.join(keys)}: no such file {table[keys[-1]]}{remedy}"
    return ""


def _check_group(key: str, group: str, by_kind: Mapping[str, list[str]]) -> None:
    """Raise InputError for an unknown group, by kind; the first kind is the usual one."""
    if any(group in names for names in by_kind.values()):
        return
    (kind, names), *others = by_kind.items()
    elsewhere = "".join(f"; {other} groups: {', '.join(sorted(groups))}" for other, groups in others if groups)
    raise InputError(
        f"{key}: no {kind} group '{group}' in the mesh; it has {', '.join(sorted(names)) or 'none'}{elsewhere}"
    )
