"""What takes the modal coordinates of a run as it advances: samples that are dropped as soon as they are taken.

Samples are many: a period takes some 100 of every mode. They are taken in the evaluated periods only, where these are
known before, and their memory is given back.
"""

from __future__ import annotations

import mmap
from abc import abstractmethod

import numpy as np

from vanedamp.coupling.engine.run import EventDrivenRun
from vanedamp.coupling.response.evaluation import Needs, Observer, Run
from vanedamp.coupling.response.records import Records
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.system.system import System

#: fields of the records with a row for every sample
_SAMPLED = ("samples", "coordinates", "sampled", "shut")
#: samples that are evaluated together, in whole periods
_TOGETHER = 20_000


class ModalObserver(Observer):
    """Takes the samples of every period as a run advances; asked: of each period, how many others keep."""

    def __init__(self, asked: int) -> None:
        self.asked, self.each = asked, 0
        self._rooms: list[tuple[np.ndarray, mmap.mmap]] = []
        self._whole: Records | None = None
        self._taken, self._sampling, self._first = 0, True, -1

    @abstractmethod
    def samples(self, scene: Scene, system: System) -> int:
        """Return how many samples of each period are needed, a multiple of those asked for."""

    @abstractmethod
    def take(self, begin: int, coordinates: np.ndarray) -> None:
        """Take p periods from number `begin` on: coordinates (p each + 2, n), with a sample more at both ends."""

    def needs(self, scene: Scene, system: System) -> Needs:
        """Return the samples."""
        self.each = self.samples(scene, system)
        return Needs(samples=self.each)

    def records(self, empty: Records) -> Records:
        """Return the records with samples whose memory can be given back."""
        self._whole = empty._replace(**{name: self._room(getattr(empty, name)) for name in _SAMPLED})
        return self._whole

    def look(self, run: Run, dropped: int | None) -> None:
        """Take the periods done since the last call, and sample what follows if it may be evaluated."""
        self.take_up_to(run.outcome().periods)
        assert self._whole is not None
        if isinstance(run, EventDrivenRun) and not self.asked:
            self._sampling = dropped is None or self._taken >= dropped
            none = {name: getattr(self._whole, name)[:0] for name in _SAMPLED}
            run.records = self._whole if self._sampling else self._whole._replace(**none)
        self._whole.coordinates[self._taken * self.each :][:1] = np.nan  # remains if a method keeps none

    def take_up_to(self, done: int) -> None:
        """Take the periods up to `done`, and give their samples back."""
        begin, self._taken = self._taken, done
        if not self._sampling or done <= begin or self._whole is None:
            return
        q, together = self._whole.coordinates, max(_TOGETHER // self.each, 1)
        if np.isnan(q[begin * self.each]).any():
            return
        for first in range(begin, done, together):
            self._hand_over(q, first, min(first + together, done))

    def _hand_over(self, q: np.ndarray, begin: int, done: int) -> None:
        """Hand some periods of the samples (n, modes) of the run to what takes them, and give these back."""
        rows = slice(begin * self.each, done * self.each)
        self._first = rows.start if self._first < 0 else self._first
        # the first sample has none before it where the periods before were not sampled
        before = q[max(rows.start - 1, self._first)]
        padded = np.concatenate([before[None], q[rows], q[rows][-1:]])
        self.take(begin, padded)
        if not self.asked:
            for array, room in self._rooms:
                _give_back(room, array.strides[0], rows.start - 1, rows.stop - 1)

    def _room(self, like: np.ndarray) -> np.ndarray:
        """Return an array of zeros like another, in memory of its own."""
        if not like.nbytes:
            return like
        room = mmap.mmap(-1, like.nbytes, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
        array = np.frombuffer(room, like.dtype).reshape(like.shape)
        self._rooms.append((array, room))
        return array


def _give_back(room: mmap.mmap, row: int, first: int, last: int) -> None:
    """Give rows of so many bytes back to the system, from the first one up to the last, without pages of others."""
    begin = -(-max(first, 0) * row // mmap.PAGESIZE) * mmap.PAGESIZE
    end = last * row // mmap.PAGESIZE * mmap.PAGESIZE
    if end > begin and hasattr(mmap, "MADV_DONTNEED"):
        room.madvise(mmap.MADV_DONTNEED, begin, end - begin)
