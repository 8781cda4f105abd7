"""Quantities of motions that studies evaluate, as named in their files."""

from __future__ import annotations

import math
from itertools import zip_longest
from typing import Any, NamedTuple

import numpy as np

from vanedamp.coupling.quantities.amplitude import (
    amplitude_max,
    amplitude_max_dynamic,
    amplitude_mean,
    amplitude_mean_dynamic,
)
from vanedamp.coupling.quantities.quantity import Quantity, labels, labels_along, table
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.sweep.row import Row
from vanedamp.coupling.system.reduced_model_file import hot_spots_in_file
from vanedamp.files.toml_input import InputError

#: amplitudes that studies compare with those without bodies, by quantity
AMPLITUDES = {amplitude_mean.name: amplitude_mean_dynamic.name, amplitude_max.name: amplitude_max_dynamic.name}


class Measure(NamedTuple):
    """A quantity of results, or one of its components: "stress_von_mises.root", "wear_depth_rate.0".

    place: indices along its dimensions, as far as given; key: its name in derivatives.
    """

    quantity: Quantity
    place: tuple[int, ...]
    key: str

    @classmethod
    def of_runs(cls, scene: Scene, text: str, where: str, single: bool = False) -> Measure:
        """Return the measure that a text names, for runs of a scene.

        where: key for error messages; single: whether it must be a single number. Raises InputError.
        """
        quantity, (name, *entries), row = known(text, where), text.split("."), Row(scene)
        if name not in row.quantities:
            raise InputError(f"{where}: runs of this scene have no {name}, which is {quantity.about}")
        if len(entries) > len(quantity.dims):
            raise InputError(f"{where}: {text}: {name} has {len(quantity.dims)} dimensions, not {len(entries)}")
        indices, keys, names = list[int](), [name], labels_along([name], hot_spots_in_file(scene.structure))
        for dim, size, entry in zip_longest(quantity.dims, row.shape(quantity), entries):
            named = [*names.get(dim, map(str, range(size)))]
            if entry is None and single:
                raise InputError(f"{where}: {name} is a number for each {dim}; name one, such as '{text}.{named[0]}'")
            if entry is not None and entry not in named:
                raise InputError(f"{where}: no {dim} {entry!r} of {name}; there are {', '.join(named)}")
            if entry is not None:
                indices.append(named.index(entry))
                keys.append(entry if labels(dim) else str(indices[-1]))
        return cls(quantity, tuple(indices), ".".join(keys))

    def value(self, motion: Any) -> float:
        """Return its value in a motion, the largest of several; nan if it is unknown."""
        value = getattr(motion, self.quantity.name)
        return math.nan if value is None else float(np.max(np.asarray(value, float)[self.place]))


def known(text: str, where: str) -> Quantity:
    """Return the quantity of a text, with or without a component. Raises InputError."""
    quantity = table().get(text.split(".")[0])
    if quantity is None or quantity.text:
        there = ", ".join(entry.name for entry in table().values() if not entry.text)
        raise InputError(f"{where}: unknown quantity {text!r}; there are {there}")
    return quantity
