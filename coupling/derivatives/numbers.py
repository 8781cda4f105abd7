"""What the numbers of a scene do to its equations: derivatives of all that flows, events and impacts are made of.

They are differences of whole assemblies (derivatives.differences), so that every number has them that a sweep axis can
name; what follows from them along a motion is exact.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from vanedamp.coupling.derivatives.differences import NotSmooth, derivative
from vanedamp.coupling.derivatives.dynamics import Dynamics
from vanedamp.coupling.derivatives.frame import Frame
from vanedamp.coupling.derivatives.matrix_direction import MatrixDirection
from vanedamp.coupling.scene.rotation import FREQUENCY
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.units import unit_of
from vanedamp.coupling.system.restitution import restitutions_at
from vanedamp.coupling.system.system import System
from vanedamp.files.toml_input import InputError

#: tables whose numbers do not enter the equations of motion
_NO_NUMBERS = ("time", "solver", "continuation", "sweep", "orbit", "ramp", "ring_down")

#: speeds at which laws of restitution are compared, m/s
_SPEEDS = (1e-4, 1e-2, 1.0)
#: state (k,) with which the motion of a scene with the numbers begins, in a frame
StartOf = Callable[[Scene, Frame], np.ndarray]


class Parts(NamedTuple):
    """What the equations are made of, in the scales of Dynamics: N coordinates, u units, j sliders, k states.

    follows, bound: (j, 2N) and (j,), u of a slider that slips is follows u - way bound (places only); others as in
    System and Dynamics. Of derivatives by P numbers, every array has an axis (P,) before these.
    """

    root: np.ndarray  # (N,)
    rows: np.ndarray  # (2u, N)
    gap: np.ndarray  # (u, K)
    speed: np.ndarray  # (2u, K)
    load: np.ndarray  # (N, K)
    turn: np.ndarray  # (K, K)
    to_state: np.ndarray  # (k, 2N)
    from_state: np.ndarray  # (2N, k)
    follows: np.ndarray  # (j, 2N)
    bound: np.ndarray  # (j,)
    pulled: np.ndarray  # (j, N)
    response: np.ndarray  # (K,)
    outputs: np.ndarray  # (o, K)
    tilts: np.ndarray  # (t, K)
    mass: np.ndarray  # (N,)
    J: np.ndarray  # (2u, N)
    friction: np.ndarray  # (u,)
    limit: np.ndarray  # (u,)
    restitution: np.ndarray  # (u,)
    spring: np.ndarray  # (u,)
    dashpot: np.ndarray  # (u,)
    tangential: np.ndarray  # (j,)
    frequency: np.ndarray  # (e,)
    period: np.ndarray  # ()
    start: np.ndarray  # (k,)

    @classmethod
    def of(cls, dynamics: Dynamics, start: np.ndarray) -> Parts:
        """Return the parts of a scene's dynamics."""
        system = dynamics.system
        own = {"spring": np.where(np.isfinite(system.spring), system.spring, 0.0), "period": np.array(system.period)}
        known = system._asdict() | vars(dynamics) | own | {"start": start}
        return cls(*(known[name] for name in cls._fields))

    def flat(self) -> np.ndarray:
        """Return all in one array."""
        return np.concatenate([np.ravel(part) for part in self])

    def like(self, flat: np.ndarray) -> Parts:
        """Return parts of the same shapes from arrays (P, n) that `flat` has made."""
        sizes = np.cumsum([part.size for part in self])[:-1]
        pieces = np.split(flat, sizes, axis=-1)
        shaped = (piece.reshape(*flat.shape[:-1], *part.shape) for piece, part in zip(pieces, self, strict=True))
        return Parts(*shaped)


@dataclass(frozen=True, eq=False)
class Numbers:
    """Numbers of a scene, P of them: their derivatives are by `size` (P,) of each.

    parts: derivatives of the parts of the equations, times the sizes; paths (P,); frequency: (e,) of the harmonics,
    rad/s; scenes: (P,) how the scene that moves follows from each number; values: (P,) of these.
    """

    paths: tuple[str, ...]
    size: np.ndarray
    parts: Parts
    frequency: np.ndarray
    scenes: Sequence[Callable[[float], Scene]]
    values: Sequence[float]
    #: derivatives of the flows that a motion has met (derivatives.flow_derivative)
    flows: dict[Any, Any] = field(default_factory=dict, repr=False)

    def __len__(self) -> int:
        return len(self.paths)

    def of_scene(self, read: Callable[[Scene], np.ndarray], here: np.ndarray) -> np.ndarray:
        """Return the derivatives (n, P) of what the scene says besides its equations: `here` (n,); nan at kinks."""
        scale, found = np.where(here == 0.0, 1.0, np.abs(here)), np.full((len(self), len(here)), np.nan)
        for row, scene, value, size in zip(found, self.scenes, self.values, self.size.tolist(), strict=True):

            def scaled(number: float, scene: Callable[[float], Scene] = scene) -> np.ndarray:
                return read(scene(number)) / scale

            with suppress(NotSmooth):
                row[:] = derivative(scaled, value, size, here / scale)
        return (found * scale * self.size[:, None]).T

    def harmonics(self, dynamics: Dynamics, time: float) -> np.ndarray:
        """Return the derivatives (P, K) of constants and harmonics in z at a time since the passage's start, s."""
        e, one = len(self.frequency), dynamics.one
        found = np.zeros((len(self), one + 1 + 2 * e))
        angle = self.frequency * time
        found[:, one + 1 : one + 1 + e] = -dynamics.size * np.sin(angle) * time * self.parts.frequency
        found[:, one + 1 + e :] = dynamics.size * np.cos(angle) * time * self.parts.frequency
        return found


def numbers_of(
    scene: Scene, paths: Sequence[str | MatrixDirection], dynamics: Dynamics, speed: float | None,
    begins: StartOf | None = None, derived: Callable[[Scene], Scene] = lambda scene: scene,
) -> Numbers:  # fmt: skip
    """Return the derivatives of a scene's equations by the numbers at some paths.

    speed: of rotation whose modes those of states are (Frame); begins: the start of the motion, if numbers change it;
    derived: the scene that moves, from the one that has the numbers. Raises InputError for a path that names no number
    of the equations, and NotSmooth where the equations have a kink.
    """
    start = begins or (lambda _, frame: np.zeros(len(frame.to_state)))
    parts = Parts.of(dynamics, start(scene, dynamics.frame))
    here, sizes, found = parts.flat(), [], []
    values, scenes = list[float](), list[Callable[[float], Scene]]()
    scale = _scales(parts, dynamics)
    for path in paths:
        if isinstance(path, MatrixDirection):
            name, value, size = path.name, 0.0, path.size(scene)
        else:
            name, value = path, number_of_motion(scene, path, "numbers")
            size = abs(value) or _size(path, dynamics)

        def at(number: float, path: str | MatrixDirection = path) -> Scene:
            return path.at(scene, number) if isinstance(path, MatrixDirection) else scene.replace({path: number})

        def moving(number: float, at: Callable[[float], Scene] = at) -> Scene:
            return derived(at(number))

        def moved(number: float, at: Callable[[float], Scene] = at) -> np.ndarray:
            other = at(number)
            frame = Frame(derived(other), speed, dynamics.frame)
            made = Dynamics(frame, dynamics.scale, dynamics)
            flat = Parts.of(made, start(other, frame)).flat()
            if len(flat) != len(here) or made.system.J.shape != dynamics.system.J.shape:
                raise NotSmooth
            if not _same_law(made.system, dynamics.system):
                raise NotSmooth
            return flat / scale

        sizes.append(size)
        values.append(value)
        scenes.append(moving)
        try:
            found.append(derivative(moved, value, size, here / scale) * scale * size)
        except NotSmooth:
            raise NotSmooth(f"{name} = {value:g}: the equations of motion have a kink there") from None
    stacked = np.reshape(found, (len(paths), len(here)))
    names = tuple(path if isinstance(path, str) else path.name for path in paths)
    return Numbers(names, np.array(sizes), parts.like(stacked), dynamics.system.frequency, scenes, values)


def number_of_motion(scene: Scene, path: str, key: str, others: Sequence[str] = ()) -> float:
    """Return a number of a scene that enters its motion. Raises InputError for another one.

    key: that names it; others: tables whose numbers do not count either.
    """
    if path.split(".")[0] in (*_NO_NUMBERS, *others):
        raise InputError(f"{key}: {path} is no number of the motion's equations; take one such as {FREQUENCY}")
    try:
        return scene.number(path)
    except InputError as error:
        raise InputError(f"{key}: {str(error).removeprefix('scene: ')}") from None


def _same_law(one: System, other: System) -> bool:
    """Return whether two systems take restitutions from coefficients alike: what else changes a law is not followed."""
    if not (one.restitution_at or other.restitution_at):
        return True
    units = np.flatnonzero(np.isinf(other.spring))[:1]
    alike = one._replace(restitution=other.restitution)
    own, others = ([restitutions_at(each, units, np.full(len(units), v)) for v in _SPEEDS] for each in (alike, other))
    return bool(np.array_equal(own, others))


def _scales(parts: Parts, dynamics: Dynamics) -> np.ndarray:
    """Return the size of each entry (n,): the largest of its array, by which its round-off is judged."""
    sizes = [np.full(np.size(part), float(np.abs(part).max(initial=0.0)) or 1.0) for part in parts]
    return np.concatenate([*sizes[:-1], np.maximum(np.abs(parts.start), dynamics.scale)])


def _size(path: str, dynamics: Dynamics) -> float:
    """Return over how much a number changes the motion that is zero in the scene."""
    system = dynamics.system
    play = system.play[np.isfinite(system.play) & (system.play > 0.0)]
    length = float(play.max(initial=0.0)) or float(dynamics.scale.max(initial=0.0)) or 1.0
    sizes = {"m": length, "m/s": system.omega * length, "deg": 1.0, "rad/s": system.omega}
    return sizes.get(unit_of(path), 1e-2 if unit_of(path) == "1" else 1.0)
