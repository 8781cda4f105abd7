"""
Friction between two platforms
==============================

Two blades rub on each other at their platforms, and the normal force changes as they vibrate. With little preload the
blades are almost free, with much of it the platforms stick; in between is a preload with the smallest resonance.
"""

import matplotlib.pyplot as plt
import numpy as np

import vanedamp as vd
from vanedamp.rom.reduced import ReducedModel

# %%
# A blade is two masses in a row, platform and tip; its platform also moves across the joint, coupled to the bending.
# The matrices stand for a reduced model, whose labels name the motions.

mass = 0.1 * np.eye(6)
blade = 1e5 * np.array([[3.0, -1.0, 0.6], [-1.0, 1.0, 0.0], [0.6, 0.0, 20.0]])  # platform, tip, across
none = np.zeros((3, 3))
labels = {"a": 0, "a_tip": 1, "a_across": 2, "b": 3, "b_tip": 4, "b_across": 5}
model = ReducedModel.from_matrices(mass, np.block([[blade, none], [none, blade]]), labels, damping_ratio=0.002)

scene = vd.Scene(
    structure=model,
    excitation={
        "frequency": 140.0,
        "at": "a_tip",
        "load": [{"at": "a_tip", "force": 2.0}, {"at": "b_tip", "force": 2.0, "phase": 180.0}],
    },
    joint=[
        {
            "between": ["a", "b"],
            "normal": ["a_across", "b_across"],
            "normal_stiffness": 2.0e6,
            "friction": 0.4,
            "preload": 20.0,
        }
    ],
    time={"periods": 1000, "transient": 900},
)

# %%
# A sweep has the two linear references of the field: free, with the joint open, and stuck.

frequency = np.linspace(115.0, 165.0, 51)
preloads = [5.0, 20.0, 50.0, 100.0]
sweep = vd.sweep(scene.replace({"sweep": {"joint.0.preload": preloads, "excitation.frequency": frequency}}))
figure, axes = plt.subplots(figsize=(8, 4.6), layout="constrained")
axes.plot(frequency, 1e6 * sweep.amplitude_undamped[0], "k--", label="free")
axes.plot(frequency, 1e6 * sweep.amplitude_fixed[0], "k:", label="stuck")
for preload, curve in zip(preloads, sweep.amplitude_mean, strict=True):
    axes.plot(frequency, 1e6 * curve, label=f"preload {preload:g} N")
axes.set(xlabel="excitation frequency (Hz)", ylabel="mean amplitude of the tip (µm)", yscale="log")
axes.legend()

# %%
# The largest amplitude over the preload, beside the peaks of both references, has a minimum: more preload moves the
# resonance towards that of the stuck platforms, and friction takes less energy.

preloads = np.geomspace(1.0, 1000.0, 25)
map_ = vd.sweep(scene.replace({"sweep": {"joint.0.preload": preloads, "excitation.frequency": frequency}}))
peak = 1e6 * map_.amplitude_mean.max(axis=1)
best = int(np.argmin(peak))
print(f"smallest peak {peak[best]:.0f} µm at {preloads[best]:.3g} N; {peak[0]:.0f} µm at {preloads[0]:g} N")
print("statuses:", sorted(set(map_.status.ravel().tolist())))
figure, axes = plt.subplots(figsize=(8, 3.8), layout="constrained")
axes.loglog(preloads, peak, ".-")
axes.axhline(1e6 * map_.peaks["undamped_peak"][0], linestyle="--", color="k", label="free")
axes.axhline(1e6 * map_.peaks["fixed_peak"][0], linestyle=":", color="k", label="stuck")
axes.set(xlabel="preload (N)", ylabel="largest mean amplitude (µm)")
axes.legend()

# %%
# One run tells for how long the platforms stick, slip and part, and how much of the work friction takes.

response = vd.simulate(scene)
(joint,) = response.contact_friction
print(joint.sentence)
print(f"friction takes {response.energy['friction'] / response.energy['excitation']:.0%} of the work")
plt.show()
