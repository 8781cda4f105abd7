"""Numbers of a scene that vary: their bounds and scales, by the dotted paths that axes of sweeps have."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import ConfigDict, Field, GetJsonSchemaHandler, TypeAdapter
from pydantic.dataclasses import dataclass
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema

from vanedamp.coupling.scene.rotation import FREQUENCY
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.system.assembly import assemble
from vanedamp.files.open_record import OpenRecord
from vanedamp.files.toml_input import STRICT, InputError, Real

#: tables whose numbers do not describe the scene
_NO_NUMBERS = ("time", "solver", "continuation", "sweep", "ranges", "ensemble", "orbit", "ramp")
INLINE = STRICT | ConfigDict(json_schema_extra={"x-inline": True})


@dataclass(frozen=True, config=INLINE)
class Number:
    """A number of a scene that varies between bounds."""

    min: Real
    """smallest value that it may have [unit of the number]"""
    max: Real
    """largest value that it may have [unit of the number]"""
    scale: Literal["linear", "log"] = Field(default="linear", kw_only=True)
    """how values between the bounds are spread: "log" for a number that is known to some powers of ten"""

    def __post_init__(self) -> None:
        if self.min > self.max:
            raise ValueError(f"expected [lowest, highest], not [{self.min:g}, {self.max:g}]")
        if self.scale == "log" and self.min <= 0.0:
            raise ValueError(f'min: expected a positive number with scale = "log", not {self.min:g}')


class Box:
    """Values (P,) of numbers between their bounds, and their places (P,) from 0 to 1 there, each by its scale.

    ends: bounds (2, P), of a log scale as logarithms.
    """

    def __init__(self, numbers: Iterable[Number]) -> None:
        given = list(numbers)
        self._log = np.array([number.scale == "log" for number in given], bool)
        self.ends = self.spread(np.reshape([(number.min, number.max) for number in given], (-1, 2)).T)

    def spread(self, values: np.ndarray) -> np.ndarray:
        """Return values, of a log scale as logarithms."""
        return np.where(self._log, np.log(np.where(self._log, values, 1.0)), values)

    def gathered(self, spread: np.ndarray) -> np.ndarray:
        """Return the values of `spread`."""
        return np.where(self._log, np.exp(np.where(self._log, spread, 0.0)), spread)

    def values(self, places: np.ndarray) -> np.ndarray:
        """Return the values at places."""
        low, high = self.ends
        return self.gathered(low + np.asarray(places) * (high - low))

    def places(self, values: np.ndarray) -> np.ndarray:
        """Return the places of values."""
        low, high = self.ends
        return np.asarray((self.spread(values) - low) / (high - low))

    def slope(self, values: np.ndarray) -> np.ndarray:
        """Return the derivatives (P,) of values by their places."""
        low, high = self.ends
        return np.asarray((high - low) * np.where(self._log, values, 1.0))


def check_number(scene: Scene, path: str, values: Sequence[float], where: str, others: Sequence[str] = ()) -> float:
    """Return the number of a scene at a path, which may have some values.

    where: the key that errors name; others: further tables whose numbers do not count. Raises InputError for a path
    that is no number that can vary, and for values with which there is no scene.
    """
    if path.split(".")[0] in (*_NO_NUMBERS, *others) or path == FREQUENCY:
        raise InputError(f"{where}: {path} is no number of structure, bodies or level; take one such as cavity.gap")
    try:
        given = scene.number(path)
        for value in values:
            assemble(scene.replace({path: value}))
    except InputError as error:
        raise InputError(f"{where}: {path}: {str(error).removeprefix('scene: ')}") from None
    return given


class _Paths(dict[str, Any]):
    """What has every dotted path."""

    def __contains__(self, path: object) -> bool:
        return "." in str(path)


@dataclass(frozen=True, config=STRICT, repr=False)
class ByPath(OpenRecord):
    """Base of tables that take dotted paths of numbers besides their keys. KIND: type of what a path has."""

    KIND: ClassVar[Any]

    @classmethod
    def keys_added(cls) -> Mapping[str, Any]:
        """Return a mapping that has every path, and lists none."""
        return _Paths()

    @classmethod
    def _validated(cls, values: Mapping[str, Any], types: Mapping[str, Any]) -> dict[str, Any]:
        return TypeAdapter(dict[str, cls.KIND]).validate_python(values)  # type: ignore[name-defined]

    @property
    def numbers(self) -> dict[str, Any]:
        """What the table has by paths, in their order: the same however a file was written."""
        return dict(sorted((self.added or {}).items()))

    @classmethod
    def __get_pydantic_json_schema__(cls, schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        made = super().__get_pydantic_json_schema__(schema, handler)
        table = handler.resolve_ref_schema(made)
        table["additionalProperties"] = handler(TypeAdapter(cls.KIND).core_schema)
        table["propertyNames"] = {"anyOf": [{"enum": list(table["properties"])}, {"pattern": r"\."}]}
        return made
