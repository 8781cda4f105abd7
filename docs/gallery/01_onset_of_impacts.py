"""
Onset of impacts and reduction
==============================

A loose body has no effect until it hits the walls of its cavity. From the frequency at which impacts begin, the
response leaves the curve of the cluster without bodies and approaches the curve with the body fixed in its cavity. The
maximum is halved, and at the original resonance hardly any vibration remains: *impact mistuning*.
"""

import matplotlib.pyplot as plt
import numpy as np

import vanedamp as vd

# %%
# A scene describes the structure, the excitation, the cavities and the bodies in them. The table ``sweep`` lists the
# varied parameters. ``resonance_amplitude`` sets the force so that the resonance without bodies has that amplitude.

scene = vd.Scene(
    structure={"model": "rigid", "mass": 0.157, "stiffness": 3.605e7, "damping_ratio": 0.002},
    excitation={"frequency": 2400.0, "resonance_amplitude": 70e-6},
    cavity=[{"name": "c1", "gap": 35e-6}],
    damper=[{"cavity": "c1", "mass": 3.14e-3, "friction": 0.4, "restitution": 0.7}],
    time={"periods": 1000, "transient": 700},
    sweep={"excitation.frequency": np.linspace(2300.0, 2480.0, 91)},
)
result = vd.sweep(scene)

# %%
# The result has one array for each quantity, with the shape of the grid. Do not use points whose status is not "ok".

assert np.all(result.status == "ok")
frequency = result.axes["excitation.frequency"]
hit = result.impacts_per_period > 0
onset = frequency[hit][0]
reference = result.peaks["undamped_peak"]
print(f"without bodies: {1e6 * reference:.1f} µm at {result.peaks['undamped_peak_frequency']:.1f} Hz")
print(f"impacts begin at {onset:.0f} Hz, where the amplitude is {1e6 * result.amplitude_undamped[hit][0]:.1f} µm")
print(f"largest mean amplitude with the body: {result.amplitude_mean.max() / reference:.2f} of that")

# %%
# At 2366 Hz the run from rest does not reach the motion with impacts: there the body can also float, as it does below
# the onset.
#
# The attached mass fraction is 0 for a body that floats and 1 for a fixed body. If the body hits both walls in every
# period it can exceed 1.

figure, (top, bottom) = plt.subplots(2, sharex=True, figsize=(7.5, 6.5), layout="constrained", height_ratios=[2, 1])
top.plot(frequency, 1e6 * result.amplitude_undamped, color="0.5", label="without bodies")
top.plot(frequency, 1e6 * result.amplitude_fixed, "--", color="0.5", label="body fixed")
top.plot(frequency, 1e6 * result.amplitude_mean, "o-", markersize=3, color="C0", label="body loose")
top.axvline(onset, color="C1", linestyle=":", label="first impacts")
top.set_ylabel("mean amplitude (µm)")
top.legend()
bottom.plot(frequency, result.attached_mass_fraction, "o-", markersize=3, color="C0", label="attached mass fraction")
bottom.plot(frequency, result.impacts_per_period, color="C3", label="impacts per period")
bottom.axvline(onset, color="C1", linestyle=":")
bottom.set(xlabel="excitation frequency (Hz)", ylabel="attached mass, impacts (-)")
bottom.legend()
plt.show()
