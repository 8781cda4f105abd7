"""
Damping versus amplitude from a hammer blow
===========================================

Strike the structure once and let it vibrate freely: one decay gives damping and frequency versus amplitude. The engine
is exact between events, so nothing is filtered.
"""

import matplotlib.pyplot as plt

import vanedamp as vd

scene = vd.Scene(
    structure={"model": "rigid", "mass": 0.157, "stiffness": 3.605e7, "damping_ratio": 0.002},
    excitation={"frequency": 2411.7},
    cavity=[{"name": "c1", "gap": 20e-6}],
    damper=[{"cavity": "c1", "mass": 3.14e-3, "friction": 0.4, "restitution": 0.7}],
    ring_down={"start": "impulse", "impulse": 0.24, "periods": 220, "bins": 12},
)
found = vd.ring_down(scene)

# %%
# A half cycle lies between two turning points. Each bin of amplitude has the mean damping with its 95 % confidence.

linear = found.linear
print(f"status {found.status}; without bodies {linear.frequency:.1f} Hz, damping ratio {linear.damping_ratio:.4f}")
print(f"body fixed {linear.fixed_frequency:.1f} Hz, damping ratio {linear.fixed_damping_ratio:.4f}")
damping = found.bins["damping_ratio"]
best = damping.mean.argmax()  # nan where a bin has too few values
print(f"most damping: {damping.mean[best]:.3f} at {1e6 * damping.low[best]:.1f} to {1e6 * damping.high[best]:.1f} µm")

figure, panels = plt.subplots(3, figsize=(7.5, 8.5), layout="constrained")
half, cycles = found.half_cycles, found.cycles
panels[0].plot(1e3 * half.time, 1e6 * half.amplitude, ".", markersize=3)
panels[0].set(xlabel="time (ms)", ylabel="amplitude (µm)", yscale="log")
panels[1].plot(1e6 * half.amplitude, half.frequency, ".", markersize=3, color="C0", label="half cycles")
panels[1].axhline(linear.frequency, color="0.5", label="without bodies")
panels[1].axhline(linear.fixed_frequency, color="0.5", linestyle="--", label="body fixed")
panels[1].set(ylabel="frequency (Hz)", xscale="log", ylim=(2280, 2480))
panels[1].legend()
panels[2].plot(1e6 * cycles.amplitude, cycles.damping_ratio, ".", markersize=3, color="0.7", label="cycles")
middle = 1e6 * (damping.low * damping.high) ** 0.5
panels[2].errorbar(middle, damping.mean, damping.confidence, fmt="o-", color="C3", capsize=3, label="mean of a bin")
panels[2].axhline(linear.damping_ratio, color="0.5", label="without bodies")
panels[2].set(xlabel="amplitude (µm)", ylabel="damping ratio (-)", xscale="log", ylim=(-0.02, 0.1))
panels[2].legend()
panels[1].sharex(panels[2])
plt.show()
