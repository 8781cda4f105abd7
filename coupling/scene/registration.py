"""What other code adds to the choices of a scene: one function for all kinds."""

from __future__ import annotations

from typing import TypeVar

from vanedamp.coupling.scene.contact_laws.law import ContactLaw
from vanedamp.coupling.scene.contact_laws.registry import LAWS
from vanedamp.coupling.scene.waveform import WAVEFORMS, Waveform
from vanedamp.files.extensions import ExtensionError

Part = TypeVar("Part")

#: bases of what can be added, and the registries
_REGISTRIES = ((ContactLaw, LAWS), (Waveform, WAVEFORMS))


def register(part: type[Part]) -> type[Part]:
    """Add a contact law or a waveform to those that scenes may name; may decorate the class, which is returned.

    part: a frozen dataclass derived from `ContactLaw` or `Waveform`, whose docstrings are the contract. An installed
    package adds one without a call, by an entry point (CONTRIBUTING.md). Raises ExtensionError for any other class, and
    for a name that is taken.
    """
    for base, registry in _REGISTRIES:
        if isinstance(part, type) and issubclass(part, base):
            return registry.register(part)
    names = " or ".join(base.__name__ for base, _ in _REGISTRIES)
    raise ExtensionError(f"{part!r}: derive it from {names}")
