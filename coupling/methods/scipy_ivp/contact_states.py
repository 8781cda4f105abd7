"""Which states of the units are possible after an event, by trying them.

States are right if no event function turns negative: of a quantity that is zero now, the first derivative that is not
zero decides. The search repairs one state after the other, and tries all in turn where that goes round in
circles (Glocker and Pfeiffer 1996 solve the same by complementarity).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import combinations, islice, product
from typing import TypeVar

import numpy as np

from vanedamp.coupling.methods.scipy_ivp.motion import LinearMotion, States, Unforced, Wrong
from vanedamp.coupling.numerics.codes import LEAVING, OPEN, SLIP_LEFT, SLIP_RIGHT, STICK
from vanedamp.coupling.system.unit_laws import presses, slip_towards

#: states that may be tried in turn: all of six contacts with friction, the nearest of more
_MOST = 5000

Found = TypeVar("Found")


def search(
    options: Sequence[Sequence[int]], begin: Sequence[int], judge: Callable[[States], tuple[Found, list[Wrong]] | None]
) -> Found | None:
    """Return the result of `judge` for the first states that it accepts; None without.

    options: the states that each unit may have; begin: those to begin with. `judge` returns None where the states are
    impossible.
    """
    at, seen = tuple(begin), set[States]()
    while at not in seen:
        seen.add(at)
        judged = judge(at)
        if judged is None:
            break
        solution, wrong = judged
        if not wrong:
            return solution
        unit, state = wrong[0]
        if state not in options[unit]:
            pressed = presses(state)
            state = next((other for other in options[unit] if presses(other) == pressed), at[unit])
        at = (*at[:unit], state, *at[unit + 1 :])
    for states in islice(_around(options, begin), _MOST):
        if states not in seen:
            judged = judge(states)
            if judged is not None and not judged[1]:
                return judged[0]
    return None


def _around(options: Sequence[Sequence[int]], begin: Sequence[int]) -> Iterator[States]:
    """Yield all states, those first that differ from `begin` in few units."""
    others = [[state for state in choice if state != at] for choice, at in zip(options, begin, strict=True)]
    units = [unit for unit, choice in enumerate(others) if choice]
    for count in range(1, len(units) + 1):
        for changed in combinations(units, count):
            yield from product(*(others[unit] if unit in changed else [at] for unit, at in enumerate(begin)))


def decide(
    free: Unforced, motions: Callable[[States], LinearMotion], now: np.ndarray, sizes: np.ndarray, present: np.ndarray,
    slow: float,
) -> tuple[LinearMotion, np.ndarray] | None:  # fmt: skip
    """Return the motion that begins at an extended state (extent,), and the orders of its event functions' zeros.

    None if no states are possible. Negligible gaps and speeds are zero. motions: the motion of states; sizes:
    (extent,) of the state's terms; present: (u,) states so far; slow: speed below which a slider sticks, m/s.
    """
    gaps, speed = now[free.d], now[free.s]
    options, begin = [], []
    for r in range(free.u):
        slip = speed[free.u + r]
        ways = [STICK, SLIP_RIGHT, SLIP_LEFT] if slip == 0.0 else [slip_towards(slip)]
        if not free.rubs[r]:
            ways = [SLIP_RIGHT]
        if free.sprung[r]:
            ways = free.ways_of_slider(r, now, sizes, slip, slow)
        if free.contact[r]:
            closed = gaps[r] <= 0.0 and (free.soft[r] or speed[r] <= 0.0)
            ways = [*ways, LEAVING if gaps[r] < 0.0 else OPEN] if closed else [OPEN]
        options.append(ways)
        begin.append(int(present[r]) if present[r] in ways else ways[0])

    def judge(states: States) -> tuple[tuple[LinearMotion, np.ndarray], list[Wrong]] | None:
        motion = motions(states)
        if not motion.possible:
            return None
        order, wrong = motion.judge(now, sizes)
        return (motion, order), wrong

    return search(options, begin, judge)
