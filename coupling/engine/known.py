"""The linear subsystems that runs with a structure have met: what no frequency of the excitation changes in a flow.

Each is found once, by numpy, in the subsystems of an engine (line.subsystems, plane.subsystems), and kept for all runs
with that structure; its exact flow at a frequency is filled in compiled code (line.flow_assembly, plane.flow_assembly).
"""

from __future__ import annotations

import itertools
import threading
from collections import OrderedDict
from collections.abc import Callable, Iterable, Mapping
from types import MappingProxyType
from typing import Any

import numpy as np

from vanedamp.coupling.numerics.codes import DONE, ILL_CONDITIONED, NEEDS_FLOW
from vanedamp.coupling.numerics.compiler.jit import kernel

#: bytes that the subsystems of one run may take
ROOM = 2**29
_NUMBERS = itertools.count(1)
#: structures whose subsystems are kept
_KEPT = 8


class IllConditioned(ArithmeticError):
    """Doubles cannot separate the modes of a subsystem, or have lost too many digits in them."""


def with_free_place(
    stack: Any, filled: np.ndarray, used: np.ndarray, values: Mapping[str, Any] = MappingProxyType({})
) -> tuple[Any, int]:
    """Return a stack of arrays with a free index, and this index: the first one that is not filled (s,).

    A full stack is replaced by one of twice its size, at most of ROOM, and by a wider one for larger `values`. Zeros
    take no memory. Many bodies close in more combinations than memory holds: a stack of ROOM gives away, as it is, the
    least recently used index, by times (s,) of use.
    """
    size, free = len(filled), np.flatnonzero(filled == 0)
    most = size if len(free) else max(size, min(2 * size, ROOM // sum(array[:1].nbytes for array in stack)))
    larger = {}
    for name, old in zip(stack._fields, stack, strict=True):
        shape = most, *map(max, old.shape[1:], np.shape(values.get(name, old[0])))
        if shape != old.shape:
            larger[name] = np.zeros(shape, old.dtype)
            larger[name][tuple(map(slice, old.shape))] = old
    return stack._replace(**larger), int(free[0] if len(free) else size if most > size else np.argmin(used))


def places(empty: Callable[[int], Any], room: int) -> int:
    """Return how many entries of `empty(size)` so many bytes hold; zeros take no memory."""
    return max(4, room // sum(array.nbytes for array in empty(1)))


class Known:
    """The subsystems met of late, of a system and of those that differ in the excitation.

    stack: storage for some; of: returns their fields by name, from a system and its key; same: tells which entries have
    a key in a system.
    """

    def __init__(
        self, stack: Any, of: Callable[[Any, np.ndarray], dict[str, Any]],
        same: Callable[[Any, Any, np.ndarray], np.ndarray],
    ) -> None:  # fmt: skip
        self.stack, self._of, self._same = stack, of, same

    def __bool__(self) -> bool:
        return bool(self.stack.number.any())

    def place(self, system: Any, key: np.ndarray) -> int:
        """Return the index of the subsystem of a key, closed rows or states, computed if new.

        Raises IllConditioned for one that doubles cannot resolve.
        """
        matches = np.flatnonzero((self.stack.number > 0) & self._same(self.stack, system, key))
        if len(matches):
            return int(matches[0])
        numbers, values = self.stack.number, self._of(system, key)
        self.stack, k = with_free_place(self.stack, numbers, numbers, values)
        for name, value in values.items():
            getattr(self.stack, name)[(k, *map(slice, np.shape(value)))] = value
        self.stack.number[k] = next(_NUMBERS)
        return k


class _Structures(threading.local):
    """The latest structures of a thread, and the subsystems that its runs have met."""

    def __init__(self) -> None:
        self.known: OrderedDict[tuple[Any, ...], Known] = OrderedDict()


_STRUCTURES = _Structures()


def known_of(system: Any, deciding: Iterable[str], make: Callable[[Any], Known]) -> Known:
    """Return the subsystems of a system's structure: those that any run with it has met in this thread.

    deciding: names of the parts of the system that decide its subsystems.
    """
    key, store = (make, *(np.asarray(getattr(system, name)).tobytes() for name in deciding)), _STRUCTURES.known
    store[key] = store.pop(key) if key in store else make(system)
    while len(store) > _KEPT:
        store.popitem(last=False)
    return store[key]


@kernel
def add_known(same, fill, system, subsystems, key, flows, scratch):
    """Fill the flow of a key, closed rows or states, at its index, old or new.

    same: whether a subsystem is the key's; fill: sets a flow. Returns DONE, ILL_CONDITIONED where doubles do not
    resolve it, NEEDS_FLOW for a new subsystem, or no index.
    """
    for k in range(len(subsystems.number)):
        if not (subsystems.number[k] > 0 and same(system, subsystems, k, key)):
            continue
        free = -1
        for s in range(len(flows.subsystem)):
            if flows.subsystem[s] == subsystems.number[k]:
                free = s
                break
            if flows.subsystem[s] == 0 and free < 0:
                free = s
        if free < 0:
            return NEEDS_FLOW
        return DONE if fill(system, subsystems, k, flows, free, scratch) else ILL_CONDITIONED
    return NEEDS_FLOW


def with_place(flows: Any, known: Known, k: int) -> Any:
    """Return flows with an index for subsystem k, which compiled code fills: its own, a free one, or the oldest."""
    if not np.any(flows.subsystem == known.stack.number[k]):
        flows, s = with_free_place(flows, flows.subsystem, flows.used)
        flows.subsystem[s] = flows.modes[s] = 0
    return flows
