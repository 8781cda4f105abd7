"""
The exact engine compared with time stepping
============================================

The exact engine finds every impact. A time-stepping method checks once per step. Moreau's method with 200 and 2000
steps per period shows the cost and the missed impacts.
"""

import matplotlib.pyplot as plt
import numpy as np

import vanedamp as vd

X = 70e-6
scene = vd.Scene(
    structure={"model": "rigid", "mass": 0.157, "stiffness": 3.605e7, "damping_ratio": 0.002},
    excitation={"frequency": 2360.0, "resonance_amplitude": X},
    cavity=[{"name": "c1", "gap": 0.5 * X}],
    damper=[{"cavity": "c1", "mass": 3.14e-3, "friction": 0.4, "restitution": 0.7, "velocity": 0.3}],
    time={"periods": 600, "transient": 400},
)
solvers = {
    "exact": {"method": "exact"},
    "moreau, 200 steps": {"method": "moreau", "steps_per_period": 200},
    "moreau, 2000 steps": {"method": "moreau", "steps_per_period": 2000},
}

# %%
# At 2360 Hz the motion is periodic, so every method should end in the same motion. The energy residual is the imbalance
# of a method's own energy balance.

runs = {
    name: vd.simulate(scene.replace({"solver": solver}), samples_per_period=200) for name, solver in solvers.items()
}
truth = runs["exact"].amplitude_mean
print(f"{'method':20}  status  amplitude (µm)  error     energy residual  impacts per period")
for name, run in runs.items():
    error = abs(run.amplitude_mean / truth - 1)
    print(
        f"{name:20}  {run.status!s:6}  {1e6 * run.amplitude_mean:14.6f}  {error:.1e}  {run.energy_residual:15.1e}  "
        f"{run.impacts_per_period:16.2f}"
    )

# %%
# Left: the last two periods. Right: a sweep from rest. If several motions are possible, steps that are too large lead
# to another one: with 200 steps per period, the body hits the walls at frequencies at which it would float.

band = {"excitation.frequency": np.linspace(2330.0, 2430.0, 21)}
figure, (left, right) = plt.subplots(1, 2, figsize=(10, 4.4), layout="constrained")
for (name, run), style in zip(runs.items(), ("-", ":", "--"), strict=True):
    last = run.time > run.time[-1] - 2 / scene.frequency
    left.plot(1e3 * (run.time[last] - run.time[last][0]), 1e6 * run.body_displacement[last, 0], style, label=name)
    result = vd.sweep(scene.replace({"solver": solvers[name], "damper.velocity": 0.0, "sweep": band}))
    right.plot(band["excitation.frequency"], result.amplitude_mean / X, style, marker=".", label=name)
left.set(xlabel="time (ms)", ylabel="body in its cavity (µm)", title="2360 Hz")
right.set(xlabel="excitation frequency (Hz)", ylabel="mean amplitude over X (-)")
right.legend()
plt.show()
