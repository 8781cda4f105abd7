"""Numbers of a scene given as ranges: where they stand, their table, and how they are read from a file."""

from __future__ import annotations

import copy
import math
from collections.abc import Mapping
from typing import Annotated, Any, Literal, TypeVar

from pydantic import Field
from pydantic.dataclasses import dataclass

from vanedamp.coupling.scene.paths import assign, table_at
from vanedamp.files.toml_input import STRICT, InputError, Whole, dotted, lists_for_numbers, plain, validate

T = TypeVar("T")

#: tables whose numbers are no scene's: those of commands, and of the ensemble itself
_OTHERS = ("sweep", "continuation", "orbit", "ramp", "ring_down", "optimise", "life", "ranges", "ensemble")

Distribution = Literal["uniform", "log-uniform"]


@dataclass(frozen=True, config=STRICT)
class EnsembleTable:
    """How the numbers that are ranges are sampled: by Saltelli's design on a scrambled Sobol' sequence."""

    samples: Annotated[Whole, Field(ge=4, le=2**16)] = 64
    """size N of the design, a power of 2; d ranges take N (d + 2) runs for each point of a sweep"""
    seed: Annotated[Whole, Field(ge=0)] = 0
    """seed of the design, and of the confidence intervals of its indices"""
    distribution: Distribution = "uniform"
    """distribution of every number within its range, or of its logarithm"""

    def __post_init__(self) -> None:
        if self.samples & (self.samples - 1):
            near = 2 ** round(math.log2(self.samples))
            raise ValueError(f"samples: expected a power of 2, such as {near}, not {self.samples}")


def read(record: type[T], data: Mapping[str, Any], source: str) -> T:
    """Return `data` as a record of a scene; a list [low, high] in the place of a number becomes a range.

    The number itself is the middle of its range. Raises InputError naming the source, the key and the remedy.
    """
    try:
        scene = validate(record, data, source)
    except InputError:
        data = dict(plain(data))
        places = [place for place in lists_for_numbers(record, data) if place[0] not in _OTHERS]
        if not places:
            raise
        scene = validate(record, _peeled(data, places, source), source)
    ranges: Mapping[str, tuple[float, float]] = getattr(scene, "ranges", {})
    for end in (0, 1) if ranges else ():
        ends = copy.deepcopy(dict(data)) | {"ranges": {}}
        for path, values in ranges.items():
            assign(ends, path, values[end])
        validate(record, ends, source)
    return scene


def with_ranges(schema: dict[str, Any]) -> dict[str, Any]:
    """Return the JSON Schema of a scene in which every number of its tables may be a range."""
    made = copy.deepcopy(schema)
    nodes: list[Any] = [node for key, node in made["properties"].items() if key not in _OTHERS]
    known: set[str] = set()
    while nodes:
        node = nodes.pop()
        if isinstance(node, list):
            nodes += node
        elif isinstance(node, dict):
            name = node.get("$ref", "").rsplit("/", 1)[-1]
            if name and name not in known:
                known.add(name)
                nodes.append(made["$defs"][name])
            for key, inner in node.get("properties", {}).items():
                node["properties"][key] = _ranged(inner)
            nodes += [value for value in node.values() if isinstance(value, dict | list)]
    return made


def _ranged(node: dict[str, Any]) -> dict[str, Any]:
    """Return the schema of a key whose number may be a range; of any other key as it is."""
    forms = node.get("oneOf", node.get("anyOf", [node]))  # a word may stand for a number, too
    plain_number = next((form for form in forms if form.get("type") == "number"), None)
    if plain_number is None:
        return node
    bounds = ("type", "minimum", "maximum", "exclusiveMinimum", "exclusiveMaximum")
    number = {key: plain_number[key] for key in bounds if key in plain_number}
    pair = {"type": "array", "items": number, "minItems": 2, "maxItems": 2}
    words = [form for form in forms if form is not plain_number]
    rest = {key: value for key, value in node.items() if key not in (*number, "oneOf", "anyOf")}
    return rest | {"anyOf": [number, pair, *words]}


def _peeled(data: dict[str, Any], places: list[list[Any]], source: str) -> dict[str, Any]:
    """Return a scene's tables with the middle of each range in its place, and the ranges in their own table."""
    table = data.get("ensemble")
    logarithmic = isinstance(table, dict) and table.get("distribution") == "log-uniform"
    data, ranges = copy.deepcopy(data), {}
    for place in places:
        node = table_at(data, place)
        low, high = _ends(node[place[-1]], f"{source}: {dotted(place)}", logarithmic)
        node[place[-1]] = math.sqrt(low * high) if logarithmic else (low + high) / 2
        ranges[".".join(map(str, place))] = [low, high]
    given = data.get("ranges", {})
    return data | {"ranges": given | ranges if isinstance(given, dict) else given}


def _ends(value: Any, key: str, logarithmic: bool) -> tuple[float, float]:
    numbers = all(isinstance(end, int | float) and not isinstance(end, bool) for end in value)
    if not numbers or len(value) != 2 or not value[0] < value[1]:
        raise InputError(f"{key}: expected a number, or a range [low, high] of two rising numbers (got {value})")
    if logarithmic and value[0] <= 0.0:
        raise InputError(f'{key}: distribution = "log-uniform" takes a range above zero (got {value})')
    return float(value[0]), float(value[1])
