"""What a scene may name: contact laws, waveforms, shapes and elements, ours and other code's.

An installed package adds one, a class derived from the base of its kind, without a call, in its pyproject.toml:

    [project.entry-points."vanedamp.contact_laws"]
    power = "acme.power_law:PowerLaw"

The other groups are "vanedamp.waveforms", "vanedamp.shapes" and "vanedamp.elements", whose entries have the name of the
shape and the element's table.
"""

from __future__ import annotations

from typing import Annotated, Any, TypeVar

from vanedamp.coupling.scene.contact_laws.compliant import Compliant
from vanedamp.coupling.scene.contact_laws.hertz import Hertz
from vanedamp.coupling.scene.contact_laws.law import ContactLaw
from vanedamp.coupling.scene.contact_laws.massless import Massless
from vanedamp.coupling.scene.contact_laws.newton import Newton
from vanedamp.coupling.scene.contact_laws.poisson import Poisson
from vanedamp.coupling.scene.contact_laws.viscoelastic import Viscoelastic
from vanedamp.coupling.scene.elements.element import SceneElement
from vanedamp.coupling.scene.shapes.shape import SIDES, Shape
from vanedamp.coupling.scene.waveform import Waveform
from vanedamp.coupling.scene.waveforms.history import History
from vanedamp.coupling.scene.waveforms.multisine import Multisine
from vanedamp.files.extensions import ExtensionError, Registry
from vanedamp.files.variants import Variants

Part = TypeVar("Part")

#: the values of `contact.law`
LAWS = Variants("contact law", ContactLaw, "law", "vanedamp.contact_laws")
#: the values of `excitation.waveform.shape`
WAVEFORMS = Variants("waveform", Waveform, "shape", "vanedamp.waveforms")
#: type of a scene's `contact`
Contact = Annotated[ContactLaw, LAWS]
#: type of an excitation's `waveform`
AnyWaveform = Annotated[Waveform, WAVEFORMS]
for _law in (Newton, Poisson, Compliant, Massless, Viscoelastic, Hertz):
    LAWS.register(_law)
for _waveform in (Multisine, History):
    WAVEFORMS.register(_waveform)

_SHAPES, _ELEMENTS = "vanedamp.coupling.scene.shapes", "vanedamp.coupling.scene.elements"
#: the values of `damper.shape`
SHAPES = Registry(
    "shape",
    {
        "slider": f"{_SHAPES}.slider:Slider",
        "block": f"{_SHAPES}.block:Block",
        "disc": f"{_SHAPES}.disc:Disc",
        "auto": f"{_SHAPES}.slider:Open",
    },
    "vanedamp.shapes",
    ("extended", "corners", "points"),
)
#: the tables of elements
ELEMENTS = Registry(
    "element",
    {"stop": f"{_ELEMENTS}.stop:Stop", "joint": f"{_ELEMENTS}.joint:Joint"},
    "vanedamp.elements",
    ("units", "on_structure"),
)


def meets_body(side: str) -> bool:
    """Return whether events with that side name a body, not a stop or another element of the structure only."""
    return side in (*SIDES, "body") or (side in ELEMENTS and not ELEMENTS.part(side).on_structure)


def register(part: type[Part], name: str | None = None) -> type[Part]:
    """Add a contact law, a waveform, a shape or an element to those that scenes may name; may decorate the class.

    part: a class derived from `ContactLaw`, `Waveform`, `Shape` or `SceneElement`, whose docstrings are the contract;
    it is returned. name: of a shape or of an element's table, by default the class's own in small letters. An installed
    package adds one without a call, by an entry point (docs/howto/own_parts.md). Raises ExtensionError for any other
    class, and for a name that is taken.
    """
    kinds: dict[type, Variants[Any] | Registry] = {
        ContactLaw: LAWS,
        Waveform: WAVEFORMS,
        Shape: SHAPES,
        SceneElement: ELEMENTS,
    }
    for base, kind in kinds.items():
        if isinstance(part, type) and issubclass(part, base):
            if isinstance(kind, Variants):
                return kind.register(part)
            kind.register(name or part.__name__.lower(), part)
            return part
    raise ExtensionError(f"{part!r}: derive it from {' or '.join(base.__name__ for base in kinds)}")
