"""Antiderivatives of energies, harmonics and means in a subsystem, as forms of the amplitudes (engine.energy_forms).

A segment's integral is the form at its end less the form at its start. Where the rate by which a product of two modes
changes vanishes relative to the frequency, the form would cancel: such pairs are left out of the forms, and listed.

`flows`: the stack of subsystems of either engine, whose fields have the same names (line.subsystem_assembly.Flows).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from vanedamp.coupling.numerics.codes import CALM, DIFFERENCE, SINGLE, SUM, WORK_MAP
from vanedamp.coupling.numerics.tolerances import NEARLY_EQUAL, SLOW

#: products (..., m, m) of a form: of the amplitudes of two modes, and of one with the conjugate of the other
Products = tuple[np.ndarray, np.ndarray]


def products(left: np.ndarray, right: np.ndarray) -> Products:
    """Return the products of two signals (..., k, m), summed over k: symmetric, and Hermitian."""
    both, mixed = left.swapaxes(-2, -1) @ right, left.swapaxes(-2, -1) @ right.conj()
    return 0.5 * (both + both.swapaxes(-2, -1)), 0.5 * (mixed + mixed.conj().swapaxes(-2, -1))


def coalesce(rate: np.ndarray, vectors: np.ndarray, inverse: np.ndarray) -> bool:
    """Return whether some modes nearly coalesce, by the condition of each eigenvalue (m,), lengths by energy.

    vectors (2q, m) and their inverse (m, 2q), of pairs one of them, twice: on coordinates and rates of unit mass.
    """
    energy = np.ones((len(vectors), len(rate)))
    energy[: len(vectors) // 2] = np.abs(rate)
    size = np.linalg.norm(vectors * energy, axis=0) * np.linalg.norm(inverse.T / energy, axis=0)
    return bool(np.any(size > NEARLY_EQUAL * np.where(rate.imag > 0, 2, 1)))


def fill_forms(
    flows: Any, s: int, system: Any, momentum: np.ndarray, free_momentum: np.ndarray, speeds: np.ndarray,
    forms: Mapping[str, Products],
) -> None:  # fmt: skip
    """Set the forms and linear maps of subsystem s, and its list of slow pairs.

    Eigenvalues, response and driven modes are set. momentum (m,): of all bodies; free_momentum (m,): of those whose
    motion has a part besides the modes; speeds (k, m): of the coordinates that loads (e, k) of the system act on;
    forms: products of the forms by their names, among them "square" of the response.
    """
    m, e = flows.modes[s], len(system.frequency)
    rate, load, response = flows.eigenvalue[s, :m], growth_rates(flows, s), flows.response[s, :m]
    frame, together = _frames(flows.driven[s], m)
    single, slow_single = _reciprocal(rate, system.period)
    reciprocal, slow = zip(
        _reciprocal(rate[:, None] + rate, system.period),
        _reciprocal(rate[:, None] + rate.conj(), system.period, together),
        strict=True,
    )
    flows.momentum[s, :m] = momentum
    means = np.array([2 * antiderivative(response, single, load), free_momentum])
    _fill_maps(flows, s, load, means, system.load @ speeds, system.load.conj() @ speeds, reciprocal)
    left_out = {}
    for name, (both, mixed) in forms.items():
        both, of_both = _antiderivatives(both, reciprocal[SUM], load, load)
        mixed, of_mixed = _antiderivatives(mixed, reciprocal[DIFFERENCE], load, load.conj())
        getattr(flows, name)[s, ..., : 2 * m, : 2 * m] = _real_form(of_both, of_mixed)
        left_out[name] = both, mixed
    # calm modes hardly change over a period. They swing far out where they are quick to cross: the square of their sum
    # is taken at once (energy_forms)
    calm = np.abs(rate) * system.period < SLOW / 2
    both, mixed = (np.where(np.outer(calm, calm), 0, product) for product in left_out["square"])
    left_out["square"] = both, mixed
    listed = [(j, k, kind, -1) for kind in (SUM, DIFFERENCE) for j, k in np.argwhere(slow[kind]) if j >= k]
    # a mode that is slow relative to a harmonic, or to modes that it drives, is seen from the harmonic's frame
    listed = [(*pair[:3], frame[pair[1]] if pair[2] == DIFFERENCE and pair[0] >= e else -1) for pair in listed]
    count = len(listed)
    for i, (j, k, kind, _) in enumerate(listed):
        half = 0.5 if j == k else 1.0
        for name, product in left_out.items():
            getattr(flows, f"slow_{name}")[s, i] = half * product[kind][..., j, k]
    listed += [(j, 0, SINGLE, -1) for j in np.flatnonzero(slow_single)]
    flows.slow_square[s, count : len(listed)] = 2 * np.where(calm, 0, response)[slow_single]
    listed += [(j, 0, CALM, -1) for j in np.flatnonzero(calm)]
    flows.slow[s, : len(listed)] = np.array(listed).reshape(-1, 4)
    flows.slow_count[s] = len(listed)


def _frames(driven: np.ndarray, m: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the harmonic (m,) that each mode turns with, -1 for none, and the pairs (m, m) that turn together.

    A harmonic and the modes that it drives turn together: a product of one with a conjugate one is slow.
    """
    e, frame = len(driven) - 1, np.full(m, -1)
    frame[:e] = range(e)
    for h in range(e):
        frame[driven[h] : driven[h + 1]] = h
    return frame, (frame[:, None] == frame) & (frame >= 0)


def _fill_maps(
    flows: Any, s: int, load: np.ndarray, means: np.ndarray, work: np.ndarray, work_back: np.ndarray,
    reciprocal: Sequence[np.ndarray],
) -> None:  # fmt: skip
    """Set the linear maps, in the order of numerics.codes.

    means (2, m): twice the antiderivative of the response, and the momentum of free bodies; work, work_back (e, m):
    powers of the loads and of their conjugates; reciprocal: of the rates of products.
    """
    e, m = work.shape
    along, against, back = reciprocal[SUM][:e], reciprocal[DIFFERENCE][:, :e].T, reciprocal[SUM][0].conj()
    both = np.array([flows.response[s, :m], flows.momentum[s, :m]])
    on_phase, on_back = antiderivative(both, against[0], load), antiderivative(both.conj(), back, load.conj())
    flows.work[s, :, :m] = work_back
    flows.linear[s, :m, :WORK_MAP] = np.hstack([
        *_real_map(0.5 * on_phase, 0.5 * on_back),
        np.column_stack([means[0].real, -means[0].imag, means[1].real, -means[1].imag]),
    ])  # fmt: skip
    for h in range(e):
        with_load = antiderivative(work[h], along[h], load)
        with_conjugate = antiderivative(work_back[h], against[h], load)
        on_x, on_y = 0.5 * (with_load + with_conjugate), 0.5j * (with_load - with_conjugate)
        of_harmonic = slice(WORK_MAP + 4 * h, WORK_MAP + 4 * (h + 1))
        flows.linear[s, :m, of_harmonic] = np.column_stack([on_x.real, -on_x.imag, on_y.real, -on_y.imag])


def growth_rates(flows: Any, s: int) -> np.ndarray:
    """Return the rates (m, e) at which each harmonic makes the modes grow that it drives."""
    m, driven = flows.modes[s], flows.driven[s]
    growth = np.zeros((m, len(driven) - 1), complex)
    for h in range(len(driven) - 1):
        at = slice(driven[h], driven[h + 1])
        growth[at, h] = flows.load[s, at]
    return growth


def _reciprocal(rate: np.ndarray, period: float, together: np.ndarray | bool = False) -> tuple[np.ndarray, np.ndarray]:
    """Return 1/rate, 0 where a product with this rate hardly changes over a period or is in `together`; and where."""
    slow = (np.abs(rate) * period < SLOW) | together
    return np.where(slow, 0, 1 / np.where(slow, 1, rate)), slow


def antiderivative(functional: np.ndarray, reciprocal: np.ndarray, load: np.ndarray) -> np.ndarray:
    """Return the functional (..., m) of the amplitudes with a given rate; `reciprocal` of the rates of its terms.

    By parts: a driven mode's rate has a term in its harmonic, by `load` (m, e).
    """
    integral, e = functional * reciprocal, load.shape[1]
    integral[..., :e] -= integral @ load * reciprocal[:e]
    return integral


def _antiderivatives(
    product: np.ndarray, reciprocal: np.ndarray, left: np.ndarray, right: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the same for a form (m, m), with the loads on its two factors: the part of slow pairs, and the form."""
    rest, integral, e = product, product * reciprocal, left.shape[1]
    for _ in range(2 if left.any() else 0):  # the second time for pairs of harmonics
        rest = product.copy()
        rest[:e] -= left.T @ integral
        rest[:, :e] -= integral @ right
        integral = rest * reciprocal
    return rest, integral


def _real_map(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return coefficients (..., 4) of the map a c + b conj(c): its real part by Re c and Im c, its imaginary part."""
    return np.stack([(a + b).real, (b - a).imag, (a + b).imag, (a - b).real], axis=-1)


def _real_form(both: np.ndarray, mixed: np.ndarray) -> np.ndarray:
    """Return matrices (..., 2m, 2m) of Re(c_j (both_jk c_k + mixed_jk conj(c_k)))/2 by real and imaginary parts."""
    *stack, m, _ = both.shape
    form = 0.5 * _real_map(both, mixed) * [1, 1, -1, -1]
    return form.reshape(*stack, m, m, 2, 2).swapaxes(-3, -2).reshape(*stack, 2 * m, 2 * m)
