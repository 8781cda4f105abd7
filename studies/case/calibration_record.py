"""The file of a calibration: numbers for a scene, what was tuned, and the measured response with its fit."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, ClassVar

import numpy as np

from vanedamp.files.record import Array, Record, empty
from vanedamp.modal.frf import UNITS
from vanedamp.modal.rigid_model import ModalCavityMotion, RigidModel

_OfTargets = Annotated[np.ndarray, Array(("target",))]
_OfParts = Annotated[np.ndarray, Array(("part",))]
_QUANTITY = "of its quantity"
_Responses = Annotated[np.ndarray, Array(("label", "line"), _QUANTITY, complex)]


@dataclass(frozen=True, eq=False, repr=False)
class CalibrationRecord(Record):
    """A case calibrated with measurements. Arrays are empty where nothing was tuned, or no response measured."""

    KIND: ClassVar[str] = "calibration"
    frequencies_hz: Annotated[np.ndarray, Array(("mode",), "Hz", name="frequency", json="frequency_hz")]
    """of the calibrated case"""
    first_bending: int
    """number of its mode, from 0"""
    rigid: RigidModel
    """that mode at the response coordinate, with the calibrated damping ratio"""
    damping: Mapping[str, Any]
    """"ratio" and "source" ("case" or "frf"); of a measured response also its "reading", "quantity", "band" (Hz) and
    "frequency_hz", the "deviation" of the ratio, and the "misfit" of the fit"""
    excitation: Mapping[str, Any] | None = None
    """"force" (N) that gives at resonance the "amplitude" (m) for a "share" of the fatigue strength at the "hot_spot";
    None without a fatigue strength"""
    cavity: Mapping[str, ModalCavityMotion] = field(default_factory=dict)
    """how the mode moves the cavities"""
    warnings: Annotated[tuple[str, ...], Array(("warning",), attribute=True)] = ()
    """to be read before results are used"""
    part: Annotated[tuple[str, ...], Array(("part",), dtype=object)] = ()
    """names of the tuned parts of the stiffness"""
    factor: _OfParts = field(default_factory=empty)
    """by which the part is stiffer than it was"""
    factor_deviation: _OfParts = field(default_factory=empty)
    """relative, for 0.1 % of the frequencies"""
    target_hz: Annotated[np.ndarray, Array(("target",), "Hz", name="target_frequency")] = field(default_factory=empty)
    """measured frequencies"""
    before_hz: Annotated[np.ndarray, Array(("target",), "Hz", name="frequency_before")] = field(default_factory=empty)
    """computed before tuning"""
    after_hz: Annotated[np.ndarray, Array(("target",), "Hz", name="frequency_after")] = field(default_factory=empty)
    """by the tuned model"""
    mac_before: _OfTargets = field(default_factory=empty)
    """of the shapes with the measured ones, as the case had it"""
    mac_after: _OfTargets = field(default_factory=empty)
    """the same of the tuned model"""
    sensitivity: Annotated[np.ndarray, Array(("target", "part"))] = field(default_factory=empty)
    """of the logarithms of frequencies to the logarithms of factors"""
    label: Annotated[tuple[str, ...], Array(("label",), dtype=object)] = ()
    """names of the measured responses"""
    line: Annotated[np.ndarray, Array(("line",), "Hz")] = field(default_factory=empty)
    """frequencies of the responses"""
    response: _Responses = field(default_factory=empty)
    """as measured, in SI units of its quantity (modal.frf.UNITS)"""
    fitted: _Responses = field(default_factory=empty)
    """nan outside the band"""
    versions: Mapping[str, str] = field(default_factory=dict)
    """of the software"""
    provenance: Mapping[str, Any] = field(default_factory=dict)
    """of the matrices"""

    @property
    def unit(self) -> str:
        """The unit of the measured response."""
        return UNITS[self.damping["quantity"]]

    @property
    def errors(self) -> tuple[np.ndarray, np.ndarray]:
        """Errors (n,) of the computed frequencies before and after tuning, %."""
        return 100.0 * (self.before_hz / self.target_hz - 1.0), 100.0 * (self.after_hz / self.target_hz - 1.0)

    def unit_in_file(self, declared: str) -> str:
        """Return the unit of declared fields, of the measured response its own."""
        return self.unit if declared == _QUANTITY else declared
