"""The largest value over a period of a sum of sines."""

from __future__ import annotations

import numpy as np

#: samples per period and order: a sum of sines is nowhere larger than its largest sample over cos(pi/16)
_SAMPLES = 16
#: product of the number of sines and their highest order beyond which Newton's method begins near the maximum only
_FEW = 1024
#: fraction of the largest sample above which a sample is near the maximum: cos(pi/16) and less
_TOP = 0.98
#: numbers in a batch of sampled sums
_BATCH = 1 << 22


def peaks(waves: np.ndarray, order: np.ndarray) -> np.ndarray:
    """Return the largest |Re sum_h waves_h exp(i order_h angle)| (f,) over all angles.

    waves: (e, f) complex; order: (e,) whole numbers above 0. To round-off, by Newton's method.
    """
    count, sums = _SAMPLES * int(order.max()), waves.shape[1]
    if len(order) * order.max() <= _FEW:
        every = (2 * np.pi / count) * np.arange(count)
        return _climb(waves, order, np.broadcast_to(every[:, None], (count, sums)))
    highest = np.zeros(sums)
    for some in np.array_split(np.arange(sums), 1 + sums * count // _BATCH):
        spectrum = np.zeros((count, len(some)), complex)
        spectrum[order] = waves[:, some]
        sampled = np.abs(np.fft.ifft(spectrum, axis=0, norm="forward").real)
        instant, column = np.nonzero(sampled >= _TOP * sampled.max(axis=0))
        tops = _climb(waves[:, some[column]], order, (2 * np.pi / count) * instant[None])
        np.maximum.at(highest, some[column], tops)
    return highest


def _climb(waves: np.ndarray, order: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Return the largest value (f,) that Newton's method meets from angles (k, f) within a sample of the maxima."""
    step = np.pi / (_SAMPLES / 2 * order.max())
    highest = np.zeros(waves.shape[1])
    for _ in range(6):
        turning = waves * np.exp(1j * np.multiply.outer(angle, order)).swapaxes(1, 2)
        value, slope, bend = ((turning * (1j * order[:, None]) ** p).sum(axis=1).real for p in range(3))
        highest = np.maximum(highest, np.abs(value).max(axis=0))
        # towards a maximum of |x|, no further than the neighbours
        move = np.divide(-slope, bend, out=np.copysign(step, value * slope), where=value * bend < 0)
        angle = angle + np.clip(move, -step, step)
    return highest
