"""The curves of a forced response as every chart draws them: names, line styles and widths."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

#: title of an axis of amplitudes over the reference of a response
RELATIVE = "amplitude / maximum without bodies"


class Look(NamedTuple):
    """Name, dashes and width (px) of a curve."""

    title: str
    dash: str
    width: float


#: by the names of the curves in LinearCurves and ForcedResponse, in the order in which they are drawn
LOOKS = {
    "undamped": Look("without bodies", "dot", 1.8),
    "fixed": Look("bodies fixed", "dash", 1.8),
    "damped_max": Look("damped, maximum", "solid", 0.8),
    "damped_mean": Look("damped, mean of peaks", "solid", 2.8),
}


def trace(curve: str, x: Any, values: np.ndarray, colour: str, **more: Any) -> dict[str, Any]:
    """Return a curve as plotly takes a scatter's arguments: values (k,) over x (k,), infinite ones left out.

    more: further arguments, or others in place of these.
    """
    look = LOOKS[curve]
    return {
        "x": x, "y": np.where(np.isfinite(values), values, np.nan), "name": look.title, "mode": "lines",
        "line": {"dash": look.dash, "width": look.width, "color": colour},
    } | more  # fmt: skip
