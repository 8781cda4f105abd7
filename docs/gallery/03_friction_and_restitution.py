"""
Effect of friction and restitution
==================================

Restitution is the fraction of its speed that a body keeps in an impact, and friction acts between the body and the
floor. Neither is known accurately, so their effect should be known first: at 2400 Hz and 70 µm the acceleration of the
floor is 1600 times gravity, and friction due to the body's weight is negligible.
"""

import matplotlib.pyplot as plt
import numpy as np

import vanedamp as vd

X = 70e-6
scene = vd.Scene(
    structure={"model": "rigid", "mass": 0.157, "stiffness": 3.605e7, "damping_ratio": 0.002},
    excitation={"frequency": 2400.0, "resonance_amplitude": X},
    cavity=[{"name": "c1", "gap": 0.5 * X}],
    damper=[{"cavity": "c1", "mass": 3.14e-3, "friction": 0.4, "restitution": 0.7}],
    time={"periods": 600, "transient": 400},
)
restitutions = [0.2, 0.35, 0.5, 0.65, 0.8, 0.9]
frictions = [0.0, 0.2, 0.4, 0.8]
axes = {
    "damper.0.friction": frictions,
    "damper.0.restitution": restitutions,
    "excitation.frequency": np.linspace(2350.0, 2420.0, 18),
}
weight = vd.sweep(scene.replace({"sweep": axes}))

# %%
# A spring or, on a rotor, the centrifugal load presses the body on its floor with much more than its weight.
# ``normal_load`` replaces the weight by that force. Here it is the axis of the sweep, with a friction of 0.4.

loads = [0.03, 3.0, 10.0, 30.0]
pressed = vd.sweep(
    scene.replace({"sweep": {"damper.0.normal_load": loads, **{key: axes[key] for key in list(axes)[1:]}}})
)

# %%
# Each field of the map is the highest mean amplitude in the band.

figure, panels = plt.subplots(1, 2, figsize=(9.5, 3.9), layout="constrained", sharey=True)
names = ["friction coefficient (-), body pressed by its weight", "normal load (N), friction 0.4"]
for panel, result, values, name in zip(panels, (weight, pressed), (frictions, loads), names, strict=True):
    peak = result.amplitude_mean.max(axis=-1).T / X
    image = panel.imshow(peak, origin="lower", aspect="auto", vmin=0, vmax=1, cmap="cividis")
    panel.set_xticks(range(len(values)), [f"{value:g}" for value in values])
    panel.set_yticks(range(len(restitutions)), [f"{value:g}" for value in restitutions])
    panel.set_xlabel(name)
    for row, column in np.ndindex(peak.shape):
        colour = "white" if peak[row, column] < 0.5 else "black"
        panel.text(column, row, f"{peak[row, column]:.2f}", ha="center", va="center", color=colour)
panels[0].set_ylabel("restitution (-)")
figure.colorbar(image, ax=panels, label="highest mean amplitude over X (-)")
plt.show()

# %%
# Range over the friction, at restitution 0.65, and over the normal load.

for name, result in (("friction", weight), ("normal load", pressed)):
    peak = result.amplitude_mean.max(axis=-1)[:, 3] / X
    print(f"{name}: {peak.min():.2f} to {peak.max():.2f}")
