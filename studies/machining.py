"""Machining limits: smaller gaps or tolerances of gaps cannot be produced directly.

Cavity and body are two ground parts. At ISO 286-1's grade IT5 a length of 3 to 6 mm is held within 5 um, so that the
gap between both is held within 10 um, 5 um to each side.
"""

from __future__ import annotations

#: m: smallest gap, and half width of its tolerance
GAP, TOLERANCE = 10e-6, 5e-6
_BASIS = "two ground parts of IT5 (ISO 286-1, 3 to 6 mm)"


def fine_gap(gap: float, half_width: float | None = None) -> str:
    """Return objections to machining a gap, m, with the half width of its tolerance, m, in words; "": none.

    half_width: None without a tolerance.
    """
    reasons = [f"a gap of {1e6 * gap:.3g} um is below {1e6 * GAP:g} um"] if gap < GAP else []
    if half_width is not None and half_width < TOLERANCE:
        reasons.append(f"a tolerance of +-{1e6 * half_width:.2g} um is below +-{1e6 * TOLERANCE:g} um")
    return (
        f"{' and '.join(reasons)}, what {_BASIS} can hold; sort the parts by size, or take a larger gap"
        if reasons
        else ""
    )
