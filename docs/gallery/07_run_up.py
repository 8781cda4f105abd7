"""
Through the resonance at different rates
========================================

A machine that starts passes its resonances. Without bodies, a fast run-up stays below the steady response and peaks
late. With a loose body, the direction of the passage also matters.
"""

import matplotlib.pyplot as plt

import vanedamp as vd

scene = vd.Scene(
    structure={"model": "rigid", "mass": 0.157, "stiffness": 3.605e7, "damping_ratio": 0.002},
    excitation={"frequency": 2400.0, "resonance_amplitude": 70e-6},
    cavity=[{"name": "c1", "gap": 35e-6}],
    damper=[{"cavity": "c1", "mass": 3.14e-3, "friction": 0.4, "restitution": 0.7}],
    ramp={"from": 2320.0, "to": 2460.0, "rate": [100.0, 2000.0], "both": True},
)
ramps = {"with a body": vd.ramp(scene), "without bodies": vd.ramp(scene.replace({"damper": []}))}

# %%
# Each rate, in Hz per second, is a separate run; downward runs follow the upward runs.

figure, panels = plt.subplots(1, 2, figsize=(10, 4.4), layout="constrained", sharey=True)
for panel, (name, result) in zip(panels, ramps.items(), strict=True):
    curves = result.curves
    panel.plot(curves["frequency"], 1e6 * curves["undamped"], color="0.6", label="steady, without bodies")
    for run, colour in zip(result.runs, ("C0", "C1", "C2", "C3"), strict=True):
        label = f"{run.rate:+.0f} Hz/s"
        panel.plot(run.frequency, 1e6 * run.amplitude, color=colour, linewidth=1, label=label)
        print(f"{name}, {label}: peak {1e6 * run.peak:.1f} µm at {run.at_peak('frequency'):.1f} Hz, {run.status}")
    panel.set(xlabel="excitation frequency (Hz)", title=name)
panels[0].set_ylabel("largest displacement in a period (µm)")
panels[1].legend(loc="upper left", fontsize=9)
plt.show()
