"""Hot spots of a scene's reduced model: their stresses by modal coordinates, and how densely these are sampled."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.structures import Rom
from vanedamp.coupling.strength.assessment import fatigue_of
from vanedamp.coupling.strength.material import Fatigue
from vanedamp.coupling.system.reduced_model_file import reduced_model
from vanedamp.coupling.system.system import System
from vanedamp.files.toml_input import InputError
from vanedamp.rom.recovery import COMPONENTS, hot_spots

_TINY = float(np.finfo(float).tiny)
#: samples per period of the highest harmonic, and of any motion; impacts take up to so many
OF_HARMONIC, _LEAST, _MOST = 16, 48, 192
#: fraction of the amplitude that samples may miss by estimate (`samples_of`)
_MISSED = 0.01


@dataclass(frozen=True, eq=False)
class Spots:
    """Hot spots of a reduced model with n modes.

    rows: (s, 6, n) stresses, Pa, per modal coordinate; squares: (n,) squared angular frequencies; facts: of each, by
    name (rom.recovery.hot_spots); speed: of rotation, rad/s.
    """

    rows: np.ndarray
    squares: np.ndarray
    facts: dict[str, dict[str, Any]]
    speed: float

    @cached_property
    def size(self) -> np.ndarray:
        """(s, n) a norm of the stress per modal coordinate, Pa."""
        return np.sqrt((self.rows**2).sum(axis=1))

    @cached_property
    def outputs(self) -> tuple[np.ndarray, np.ndarray]:
        """Functionals (k, n) of a course by which stresses are followed, Pa, and stresses (s, 6, k) by these.

        The modes' own stresses, or where there are more modes than components, these.
        """
        rows = self.rows.reshape(-1, len(self.squares))
        if len(rows) < len(self.squares):
            return rows, np.eye(len(rows)).reshape(*self.rows.shape[:2], -1)
        sizes = np.maximum(np.sqrt((rows**2).sum(axis=0)), _TINY)
        return np.diag(sizes), self.rows / sizes

    @cached_property
    def materials(self) -> list[Fatigue | None]:
        """Fatigue data of the spots (s); None for one without a fatigue strength."""
        return [fatigue_of(facts) for facts in self.facts.values()]

    @property
    def have_lives(self) -> bool:
        """Whether every spot has a curve of stress and life."""
        return all(one is not None and one.exponent is not None for one in self.materials)

    def stress(self, coordinates: np.ndarray) -> np.ndarray:
        """Return stresses (s, 6, ...), Pa, of modal coordinates (..., n)."""
        return np.moveaxis(coordinates @ self.rows.reshape(-1, len(self.squares)).T, -1, 0).reshape(
            len(self.rows), 6, *coordinates.shape[:-1]
        )

    def static(self, name: str) -> np.ndarray | None:
        """Return the stress (6,), Pa, of rotation and temperature at a spot; None if a model's file lacks it."""
        causes = self.facts[name].get("static")
        if causes is None or (self.speed and "rotation" not in causes):
            return None
        total = np.zeros(6)
        for cause, values in causes.items():
            total += np.array(values) * (self.speed**2 if cause == "rotation" else 1.0)
        return total


def spots_of(scene: Scene) -> Spots | None:
    """Return the hot spots of a scene without open choices; None for a structure without any."""
    if not isinstance(scene.structure, Rom):
        return None
    model = reduced_model(scene.structure, scene.speed)
    facts = hot_spots(model)
    if not facts:
        return None
    assert model.output_rows is not None
    places = [model.outputs.index(f"{name}.{component}") for name in facts for component in COMPONENTS]
    squares, shapes = model.natural
    rows = (model.output_rows[places] @ shapes).reshape(-1, 6, len(squares))
    return Spots(rows, squares, facts, scene.speed)


def known_spots(scene: Scene) -> Spots:
    """Return the hot spots of a scene without open choices. Raises InputError for a structure without any."""
    spots = spots_of(scene)
    if spots is None:
        raise InputError("structure: no hot spots; take a reduced model with them (vanedamp reduce --hot-spots 3)")
    return spots


def samples_of(scene: Scene, system: System, spots: Spots, asked: int = 0) -> int:
    """Return the number of samples per period from which stresses are taken: a multiple of `asked`.

    An even one if possible, 16 per period of the highest harmonic at least, and so many that what impacts excite is
    missed by 1 % of the amplitude at most, but no more than 192. A mode misses at most its contribution, and
    (h / 2)^2 / 6 of it if its phase advances by h between samples: the mean over positions of its peak. The
    contribution is that of an impact which reverses the velocity of the excited mode at a contact.
    """
    wanted = max(_LEAST, OF_HARMONIC * int(system.order.max(initial=1)))
    share, omega = _impact_shares(system, spots), np.sqrt(np.maximum(spots.squares, 0.0))
    while wanted < _MOST:
        missed = share * np.minimum((omega * system.period / wanted) ** 2 / 24.0, 1.0)
        if missed.sum(axis=-1).max(initial=0.0) <= _MISSED:
            break
        wanted *= 2
    for step in (asked if asked and asked % 2 == 0 else 2 * max(asked, 1), max(asked, 1)):
        fitting = [number for number in range(step, 8 * max(wanted, step), step) if _fits(scene, number)]
        if fitting:
            return next((number for number in fitting if number >= wanted), fitting[-1])
    return asked


def _fits(scene: Scene, samples: int) -> bool:
    try:
        scene.solver.check_samples(samples)
    except InputError:
        return False
    return True


def _impact_shares(system: System, spots: Spots) -> np.ndarray:
    """Return the stress (k, s, n) of modes after an impact of each contact, over that of the mode nearest to order 1.

    That mode moves the contact's places with a velocity, which an elastic impact of the masses in contact reverses. A
    compliant contact takes half a period of these masses on its spring, and hardly excites faster modes.
    """
    omega = np.sqrt(np.maximum(spots.squares, 0.0))
    contacts = np.abs(system.J[: system.contacts, : system.modes])
    if not len(omega) or not contacts.any():
        return np.zeros((0, len(spots.rows), len(omega)))
    excited = int(np.argmin(np.abs(omega - system.omega)))
    masses = 1.0 / np.diag(system.delassus)[: len(contacts)]
    impulse = 2.0 * masses * contacts[:, excited] * omega[excited] / np.maximum(spots.size[:, excited], 1e-300)[:, None]
    slower = 1.0 / (1.0 + np.multiply.outer(masses / system.spring[: len(contacts)], omega**2))
    return impulse.T[:, :, None] * (contacts * slower)[:, None, :] * spots.size / omega
