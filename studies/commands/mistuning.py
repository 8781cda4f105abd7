"""`vanedamp mistuning`: the amplification of a mistuned ring over draws of its deviations."""

from __future__ import annotations

import time
from argparse import Namespace
from collections.abc import Iterator
from typing import Any

from vanedamp.files.toml_input import InputError
from vanedamp.rom.ring.sector_ring import load_ring
from vanedamp.rom.ring.study import mistuning_study
from vanedamp.studies.case.ring_stages import ring_reduction
from vanedamp.studies.case.stages import assemble
from vanedamp.studies.case.tables import Case
from vanedamp.studies.commands.support.messages import write_result
from vanedamp.studies.terminal import progress


def run(arguments: Namespace, case: Case) -> None:
    """Draw deviations and compute the amplification of each."""
    started = time.perf_counter()
    if case.mistuning is None or case.ring is None:
        raise InputError(
            "mistuning: missing; give deviations of the sectors, such as [mistuning] frequency = {std = 0.01}"
        )
    if arguments.ring is None:
        ring = ring_reduction(assemble(case), arguments.family)
    else:
        ring = load_ring(arguments.ring)
        if ring.sectors != case.ring.sectors:
            raise InputError(f"{arguments.ring}: has {ring.sectors} sectors, the case {case.ring.sectors}")
    speed = 0.0 if case.rotation is None else case.rotation.omega
    orders = arguments.orders or list(range(1, ring.sectors // 2 + 1))
    with progress("draws") as report:
        study = mistuning_study(
            ring, case.mistuning, orders, arguments.seeds, arguments.at, arguments.family - 1, None, speed,
            report=report,
        )  # fmt: skip
    result = study.to_json() | {"wall_time_s": time.perf_counter() - started}
    write_result(arguments, result, _summary(result), output=study.save)


def _summary(result: dict[str, Any]) -> Iterator[str]:
    """Yield the amplification by order: quantiles with their intervals, the largest and where it is."""
    low, high = result["band_hz"]
    yield (
        f"{result['sectors']} sectors, {result['seeds']} draws, peaks at {result['label']} from {low:.6g} to "
        f"{high:.6g} Hz; Whitehead's bound {result['whitehead_bound']:.4g}"
    )
    yield "order  tuned peak, m/N    median                     95 %  99 % by Weibull  largest  (sector, participating)"
    for row in result["orders"]:
        median, most, rare = row["quantiles"]
        fitted = "-" if rare["weibull"] is None else f"{rare['weibull']:.4f}"
        worst = row["worst"]
        yield (
            f"{row['order']:5}{row['tuned_amplitude']:17.4g}{median['value']:10.4f}{_interval(most):>25}{fitted:>17}"
            f"{row['amplification']['largest']:9.4f}  ({worst['sector']}, {worst['participation']:.1f})"
        )


def _interval(entry: dict[str, Any]) -> str:
    """Return a quantile with its interval of confidence."""
    ends = ["-" if entry[name] is None else f"{entry[name]:.3f}" for name in ("low", "high")]
    return f"{entry['value']:.4f} ({ends[0]}, {ends[1]})"
