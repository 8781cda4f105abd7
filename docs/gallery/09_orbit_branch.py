"""
A branch of periodic motions, stable and unstable
=================================================

A sweep shows where runs end. A branch of periodic orbits shows why: it follows a motion versus frequency, stable or
not, and finds where it loses its symmetry, doubles its period or folds.
"""

import matplotlib.pyplot as plt
import numpy as np

import vanedamp as vd

# %%
# The table ``orbit`` gives the range to follow. The body has an initial velocity, so that the run before the branch
# ends with impacts.

scene = vd.Scene(
    structure={"model": "rigid", "mass": 0.15696, "stiffness": 3.6046e7, "damping_ratio": 0.002},
    excitation={"frequency": 2300.0, "resonance_amplitude": 70.2e-6},
    cavity=[{"name": "c1", "gap": 35.1e-6}],
    damper=[{"cavity": "c1", "mass": 3.1392e-3, "friction": 0.4, "restitution": 0.7, "velocity": 0.3}],
    time={"periods": 1500, "transient": 1000},
    orbit={"to": 2368.0, "step": 0.04, "max_step": 0.08, "switch": True, "max_points": 150},
)
found = vd.orbits(scene)
for number, branch in enumerate(found.branches):
    print(f"branch {number}: {len(branch.parameter)} orbits, {branch.stable.sum()} of them stable")
    for point in branch.special:
        if point.kind in ("fold", "pitchfork", "period doubling"):
            print(f"  {point.parameter:.2f} Hz: {point.kind}")

# %%
# The points of a sweep lie on the stable parts. Where no motion of the branches is stable, runs reach another motion.

sweep = vd.sweep(scene.replace({"orbit": None, "sweep": {"excitation.frequency": np.linspace(2300.0, 2368.0, 35)}}))
figure, axes = plt.subplots(figsize=(8, 4.6), layout="constrained")
for number, branch in enumerate(found.branches):
    colour, amplitude = f"C{number}", 1e6 * branch.amplitude_mean
    axes.plot(branch.parameter, amplitude, "--", color=colour, linewidth=1)
    label = f"branch {number}, {branch.periods} period{'s' * (branch.periods > 1)}"
    axes.plot(branch.parameter, np.where(branch.stable, amplitude, np.nan), color=colour, linewidth=3, label=label)
    for point in branch.special:
        if point.kind in ("fold", "pitchfork", "period doubling"):
            axes.plot(point.parameter, amplitude[point.index], "ks", markersize=5)
axes.plot(sweep.axes["excitation.frequency"], 1e6 * sweep.amplitude_mean, ".", color="0.3", label="runs")
axes.set(
    xlabel="excitation frequency (Hz)",
    ylabel="mean amplitude (µm)",
    title="solid: stable, dashed: not, squares: bifurcations",
)
axes.legend(loc="upper left")

# %%
# An orbit is stable if the magnitudes of all its Floquet multipliers are below one. ``neutral`` is the number of
# multipliers equal to one because the body can be displaced without effect; they come first.

figure, axes = plt.subplots(figsize=(8, 3.6), layout="constrained")
for number, branch in enumerate(found.branches):
    largest = np.abs(branch.multipliers[np.arange(len(branch.parameter)), branch.neutral])
    axes.plot(branch.parameter, largest, ".-", color=f"C{number}", label=f"branch {number}")
axes.axhline(1.0, color="0.5")
axes.set(xlabel="excitation frequency (Hz)", ylabel="largest multiplier, modulus (-)")
axes.legend(loc="upper left")
plt.show()
