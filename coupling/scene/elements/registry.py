"""The elements that a scene may have: ours, and those that other code registers under the name of their table.

An installed package adds one, a dataclass derived from SceneElement, without a call, in its pyproject.toml:

    [project.entry-points."vanedamp.elements"]
    tether = "acme.tether:Tether"
"""

from __future__ import annotations

from vanedamp.coupling.scene.shapes.shape import SIDES
from vanedamp.files.extensions import Registry

ELEMENTS = Registry(
    "element", {"stop": "vanedamp.coupling.scene.elements.stop:Stop"}, "vanedamp.elements", ("units", "on_structure")
)


def meets_body(side: str) -> bool:
    """Return whether events with that side name a body, not a stop or another element of the structure only."""
    return side in (*SIDES, "body") or (side in ELEMENTS and not ELEMENTS.part(side).on_structure)


#: adds an element, by the name of its table and its class
register = ELEMENTS.register
