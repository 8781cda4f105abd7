"""Samples of numbers within their ranges, quantiles of their results, and Sobol' indices, by SALib.

The design is Saltelli's on a scrambled Sobol' sequence of N points: N blocks of d + 2 samples (A, each number of A
taken from B in turn, B). SALib's estimators are those of Saltelli et al., Computer Physics Communications 181 (2010)
259-270.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from typing import Any

import numpy as np

from vanedamp.coupling.scene.ranges import EnsembleTable

#: quantiles of a result over the samples
QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)
#: rows of an array of indices: both with the half width of their 95 % confidence interval
INDICES = ("first_order", "first_order_confidence", "total", "total_confidence")
#: fewest complete blocks that tell indices, and spread over size below which a result is constant
_LEAST, _CONSTANT = 4, 1e-9


def design(ranges: Mapping[str, tuple[float, float]], table: EnsembleTable) -> np.ndarray:
    """Return the samples (N (d + 2), d) of d numbers."""
    from SALib.sample import sobol

    logarithmic = table.distribution == "log-uniform"
    bounds = np.log(list(ranges.values())) if logarithmic else np.array(list(ranges.values()))
    sample = sobol.sample(_problem(bounds), table.samples, calc_second_order=False, seed=table.seed)
    return np.clip(np.exp(sample) if logarithmic else sample, *np.transpose(list(ranges.values())))


def independent(values: np.ndarray, numbers: int) -> np.ndarray:
    """Return the results (2 N, ...) of the independent samples, A and B, of all (N (d + 2), ...)."""
    blocks = values.reshape(-1, numbers + 2, *values.shape[1:])
    return np.concatenate([blocks[:, 0], blocks[:, -1]])


def quantiles(values: np.ndarray, numbers: int) -> np.ndarray:
    """Return QUANTILES (5, ...) of results (N (d + 2), ...) over the independent samples; nan ones are left out."""
    draws = independent(values, numbers)
    result = np.full((len(QUANTILES), *draws.shape[1:]), np.nan)
    known = np.isfinite(draws).any(axis=0)
    result[:, known] = np.nanquantile(draws[:, known], QUANTILES, axis=0)
    return result


def indices(values: np.ndarray, numbers: int, seed: int) -> np.ndarray:
    """Return INDICES (4, d, ...) of results (N (d + 2), ...); nan where the result is constant.

    Blocks with a result that is nan are left out.
    """
    columns = values.reshape(len(values), -1)
    found = [_indices(column.reshape(-1, numbers + 2), numbers, seed) for column in columns.T]
    return np.reshape(np.transpose(found, (1, 2, 0)), (len(INDICES), numbers, *values.shape[1:]))


def _indices(blocks: np.ndarray, numbers: int, seed: int) -> np.ndarray:
    from SALib.analyze import sobol

    blocks = blocks[np.isfinite(blocks).all(axis=1)]
    base = blocks[:, [0, -1]]  # A and B, whose variance is shared out
    if len(blocks) < _LEAST or np.ptp(base) <= _CONSTANT * np.abs(base).max():
        return np.full((len(INDICES), numbers), np.nan)
    problem = _problem(np.tile([0.0, 1.0], (numbers, 1)))
    with warnings.catch_warnings():  # of equal resampled blocks, whose indices count as zero
        warnings.simplefilter("ignore")
        # SALib takes the seed 0 as none
        analysis = sobol.analyze(problem, blocks.ravel(), calc_second_order=False, seed=seed + 1)
    return np.array([analysis[name] for name in ("S1", "S1_conf", "ST", "ST_conf")])


def _problem(bounds: np.ndarray) -> dict[str, Any]:
    # as an array: SALib passes the names to pandas, which from 3 on takes no list
    names = np.array([f"x{number}" for number in range(len(bounds))])
    return {"num_vars": len(bounds), "names": names, "bounds": bounds.tolist()}
