"""What people see on a terminal: progress bars and summaries."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any


@contextmanager
def progress(title: str) -> Iterator[Callable[[int, int], None]]:
    """A progress bar on standard error, on a terminal only."""
    from tqdm import tqdm

    with tqdm(desc=title, disable=None, leave=False) as bar:

        def show(done: int, total: int) -> None:
            bar.total = total
            bar.update(done - bar.n)

        yield show


def tell_sweep(result: Any) -> None:
    """Print what a sweep found."""
    from studies.forced_response import forced_responses, shown

    for response in forced_responses(result):
        place, height = response.peak("damped_mean")
        print(
            f"{response.name}: damped peak (mean) {height:.3f} of the undamped maximum {response.reference:.4g} m, "
            f"at {response.axis} = {shown(place)} {response.units}".removesuffix(" 1")
        )
    bad = [status for status in result.status.ravel() if status != "ok"]
    if bad:
        print(f"{len(bad)} of {result.status.size} points are not ok, such as: {bad[0]}")


def tell_modes(result: Mapping[str, Any]) -> None:
    """Print modes, effective masses and the rigid model."""
    print("mode  frequency/Hz   effective mass x, y, z / kg        residual")
    rows = zip(result["frequency_hz"], result["effective_mass"], result["residual"], strict=True)
    for index, (frequency, masses, residual) in enumerate(rows):
        mark = "  first bending" if index == result["first_bending"] else ""
        print(
            f"{index + 1:4}  {frequency:12.2f}   " + "  ".join(f"{m:9.5f}" for m in masses) + f"   {residual:.1e}{mark}"
        )
    rigid = result["rigid"]
    if rigid:
        print(
            f"rigid model at {rigid['at']}: mass {rigid['mass']:.5g} kg, stiffness {rigid['stiffness']:.5g} N/m, "
            f"damping {rigid['damping']:.4g} N s/m"
        )
    if "fatigue" in result:
        fatigue = result["fatigue"]
        print(f"amplitude at {fatigue['share']:.0%} of the fatigue strength: {fatigue['amplitude']:.4g} m")
