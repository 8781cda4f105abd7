"""Units of the numbers of a scene, by their dotted paths: those that its records give (files.reference)."""

from __future__ import annotations

from functools import cache
from typing import Any

from vanedamp.coupling.scene.scene import Scene
from vanedamp.files.reference import key_in, options, schema


@cache
def unit_of(path: str) -> str:
    """Return the unit of the number at a path such as "cavity.c1.gap" or "damper.mass"; "1" if it has none."""
    whole = _schema()
    nodes = [whole]
    for step in path.split("."):
        nodes = [inner for node in nodes for table in options(whole, node) for inner in _inside(whole, table, step)]
    units = [node["x-unit"] for node in nodes if "x-unit" in node]
    return units[0] if units and units[0] != "-" else "1"


@cache
def _schema() -> dict[str, Any]:
    return schema(Scene)


def _inside(whole: dict[str, Any], table: dict[str, Any], step: str) -> list[dict[str, Any]]:
    """Return the schemas at a step of a path: a key, an entry of a list, or a key of all its entries."""
    if "items" not in table:
        return [node for node in (key_in(table, step),) if node]
    found = [key_in(entry, step) for entry in options(whole, table["items"])]
    return [node for node in found if node] or [table["items"]]
