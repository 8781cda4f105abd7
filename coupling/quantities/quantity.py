"""Quantities, and the table of all of them."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from vanedamp.files.extensions import ExtensionPoint

FAMILIES = ExtensionPoint(
    "family of quantities", "vanedamp.coupling.quantities", "vanedamp.quantities", ()
)  # fmt: skip


class Quantity(NamedTuple):
    """What a motion has.

    unit: "1" without; dims: names of its own dimensions; about: the sentence; formula: of what it needs; text: whether
    it is a word; spread: whether ensembles tell how it spreads, over hot spots that of the worst; limited: whether its
    largest value along a curve counts, such as of wear; family: the file.
    """

    name: str
    unit: str
    dims: tuple[str, ...]
    about: str
    formula: Callable[..., Any]
    text: bool = False
    spread: bool = False
    limited: bool = False
    family: str = ""

    @property
    def needs(self) -> tuple[str, ...]:
        """Names of what the formula takes."""
        return _arguments(self.formula)

    @property
    def dtype(self) -> type:
        """Type of its arrays."""
        return object if self.text else float

    def __reduce__(self) -> tuple[Any, ...]:
        """Go to other processes by name: its function is none of a module."""
        return _of_table, (self.name,)

    def exists(self, sources: Iterable[str]) -> bool:
        """Whether all that it needs is among some names."""
        return set(self.needs).issubset(sources)

    def lacking(self, reasons: Mapping[str, str]) -> str | None:
        """Return why a kind of result does not have it; None: it has. reasons: by name, what it needs, or dimension."""
        return next((reasons[name] for name in (self.name, *self.needs, *self.dims) if name in reasons), None)

    def of(self, sources: Mapping[str, Any]) -> Any:
        """Return its value; None where something that it needs is None."""
        given = {name: sources[name] for name in self.needs}
        return None if any(value is None for value in given.values()) else self.formula(**given)


@cache
def _arguments(formula: Callable[..., Any]) -> tuple[str, ...]:
    return tuple(inspect.signature(formula).parameters)


def quantity(
    unit: str = "1", dims: tuple[str, ...] = (), text: bool = False, spread: bool = False, limited: bool = False
) -> Callable[[Callable[..., Any]], Quantity]:  # fmt: skip
    """Make a function the quantity of its name; arguments as in Quantity."""

    def made(formula: Callable[..., Any]) -> Quantity:
        about = " ".join((formula.__doc__ or "").split())
        return Quantity(formula.__name__, unit, dims, about, formula, text, spread, limited)

    return made


@cache
def table() -> Mapping[str, Quantity]:
    """Return all quantities by name, family by family."""
    quantities: dict[str, Quantity] = {}
    for name, module in FAMILIES.all().items():
        for one in declared_in(module):
            if one.name in quantities:
                raise ValueError(f"{module.__name__}: there is a quantity {one.name} in {quantities[one.name].family}")
            quantities[one.name] = one._replace(family=name)
    return quantities


def _of_table(name: str) -> Quantity:
    return table()[name]


def declared_in(module: Any) -> Iterator[Quantity]:
    """Yield the quantities of a module, and those in its lists."""
    for value in vars(module).values():
        if isinstance(value, Quantity):
            yield value
        elif isinstance(value, list):
            yield from (one for one in value if isinstance(one, Quantity))


def family(name: str) -> list[Quantity]:
    """Return the quantities of a family."""
    return [one for one in table().values() if one.family == name]


class Later(Mapping[str, Any]):
    """Values by name, each made when it is first read; known: those that need not be made."""

    def __init__(self, names: Iterable[str], make: Callable[[str], Any], known: Mapping[str, Any] = {}) -> None:
        self._names, self._make, self._made = dict.fromkeys((*known, *names)), make, dict(known)

    def __getitem__(self, name: str) -> Any:
        if name not in self._made and name in self._names:
            self._made[name] = self._make(name)
            if len(self._made) == len(self._names):
                del self._make  # and what it holds
        return self._made[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)

    def __reduce__(self) -> tuple[Any, ...]:
        return dict, (dict(self),)


def evaluated(sources: Mapping[str, Any], convert: Callable[[Any], Any] = lambda value: value) -> Mapping[str, Any]:
    """Return all quantities that some sources have, as `convert` of them."""

    def value(name: str) -> Any:
        with np.errstate(all="ignore"):
            return convert(table()[name].of(sources))

    return Later((one.name for one in possible(frozenset(sources))), value)


@cache
def possible(sources: frozenset[str]) -> tuple[Quantity, ...]:
    """Return the quantities that some sources, by name, have."""
    return tuple(one for one in table().values() if one.exists(sources))


@cache
def labels(dim: str) -> tuple[str, ...]:
    """Return the names along a dimension that are the same for all scenes; empty for other dimensions."""
    return next((module.LABELS[dim] for module in FAMILIES.all().values() if dim in getattr(module, "LABELS", {})), ())


def labels_along(names: Iterable[str], hot_spots: Iterable[str] = ()) -> dict[str, tuple[str, ...]]:
    """Return the names along the dimensions of some quantities, where there are any; hot_spots: their names."""
    dims = dict.fromkeys(dim for name in names for dim in table()[name].dims)
    known = {dim: tuple(hot_spots) if dim == "hot_spot" else labels(dim) for dim in dims}
    return {dim: named for dim, named in known.items() if named}


class QuantityRecord:
    """Base of records with `quantities`: an attribute each, None where there is none; each family as a mapping."""

    quantities: Mapping[str, Any]

    def __getattr__(self, name: str) -> Any:
        if not name.startswith("_") and name != "quantities":
            if name in self.quantities:
                return self.quantities[name]
            if any(one.family == name for one in table().values()):
                return {one.name: self.quantities[one.name] for one in family(name) if one.name in self.quantities}
            if name in table():
                return None
        raise AttributeError(f"{type(self).__name__} has no {name}", name=name, obj=self)

    def __dir__(self) -> Iterable[str]:
        return [*super().__dir__(), *self.quantities]
