"""The linear references of a scene in words."""

from __future__ import annotations

from typing import NamedTuple

from vanedamp.coupling.scene.scene import Scene


class ReferenceNames(NamedTuple):
    """Names of both structures for people, and of the maximum of the first."""

    undamped: str = "without bodies"
    fixed: str = "bodies fixed"
    maximum: str = "maximum without bodies"

    def of(self, what: str) -> str:
        """Return the name of something else than the maximum of the first structure."""
        return self.maximum.replace("maximum", what)

    @property
    def held(self) -> str:
        """The name of the second structure in one word."""
        return self.fixed.split()[-1]


def reference_names(scene: Scene) -> ReferenceNames | None:
    """Return the names of the linear references of a scene; None where nothing holds the structure."""
    if scene.damper:
        return ReferenceNames()
    rubs = scene.friction_damper or any(one.rubs and one.on_structure for _, _, one in scene.elements)
    return ReferenceNames("free", "stuck", "free maximum") if rubs else None
