"""
A tilting block compared with a slider
======================================

A slider is a point mass that only moves along its cavity. A real body has length and height: it hits a wall with a
corner, it tilts and lifts in its transverse clearance, and it rocks from corner to corner.
"""

import matplotlib.pyplot as plt
import numpy as np

import vanedamp as vd

X = 70e-6
scene = vd.Scene(
    structure={"model": "rigid", "mass": 0.157, "stiffness": 3.605e7, "damping_ratio": 0.002},
    excitation={"frequency": 2380.0, "resonance_amplitude": X},
    cavity=[{"name": "c1", "gap": 0.5 * X, "play": 2e-4, "normal_motion": -0.0178, "rotation": -5.25}],
    damper=[{"cavity": "c1", "mass": 3.14e-3, "friction": 0.4, "restitution": 0.7}],
    time={"periods": 530, "transient": 380},
    sweep={"excitation.frequency": np.linspace(2330.0, 2430.0, 21)},
)
block = scene.replace({"damper.0.shape": "block", "damper.0.length": 6.88e-3, "damper.0.height": 4.8e-3})

# %%
# The same sweep for both. The block is 6.9 mm long and 4.8 mm high, with a clearance of 0.2 mm above it. The cavity of
# the shipped cluster rotates by 5.25 rad per metre of its motion, which tilts an aligned block.

runs = {"slider": vd.sweep(scene), "block": vd.sweep(block)}
for name, result in runs.items():
    print(f"{name}: highest mean amplitude {result.amplitude_mean.max() / X:.2f} X, status {set(result.status)}")
print(f"largest tilt {np.rad2deg(runs['block'].in_plane['tilt_max'].max()):.2f} degrees")

figure, axes = plt.subplots(figsize=(7.5, 4), layout="constrained")
frequency = runs["slider"].axes["excitation.frequency"]
axes.plot(frequency, runs["slider"].amplitude_undamped / X, color="0.5", label="without bodies")
for name, result in runs.items():
    axes.plot(frequency, result.amplitude_mean / X, ".-", label=name)
axes.set(xlabel="excitation frequency (Hz)", ylabel="mean amplitude over X (-)")
axes.legend()
plt.show()

# %%
# One run with samples shows how the block moves. ``in_plane`` has lift and tilt of every body. The block has left the
# floor permanently and flies from impact to impact.

response = vd.simulate(block, samples_per_period=200)
last = response.time > response.time[-1] - 4 / block.frequency
time = 1e3 * (response.time[last] - response.time[last][0])
figure, panels = plt.subplots(3, sharex=True, figsize=(7.5, 6.5), layout="constrained")
panels[0].plot(time, 1e6 * response.displacement[last], color="0.4", label="structure")
panels[0].plot(time, 1e6 * response.body_displacement[last, 0], color="C1", label="block in its cavity")
panels[0].set_ylabel("displacement (µm)")
panels[0].legend(loc="upper right")
panels[1].plot(time, 1e6 * response.in_plane.body_lift[last, 0], color="C1")
panels[1].set_ylabel("lift of the centre (µm)")
panels[2].plot(time, 1e3 * response.in_plane.body_tilt[last, 0], color="C1")
panels[2].set(xlabel="time (ms)", ylabel="tilt (mrad)")
plt.show()
print(f"off the floor for {response.lift_share[0]:.0%} of the time")
