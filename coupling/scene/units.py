"""What records say of the numbers of a scene, by their dotted paths: unit, meaning and limits (files.reference)."""

from __future__ import annotations

import math
import re
from functools import cache
from typing import Any

from vanedamp.coupling.scene.scene import Scene
from vanedamp.files.reference import key_in, options, schema

#: what ends the words of a docstring that name a number
_END = re.compile(r"[;:,]| \(| \[")


@cache
def unit_of(path: str) -> str:
    """Return the unit of the number at a path such as "cavity.c1.gap" or "damper.mass"; "1" if it has none."""
    units = [node["x-unit"] for node in _nodes(path) if "x-unit" in node]
    return units[0] if units and units[0] != "-" else "1"


@cache
def label_of(path: str) -> str:
    """Return what the number at a path is, for people, such as "mass of the body"; the path where nothing says so."""
    texts = [node["description"] for node in _nodes(path) if "description" in node]
    return _END.split(texts[0])[0] if texts else path


@cache
def limits_of(path: str) -> tuple[float, float]:
    """Return the least and the largest value that the key at a path takes; infinite where a limit is no value of it."""
    ends = [
        (option.get("minimum", -math.inf), option.get("maximum", math.inf))
        for node in _nodes(path) for option in options(_schema(), node) if option.get("type") == "number"
    ]  # fmt: skip
    return (min(low for low, _ in ends), max(high for _, high in ends)) if ends else (-math.inf, math.inf)


def _nodes(path: str) -> list[dict[str, Any]]:
    """Return the schemas of the key at a path, of several kinds of a table those that have it."""
    whole = _schema()
    nodes = [whole]
    for step in path.split("."):
        nodes = [inner for node in nodes for table in options(whole, node) for inner in _inside(whole, table, step)]
    return nodes


@cache
def _schema() -> dict[str, Any]:
    return schema(Scene)


def _inside(whole: dict[str, Any], table: dict[str, Any], step: str) -> list[dict[str, Any]]:
    """Return the schemas at a step of a path: a key, an entry of a list, or a key of all its entries."""
    if "items" not in table:
        return [node for node in (key_in(table, step),) if node]
    nodes = [key_in(entry, step) for entry in options(whole, table["items"])]
    return [node for node in nodes if node] or [table["items"]]
