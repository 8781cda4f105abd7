"""A damper whose wear and response are known: its gap grows by exp(t/T), its reduction falls with the gap."""

import math
from types import SimpleNamespace

import numpy as np

from vanedamp.coupling.response.contact_work import ContactWear
from vanedamp.coupling.response.response import Status

GAP, AREA, HOURS, SHARE = 2e-5, 5e-5, 2000.0, 0.3
SCENE = {
    "structure": {"model": "rigid", "mass": 0.148, "stiffness": 3.4e7, "damping_ratio": 0.002},
    "excitation": {"frequency": 2412.0, "resonance_amplitude": 3e-5},
    "cavity": [{"name": "c1", "gap": GAP}],
    "damper": [{"cavity": "c1", "mass": 0.003, "friction": 0.4, "restitution": 0.7}],
    "wear": {"rate": 1e-14, "impact_rate": 1e-15, "area": AREA},
    "life": {"band": [2400.0, 2420.0], "hours": 3000.0, "threshold": 0.5, "tolerance": 1e-3},
}


def gap_after(hours):
    return GAP * math.exp(hours / HOURS)


#: reduction is 1 - SHARE * gap/GAP
LOST = HOURS * math.log(0.5 / SHARE)


class Damper:
    """Stands for the engine. scatter: of means, as a share; fail: number of the call that does."""

    def __init__(self, scatter=0.0, seed=0, fail=None, status=Status.OK, share=SHARE):
        self.scatter, self.random, self.calls, self.fail = scatter, np.random.default_rng(seed), 0, fail
        self.status, self.share = status, share

    def __call__(self, scene):
        self.calls += 1
        if self.calls == self.fail:
            raise KeyboardInterrupt
        wide = scene.cavity[0].gap / GAP

        def mean(value):
            # of runs at two frequencies
            return value * (1 + self.scatter * self.random.standard_normal())

        volume = AREA * GAP / HOURS / 2 * wide  # of each wall
        wear = [
            ContactWear(
                0, side, -1, 1.0, 0.4, 1.0, 3, 1.0, mean(rate), 1.96 * self.scatter * rate, rate / AREA, 0.5, AREA
            )
            for side, rate in (("floor", volume / 10), ("left", volume), ("right", volume))
        ]
        amplitude = 3e-5 * self.share * wide
        return SimpleNamespace(
            status=self.status, amplitude_mean_dynamic=mean(amplitude), amplitude_max_dynamic=1.1 * amplitude,
            amplitude_mean=amplitude, wear_work_rate=5.0 * wide,
            amplitude_mean_confidence=1.96 * self.scatter * amplitude, wear=tuple(wear),
        )  # fmt: skip
