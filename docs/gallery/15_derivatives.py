"""
Derivatives by parameters
=========================

An orbit of the exact engine has exact derivatives by all parameters of its scene, through impacts, sticking and
slipping. One call shows which parameters matter, and the effect of tolerances.
"""

import matplotlib.pyplot as plt
import numpy as np

import vanedamp as vd

# %%
# The cluster of the page on orbits, between its limits of stability: the body hits each wall once per period.

scene = vd.Scene(
    structure={"model": "rigid", "mass": 0.15696, "stiffness": 3.6046e7, "damping_ratio": 0.002},
    excitation={"frequency": 2368.0, "resonance_amplitude": 70.2e-6},
    cavity=[{"name": "c1", "gap": 35.1e-6}],
    damper=[{"cavity": "c1", "mass": 3.1392e-3, "friction": 0.4, "restitution": 0.5, "velocity": 0.3}],
    time={"periods": 1500, "transient": 1000},
    orbit={"periods": 1},
)
orbit = vd.find_orbit(scene)
numbers = {
    "excitation.resonance_amplitude": "level", "cavity.c1.gap": "gap", "damper.0.mass": "mass of the body",
    "damper.0.restitution": "restitution", "damper.0.friction": "friction", "structure.damping_ratio": "damping ratio",
}  # fmt: skip
found = vd.sensitivity(orbit, list(numbers))
print(found.status, f"{1e6 * found.values['amplitude_mean']:.3f} µm")

# %%
# Relative changes: the change of the amplitude in per cent if a parameter changes by one per cent.

values = np.array([70.2e-6, 35.1e-6, 3.1392e-3, 0.5, 0.4, 0.002])
relative = found.derivatives["amplitude_mean"] * values / found.values["amplitude_mean"]
order = np.argsort(np.abs(relative))
figure, axes = plt.subplots(figsize=(7, 3.4), layout="constrained")
axes.barh(np.array(list(numbers.values()))[order], relative[order])
axes.axvline(0.0, color="0.3", linewidth=0.8)
axes.set(xlabel="change of the mean amplitude (%) per change of the number (%)", ylabel="number (-)")

# %%
# The derivative is the tangent to the results of runs.

gaps = np.linspace(32.0e-6, 35.2e-6, 9)
runs = [vd.simulate(scene.replace({"cavity.c1.gap": float(gap), "orbit": None})).amplitude_mean for gap in gaps]
slope = found.derivatives["amplitude_mean"][list(numbers).index("cavity.c1.gap")]
figure, axes = plt.subplots(figsize=(7, 3.4), layout="constrained")
axes.plot(1e6 * gaps, 1e6 * np.array(runs), "o", label="runs")
axes.plot(1e6 * gaps, 1e6 * (found.values["amplitude_mean"] + slope * (gaps - 35.1e-6)), label="tangent at 35.1 µm")
axes.set(xlabel="gap (µm)", ylabel="mean amplitude (µm)")
axes.legend()
plt.show()
