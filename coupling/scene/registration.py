"""What other code adds to the choices of a scene: one function for all kinds."""

from __future__ import annotations

from typing import TypeVar

from vanedamp.coupling.scene.contact_laws.law import ContactLaw
from vanedamp.coupling.scene.contact_laws.registry import LAWS
from vanedamp.coupling.scene.elements.element import SceneElement
from vanedamp.coupling.scene.elements.registry import ELEMENTS
from vanedamp.coupling.scene.shapes.registry import SHAPES
from vanedamp.coupling.scene.shapes.shape import Shape
from vanedamp.coupling.scene.waveform import WAVEFORMS, Waveform
from vanedamp.files.extensions import ExtensionError

Part = TypeVar("Part")

#: bases of what can be added, and the registries: of classes with a name of their own, and of others
_REGISTRIES = ((ContactLaw, LAWS), (Waveform, WAVEFORMS))
_NAMED = ((Shape, SHAPES), (SceneElement, ELEMENTS))


def register(part: type[Part], name: str | None = None) -> type[Part]:
    """Add a contact law, a waveform, a shape or an element to those that scenes may name; may decorate the class.

    part: a class derived from `ContactLaw`, `Waveform`, `Shape` or `SceneElement`, whose docstrings are the contract;
    it is returned. name: of a shape or of an element's table, by default the class's own in small letters. An installed
    package adds one without a call, by an entry point (CONTRIBUTING.md). Raises ExtensionError for any other class, and
    for a name that is taken.
    """
    for base, registry in _REGISTRIES:
        if isinstance(part, type) and issubclass(part, base):
            return registry.register(part)
    for kind, named in _NAMED:
        if isinstance(part, type) and issubclass(part, kind):
            named.register(name or part.__name__.lower(), part)
            return part
    names = " or ".join(entry[0].__name__ for entry in (*_REGISTRIES, *_NAMED))
    raise ExtensionError(f"{part!r}: derive it from {names}")
