"""Quantities of motions by which studies count, as their files name them."""

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

#: amplitudes that studies compare with those without bodies, by the quantity that each is
AMPLITUDES = {amplitude_mean.name: amplitude_mean_dynamic.name, amplitude_max.name: amplitude_max_dynamic.name}


class Measure(NamedTuple):
    """A quantity as results have it, or one of several: "stress_von_mises.root", "wear_depth_rate.0".

    quantity: which; place: along its dimensions, as far as these are named; key: its name in derivatives.
    """

    quantity: Quantity
    place: tuple[int, ...]
    key: str

    @classmethod
    def of_runs(cls, scene: Scene, text: str, where: str, single: bool = False) -> Measure:
        """Return what a text names of the runs of a scene.

        where: the key that errors name; single: whether it has to be one number. Raises InputError.
        """
        one, (name, *places), row = known(text, where), text.split("."), Row(scene)
        if name not in row.quantities:
            raise InputError(f"{where}: runs of this scene have no {name}, which is {one.about}")
        if len(places) > len(one.dims):
            raise InputError(f"{where}: {text}: {name} has {len(one.dims)} dimensions, not {len(places)}")
        given, keys, names = list[int](), [name], labels_along([name], hot_spots_in_file(scene.structure))
        for dim, size, place in zip_longest(one.dims, row.shape(one), places):
            own = [*names.get(dim, map(str, range(size)))]
            if place is None and single:
                raise InputError(f"{where}: {name} is a number for each {dim}; name one, such as '{text}.{own[0]}'")
            if place is not None and place not in own:
                raise InputError(f"{where}: no {dim} {place!r} of {name}; there are {', '.join(own)}")
            if place is not None:
                given.append(own.index(place))
                keys.append(place if labels(dim) else str(given[-1]))
        return cls(one, tuple(given), ".".join(keys))

    def value(self, motion: Any) -> float:
        """Return its value in a motion, of several the largest; nan where it is not known."""
        value = getattr(motion, self.quantity.name)
        return math.nan if value is None else float(np.max(np.asarray(value, float)[self.place]))


def known(text: str, where: str) -> Quantity:
    """Return the quantity that a text names, for all of its numbers or one. Raises InputError."""
    found = table().get(text.split(".")[0])
    if found is None or found.text:
        there = ", ".join(one.name for one in table().values() if not one.text)
        raise InputError(f"{where}: unknown quantity {text!r}; there are {there}")
    return found
