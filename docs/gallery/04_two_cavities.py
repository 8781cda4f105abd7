"""
Two cavities
============

Several small bodies in separate cavities need not act like one large body. Here the same mass is in one body, in two
bodies with equal gaps, and in two bodies with different gaps. Two equal bodies move together and act like one; with
different gaps, the impacts of one begin before the impacts of the other.
"""

import matplotlib.pyplot as plt
import numpy as np

import vanedamp as vd

X = 70e-6
mass = 3.14e-3
one = vd.Scene(
    structure={"model": "rigid", "mass": 0.157, "stiffness": 3.605e7, "damping_ratio": 0.002},
    excitation={"frequency": 2400.0, "resonance_amplitude": X},
    cavity=[{"name": "c1", "gap": 0.5 * X}],
    damper=[{"cavity": "c1", "mass": mass, "friction": 0.4, "restitution": 0.7}],
    time={"periods": 700, "transient": 500},
    sweep={"excitation.frequency": np.linspace(2330.0, 2430.0, 41)},
)

# %%
# A second body is a second entry in the lists ``cavity`` and ``damper``. A path without an index, such as
# "damper.mass", changes every entry.

body = {"mass": mass / 2, "friction": 0.4, "restitution": 0.7}
two = one.replace(
    {
        "cavity": [{"name": "c1", "gap": 0.5 * X}, {"name": "c2", "gap": 0.5 * X}],
        "damper": [{"cavity": "c1", **body}, {"cavity": "c2", **body}],
    }
)
unequal = two.replace({"cavity.c1.gap": 0.35 * X, "cavity.c2.gap": 0.7 * X})

figure, axes = plt.subplots(figsize=(7.5, 4.5), layout="constrained")
for name, scene in {"one body, 0.5 X": one, "two, both 0.5 X": two, "two, 0.35 X and 0.7 X": unequal}.items():
    result = vd.sweep(scene)
    frequency = result.axes["excitation.frequency"]
    axes.plot(frequency, result.amplitude_mean / X, ".-", label=name)
    print(f"{name}: highest mean amplitude {result.amplitude_mean.max() / X:.2f} X, status {set(result.status)}")
axes.plot(frequency, result.amplitude_undamped / X, color="0.5", label="without bodies")
axes.plot(frequency, result.amplitude_fixed / X, "--", color="0.5", label="bodies fixed")
axes.set(xlabel="excitation frequency (Hz)", ylabel="mean amplitude over X (-)")
axes.legend()
plt.show()
