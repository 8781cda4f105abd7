"""
How wide should the gap be?
===========================

The gap is the first parameter to choose. It is measured relative to X, the amplitude of the resonance without bodies.
In a narrow gap the body moves with the cavity from the beginning, and only shifts the resonance. In a wide gap there
are two steady states: the body hits the walls, or it floats between them without effect. The start determines which one
occurs, so a design is rated by the worse one.
"""

import matplotlib.pyplot as plt
import numpy as np

import vanedamp as vd

X = 70e-6
scene = vd.Scene(
    structure={"model": "rigid", "mass": 0.157, "stiffness": 3.605e7, "damping_ratio": 0.002},
    excitation={"frequency": 2400.0, "resonance_amplitude": X},
    cavity=[{"name": "c1", "gap": X}],
    damper=[{"cavity": "c1", "mass": 3.14e-3, "friction": 0.4, "restitution": 0.7}],
    time={"periods": 700, "transient": 500},
)

# %%
# A sweep over several axes covers all combinations. Keys are the dotted paths of the scene's tables. The direction
# determines how a run begins: "independent" from rest, "up" and "down" with the last state of the frequency below or
# above.

gaps = X * np.array([1.5, 1.0, 0.7, 0.5, 0.3, 0.1])
starts = ["independent", "up", "down"]
frequencies = np.linspace(2340.0, 2425.0, 35)
axes = {"continuation.direction": starts, "cavity.c1.gap": gaps, "excitation.frequency": frequencies}
result = vd.sweep(scene.replace({"sweep": axes}))
print("shape of the grid:", result.shape, "; all runs ok:", bool(np.all(result.status == "ok")))

# %%
# A designer compares the highest mean amplitude in the band.

peak = result.amplitude_mean.max(axis=2) / X
print("gap over X  " + "  ".join(f"{start:>11}" for start in starts))
for gap, values in zip(gaps, peak.T, strict=True):
    print(f"{gap / X:10.1f}  " + "  ".join(f"{value:11.2f}" for value in values))

figure, (left, right) = plt.subplots(1, 2, figsize=(9.5, 4.4), layout="constrained", width_ratios=[3, 2])
left.plot(frequencies, result.amplitude_undamped[0, 0] / X, color="0.5", label="without bodies")
left.plot(frequencies, result.amplitude_fixed[0, 0] / X, "--", color="0.5", label="body fixed")
for place, colour in ((1, "C3"), (3, "C0"), (5, "C2")):
    label = f"gap {gaps[place] / X:.1f} X, from rest"
    left.plot(frequencies, result.amplitude_mean[0, place] / X, ".-", color=colour, label=label)
left.plot(frequencies, result.amplitude_mean[1, 1] / X, "x", color="C3", label="gap 1.0 X, upwards")
left.set(xlabel="excitation frequency (Hz)", ylabel="mean amplitude over X (-)", ylim=(0, 1.4))
left.legend(loc="upper left", ncols=2, fontsize=9)
for start, values, style in zip(starts, peak, ("o-", "x--", "+:"), strict=True):
    right.plot(gaps / X, values, style, label="from rest" if start == "independent" else f"{start}wards")
right.set(xlabel="gap over X (-)", ylabel="highest mean amplitude over X (-)", ylim=(0, 1.4))
right.legend(loc="upper right")
plt.show()
