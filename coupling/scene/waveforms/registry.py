"""The waveforms that a scene's [excitation.waveform] table may name: ours, and those that other code registers."""

from __future__ import annotations

from typing import Annotated

from vanedamp.coupling.scene.waveform import WAVEFORMS, Waveform, register
from vanedamp.coupling.scene.waveforms.history import History
from vanedamp.coupling.scene.waveforms.multisine import Multisine

for _waveform in (Multisine, History):
    register(_waveform)

#: type of an excitation's `waveform`
AnyWaveform = Annotated[Waveform, WAVEFORMS]
