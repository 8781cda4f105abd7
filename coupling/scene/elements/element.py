"""The contract of elements, entries of lists of tables: other code asks them these questions, and never for a class."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import Any, ClassVar, NamedTuple, Protocol, Self

import numpy as np

from vanedamp.coupling.scene.contact_laws.law import Element


class Unit(NamedTuple):
    """A unit, with the meaning of the fields of system.system.System; normal, slip: rows (N,) of the N coordinates.

    A contact has a normal row, whose displacement and `rest` are its gap, and may have a slip row with a coefficient of
    friction; a friction element has a slip row and a constant limit. body: number of the body that it moves, or of its
    own entry where it moves none; play: 0 of an element for its gap at rest or how far it moves, the larger; side: name
    of what it meets, which assembly sets to the name of an element's table; closing: constant load across, N, which its
    force balances at rest; tangential: stiffness of a spring between the slip and a slider without mass, which slips in
    its place, N/m; inf: none.
    """

    normal: np.ndarray
    slip: np.ndarray
    rest: float = 0.0
    friction: float = 0.0
    element: Element = Element(0.0)
    play: float = np.inf
    body: int = -1
    side: str = "casing"
    corner: int = -1
    limit: float = 0.0
    other: int = -1
    closing: float = 0.0
    tangential: float = np.inf


class Parts(Protocol):
    """What an element makes its rows (N,) of."""

    @property
    def speed(self) -> float:
        """Speed of rotation, rad/s."""

    def motion(self, label: str | None, key: str) -> np.ndarray:
        """Return the displacement of an interface label, which the scene names under `key`.

        None: that of the response. Raises InputError for an unknown label.
        """

    def slip(self, body: int) -> np.ndarray:
        """Return the displacement of a body along its cavity, relative to it, from the middle."""

    def contact(self, normal: np.ndarray, restitution: float, *labels: str | None) -> Element:
        """Return the scene's contact of a normal row, between points of the structure: how it rebounds or yields."""

    def flexibility(self, shares: Mapping[str, float]) -> float:
        """Return what the modes lack of the static flexibility of a weighted sum of interface labels, m/N."""

    def travel(self, normal: np.ndarray) -> float:
        """Return how far a row of the structure moves under the static loads and the initial motion, m."""


class SceneElement:
    """Base of the elements: a frozen record, an entry of the list of tables that its registered name heads.

    Its fields are the table's keys, `units` its contacts and friction elements.
    """

    #: sectors of a ring that have one; None: as written. A key of elements that can be repeated
    sectors: Any = None
    #: whether it acts on the structure only
    on_structure: ClassVar[bool] = False
    #: whether its contacts are springs, not constraints
    yields: ClassVar[bool] = False
    #: whether it has friction, which only the engine for the plane and methods for it take from an element
    rubs: ClassVar[bool] = False

    @property
    def sliders(self) -> int:
        """Number of its units that have a spring along (Unit.tangential)."""
        return 0

    def labels(self) -> Mapping[str, str | None]:
        """Return the interface labels that it names, by their keys."""
        return {}

    def relabelled(self, label: Callable[[str, str], str]) -> Self:
        """Return it with other labels, by key and label."""
        given = {key: label(key, one) for key, one in self.labels().items() if one is not None}
        return replace(self, **given)  # type: ignore[type-var]

    def check(self, scene: Any) -> None:
        """Raise ValueError, whose message begins with the key, for a scene that it does not fit."""

    def units(self, number: int, parts: Parts) -> Iterator[Unit]:
        """Yield its units; number: of the entry in its list."""
        raise NotImplementedError(f"{type(self).__qualname__} has no units")
