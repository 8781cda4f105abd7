"""What designs, and their tolerances, change in a scene."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from vanedamp.coupling.scene.paths import assign, places
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.units import limits_of
from vanedamp.files.toml_input import InputError


class Width(NamedTuple):
    """A tolerance: path and half width of a number, in its unit or relative to it."""

    path: str
    half: float
    relative: bool

    def moved(self, value: float, deviation: float) -> float:
        """Return a number that is off by a deviation, within what its key takes."""
        low, high = limits_of(self.path)
        return min(max(value * (1 + deviation) if self.relative else value + deviation, low), high)


class Changes:
    """Values by paths, the same paths for all designs of a scene's bodies.

    A path that several names share in part is taken apart into those of its single numbers, as is one that a tolerance
    moves from different values. of: paths by the name of a variable or a tolerance.
    """

    def __init__(
        self, scene: Scene, variables: Mapping[str, str], widths: Mapping[str, Width], missing: Mapping[str, float]
    ) -> None:
        """Take the paths of variables by name, tolerances, and numbers that the scene has by default."""
        self._widths, data = widths, scene.to_dict()
        for path, value in missing.items():
            assign(data, path, value)
        paths = {**variables, **{name: width.path for name, width in widths.items()}}
        numbers = {name: tuple(places(data, path)) for name, path in paths.items()}
        known, chosen = dict[tuple[str, ...], tuple[str, ...]](), set[str]()
        self.of: dict[str, tuple[str, ...]] = {}
        self._given: dict[str, float] = {}
        for name, own in numbers.items():
            apart = any(set(own) & set(other) and set(own) != set(other) for other in numbers.values())
            if name not in variables and own not in known:
                try:
                    scene.number(paths[name], data)
                except InputError:  # several numbers
                    apart = True
            self.of[name] = known.setdefault(own, own if apart else (paths[name],))
            if name in variables:
                chosen |= {*self.of[name]}
            else:
                self._given |= {path: scene.number(path, data) for path in self.of[name] if path not in chosen}

    def values(self, numbers: Mapping[str, float], deviation: Mapping[str, float]) -> dict[str, float]:
        """Return the values of a design, numbers of the scene by variable, that is off by a deviation."""
        found = {path: value for name, value in numbers.items() for path in self.of[name]}
        for name, width in self._widths.items():
            for path in self.of[name]:
                value = found[path] if path in found else self._given[path]
                found[path] = width.moved(value, deviation.get(name, 0.0))
        return found
