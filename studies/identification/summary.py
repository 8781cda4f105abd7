"""What an identification comes to, in words."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from vanedamp.coupling.scene.units import unit_of
from vanedamp.studies.identification.record import ROUGHEST, Identification, IdentificationStatus, Misfit, Proposal
from vanedamp.studies.identification.study import IdentificationStudy


def number_text(path: str, best: float, interval: np.ndarray, opened: np.ndarray) -> str:
    """Return a number with its interval, or that the measurements do not tell it."""
    unit = f" {unit_of(path)}" if unit_of(path) != "1" else ""
    low, high = (f"{end:.4g}" for end in interval)
    if opened.all():
        return f"{path}: the measurements do not tell it between {low} and {high}{unit}"
    if opened[0]:
        return f"{path} = {best:.4g}{unit}, at most {high} (95 %)"
    if opened[1]:
        return f"{path} = {best:.4g}{unit}, at least {low} (95 %)"
    return f"{path} = {best:.4g}{unit}, {low} to {high} (95 %)"


def number_texts(found: Identification) -> list[str]:
    """Return all numbers with their intervals, one each."""
    rows = zip(found.paths, found.best.tolist(), found.interval, found.open, strict=True)
    return [number_text(*row) for row in rows]


def sentence_of(paths: Sequence[str], best: np.ndarray, interval: np.ndarray, opened: np.ndarray) -> str:
    """Return all numbers with their intervals as one sentence."""
    return "; ".join(map(number_text, paths, best.tolist(), interval, opened)) + "."


def noise_texts(found: Identification) -> list[str]:
    """Return the deviations that the residuals tell, one a channel."""
    texts = []
    for channel, deviation, estimated in zip(found.channels, found.deviation, found.estimated, strict=True):
        if estimated:
            size = f"{deviation:.2%}" if channel["compare"] == "ratio" else f"{deviation:.3g} {channel['unit']}"
            texts.append(f"noise of {channel['measurement']}, {channel['quantity']}: {size} by the residuals")
    return texts


def proposal_text(paths: Sequence[str], proposal: Proposal) -> str:
    """Return which further measurement would tell most of the number that is told least."""
    best = proposal.best
    at = ", ".join(f"{path} = {value:.6g}" for path, value in zip(proposal.axes, proposal.points[best], strict=True))
    left = proposal.shrink[best, proposal.worst]
    if left > 0.98:
        return f"no further amplitude of the proposed ones tells more of {paths[proposal.worst]}"
    return f"next: an amplitude at {at} leaves {left:.0%} of the uncertainty of {paths[proposal.worst]}"


def outcome(
    study: IdentificationStudy, opened: np.ndarray, interval: np.ndarray, test: Misfit, converged: bool,
    others: np.ndarray, cold: float, misfit: float, over: str, factor: str = "",
) -> tuple[IdentificationStatus, tuple[str, ...]]:  # fmt: skip
    """Return how an identification ended, and its notes.

    others: (o, P) numbers of other minima that are as good; cold: misfit of runs from the scene's own start; over: what
    its budget of time has cut, in words, or ""; factor: by which all measured amplitudes are off, in words, or "".
    """
    notes = [remark for measured in study.measured for remark in measured.remarks]
    notes += _notes(study, opened, interval, test, converged or bool(over), others, cold, misfit, factor)
    if over:
        return IdentificationStatus.BUDGET, (f"the budget of time is over: {over}", *notes)
    if not converged:
        return IdentificationStatus.NOT_CONVERGED, tuple(notes)
    if test.larger:
        return IdentificationStatus.MISFIT, tuple(notes)
    if opened.all(axis=1).any():
        return IdentificationStatus.FLAT, tuple(notes)
    return (IdentificationStatus.AMBIGUOUS if len(others) else IdentificationStatus.OK), tuple(notes)


#: rise of the misfit of runs from the scene's own start above which these end in other motions
_ELSEWHERE = 10.0


def _notes(
    study: IdentificationStudy, opened: np.ndarray, interval: np.ndarray, test: Misfit, converged: bool,
    others: np.ndarray, cold: float, misfit: float, factor: str,
) -> Iterator[str]:  # fmt: skip
    if not converged:
        yield "the search has not reached a minimum; give more starts, or bounds that are closer"
    if test.chance == test.chance and test.larger:
        yield (
            f"misfit: {test.squares:.4g} of {test.freedom} degrees of freedom, which noise exceeds with a chance of "
            f"{test.chance:.2g}; "
            + (factor or "the model lacks something that the measurements show, or the noise is larger")
        )
    elif test.noise > ROUGHEST:
        yield (
            f"misfit: the noise that the residuals tell is {test.noise:.0%} of the values; no measurement is that "
            f"rough: {factor or 'check units, outliers and bodies'}"
        )
    elif test.larger:
        yield (
            f"misfit: the residuals keep their sign longer than noise does (chance {test.runs:.2g}); the model lacks "
            "something that the measurements show"
        )
    for path, ends, is_open in zip(study.paths, interval, opened, strict=True):
        if is_open.all():
            yield f"{path}: flat, the measurements do not tell it between {ends[0]:.4g} and {ends[1]:.4g}"
        elif is_open.any():
            side = f"at most {ends[1]:.4g}" if is_open[0] else f"at least {ends[0]:.4g}"
            yield f"{path}: the measurements tell no more than that it is {side}"
    for values in others:
        found = ", ".join(f"{path} = {value:.4g}" for path, value in zip(study.paths, values, strict=True))
        yield f"other numbers fit as well: {found}"
    if cold > misfit + _ELSEWHERE:
        yield (
            f"runs from the scene's own start miss the measurements by {cold:.4g} rather than {misfit:.4g}: some end "
            "in another steady state than the measured one; give the direction of the measurement, or [initial]"
        )
