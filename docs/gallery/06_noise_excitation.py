"""
Noise excitation
================

In service the excitation is often noise. A multi-sine is noise that repeats: sines at neighbouring multiples of a low
frequency, with random phases. It has exactly the given spectrum, and the exact engine runs it.
"""

import matplotlib.pyplot as plt
import numpy as np

import vanedamp as vd

# %%
# 41 equal sines around the resonance, 24 Hz apart. The force is the root mean square of the signal.

scene = vd.Scene(
    structure={"model": "rigid", "mass": 0.157, "stiffness": 3.605e7, "damping_ratio": 0.002},
    excitation={
        "frequency": 24.12,
        "force": 15.0,
        "waveform": {"shape": "multisine", "orders": [80, 120], "crest_factor": 3.0, "seed": 1},
    },
    cavity=[{"name": "c1", "gap": 35e-6}],
    damper=[{"cavity": "c1", "mass": 3.14e-3, "friction": 0.4, "restitution": 0.7}],
    time={"periods": 24, "transient": 8},
)
runs = {
    "without bodies": vd.simulate(scene.replace({"damper": []}), samples_per_period=4096),
    "one body": vd.simulate(scene, samples_per_period=4096),
}

# %%
# The response is measured by its root mean square. The spectrum shows the frequencies of the vibration.

figure, (top, bottom) = plt.subplots(2, figsize=(8, 6.5), layout="constrained")
for name, response in runs.items():
    print(f"{name}: {1e6 * response.amplitude_rms:.2f} µm rms, largest {1e6 * response.amplitude_max:.1f} µm")
    last = response.time > response.time[-1] - 1 / scene.frequency
    top.plot(1e3 * (response.time[last] - response.time[last][0]), 1e6 * response.displacement[last], linewidth=0.8)
    steady = response.displacement[-16 * 4096 :].reshape(16, 4096)
    spectrum = np.sqrt(np.mean(np.abs(np.fft.rfft(steady, axis=1)) ** 2, axis=0)) * np.sqrt(2) / 4096
    hertz = scene.frequency * np.arange(len(spectrum))
    bottom.plot(hertz, 1e6 * spectrum, ".-", linewidth=0.8, label=name)
top.set(xlabel="time (ms)", ylabel="displacement (µm)")
bottom.set(xlabel="frequency (Hz)", ylabel="rms of each line (µm)", xlim=(1700, 3100))
bottom.legend()
plt.show()
