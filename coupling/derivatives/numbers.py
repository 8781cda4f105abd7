"""Derivatives by the numbers of a scene of all that flows, events and impacts are made of.

They are exact: the scene is assembled once with numbers that have derivatives (tangents.dual). Contact laws, shapes and
reduced models with changing modes have their own differences (tangents.opaque).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from vanedamp.coupling.derivatives.dynamics import ScaledDynamics
from vanedamp.coupling.derivatives.frame import Frame
from vanedamp.coupling.derivatives.matrix_direction import MatrixDirection
from vanedamp.coupling.scene.paths import with_numbers
from vanedamp.coupling.scene.rotation import FREQUENCY
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.structures import Rom
from vanedamp.coupling.scene.units import unit_of
from vanedamp.coupling.tangents.differences import NotSmooth
from vanedamp.coupling.tangents.dual import Dual, numbers, zeros
from vanedamp.coupling.tangents.opaque import changed, opaque
from vanedamp.files.toml_input import InputError

#: tables whose numbers do not enter the equations of motion
_NO_NUMBERS = ("time", "solver", "continuation", "sweep", "orbit", "ramp", "ring_down")

#: state (k,) with which the motion of a scene with the numbers begins, in a frame
StartOf = Callable[[Scene, Frame], np.ndarray]


class EquationArrays(NamedTuple):
    """Arrays of the equations, in the scales of ScaledDynamics: N coordinates, u units, j sliders, k states.

    follows, bound, ease: of sliders that slip, as in ScaledDynamics (bound: of places only); others as in System and
    ScaledDynamics. Of derivatives by P numbers, every array has an axis (P,) before these.
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
    ease: np.ndarray  # (j,)
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
    def of(cls, dynamics: ScaledDynamics, start: np.ndarray) -> EquationArrays:
        """Return the parts of a scene's dynamics."""
        system = dynamics.system
        arrays = {"spring": np.where(np.isfinite(system.spring), system.spring, 0.0), "period": system.period}
        known = system._asdict() | vars(dynamics) | arrays | {"start": start}
        return cls(*(known[name] for name in cls._fields))


@dataclass(frozen=True, eq=False)
class Parameters:
    """Numbers of a scene, P of them: their derivatives are by `size` (P,) of each.

    parts: derivatives of the parts of the equations, times the sizes; paths (P,); frequency: (e,) of the harmonics,
    rad/s; scene: the one that moves, with numbers that have derivatives.
    """

    paths: tuple[str, ...]
    size: np.ndarray
    parts: EquationArrays
    frequency: np.ndarray
    scene: Scene
    #: derivatives of the flows that a motion has met (derivatives.flow_derivative)
    flows: dict[Any, Any] = field(default_factory=dict, repr=False)
    #: the same as compiled functions take them (derivatives.equations)
    tables: dict[Any, Any] = field(default_factory=dict, repr=False)

    def __len__(self) -> int:
        return len(self.paths)

    def of_scene(self, read: Callable[[Scene], np.ndarray], here: np.ndarray) -> np.ndarray:
        """Return derivatives (n, P) of other data of the scene: `here` (n,); nan at kinks."""
        with numbers(len(self)):
            result = opaque(read, self.scene, unknown=True)
        return result.turns if isinstance(result, Dual) else np.zeros((len(here), len(self)))

    def harmonics(self, dynamics: ScaledDynamics, time: float) -> np.ndarray:
        """Return the derivatives (P, K) of constants and harmonics in z at a time since the passage's start, s."""
        e, one = len(self.frequency), dynamics.one
        rows = np.zeros((len(self), one + 1 + 2 * e))
        angle = self.frequency * time
        rows[:, one + 1 : one + 1 + e] = -dynamics.size * np.sin(angle) * time * self.parts.frequency
        rows[:, one + 1 + e :] = dynamics.size * np.cos(angle) * time * self.parts.frequency
        return rows


def numbers_of(
    scene: Scene, paths: Sequence[str | MatrixDirection], dynamics: ScaledDynamics,
    begins: StartOf | None = None, derived: Callable[[Scene], Scene] = lambda scene: scene,
) -> Parameters:  # fmt: skip
    """Return the derivatives of a scene's equations by the numbers at some paths.

    begins: the start of the motion, if numbers change it; derived: the scene that moves, from the one that has the
    numbers; both take numbers with derivatives. Raises InputError for a path that names no number of the equations, and
    NotSmooth where the equations have a kink.
    """
    names = tuple(path.name if isinstance(path, MatrixDirection) else path for path in paths)
    turned, moves, sizes = _turned(scene, paths, dynamics, derived)
    with numbers(len(paths)):
        try:
            moving = derived(turned)
            if moves:
                moving = changed(moving, structure=changed(moving.structure, moves=tuple(moves)))
            frame = Frame(moving, dynamics.frame.speed, dynamics.frame.begin)
            start = zeros(len(frame.to_state)) if begins is None else begins(turned, frame)
            made = EquationArrays.of(ScaledDynamics(frame, dynamics.scale, dynamics), start)
        except NotSmooth:
            at = [0.0 if isinstance(path, MatrixDirection) else scene.number(path) for path in paths]
            point = ", ".join(f"{name} = {value:g}" for name, value in zip(names, at, strict=True))
            raise NotSmooth(f"{point}: the equations of motion have a kink there") from None
    parts = EquationArrays(*(_turns(array, len(paths)) for array in made))
    if not all(np.all(np.isfinite(array)) for array in parts):
        raise NotSmooth("the equations of motion have a kink there")
    return Parameters(names, sizes, parts, dynamics.system.frequency, moving)


def _turns(array: Any, count: int) -> np.ndarray:
    """Return the derivatives (P, ...) of an array of the equations."""
    return np.moveaxis(array.turns, -1, 0) if isinstance(array, Dual) else np.zeros((count, *np.shape(array)))


def _turned(
    scene: Scene, paths: Sequence[str | MatrixDirection], dynamics: ScaledDynamics, derived: Callable[[Scene], Scene]
) -> tuple[Scene, list[Any], np.ndarray]:
    """Return a scene whose numbers at some paths turn by their sizes, and these (P,).

    Beside it, what moves its reduced model: structures of the scene that moves, and by how much (modal_basis.moved).
    """
    sizes, moves, given, data = np.zeros(len(paths)), list[Any](), dict[str, Dual](), scene.to_dict()
    for index, path in enumerate(paths):
        direction = np.eye(len(paths))[index]
        if isinstance(path, MatrixDirection):
            sizes[index] = path.size(scene)
            moves.append(
                (
                    lambda amount, path=path: derived(path.at(scene, amount)).structure,
                    Dual(0.0, sizes[index] * direction),
                )
            )
            continue
        value = number_of_motion(scene, path, "numbers", data=data)
        sizes[index] = abs(value) or _size(path, dynamics)
        if path.startswith("structure.") and isinstance(scene.structure, Rom):
            moves.append((
                lambda amount, path=path, value=value: derived(scene.replace({path: value + amount})).structure,
                Dual(0.0, sizes[index] * direction),
            ))  # fmt: skip
        elif path in given:
            given[path].turns[:] += sizes[index] * direction
        else:
            given[path] = Dual(value, sizes[index] * direction)
    return with_numbers(scene, data, given), moves, sizes


def number_of_motion(
    scene: Scene, path: str, key: str, others: Sequence[str] = (), data: dict[str, Any] | None = None
) -> float:
    """Return a number of a scene that enters its motion. Raises InputError for another one.

    key: that names it; others: tables whose numbers do not count either; data: the scene's plain data, where known.
    """
    if path.split(".")[0] in (*_NO_NUMBERS, *others):
        raise InputError(f"{key}: {path} is no number of the motion's equations; take one such as {FREQUENCY}")
    try:
        return scene.number(path, data)
    except InputError as error:
        raise InputError(f"{key}: {str(error).removeprefix('scene: ')}") from None


def _size(path: str, dynamics: ScaledDynamics) -> float:
    """Return over how much a number changes the motion that is zero in the scene."""
    system = dynamics.system
    play = system.play[np.isfinite(system.play) & (system.play > 0.0)]
    length = float(play.max(initial=0.0)) or float(dynamics.scale.max(initial=0.0)) or 1.0
    sizes = {"m": length, "m/s": system.omega * length, "deg": 1.0, "rad/s": system.omega}
    return sizes.get(unit_of(path), 1e-2 if unit_of(path) == "1" else 1.0)
