"""
From matrices to a bifurcation diagram
======================================

A notebook of ten cells (download it below): a structure that exists only as numpy matrices becomes a reduced model,
then a scene with a loose body, a forced response, and a diagram of its periodic and non-periodic motions.
"""

import matplotlib.pyplot as plt
import numpy as np

import vanedamp as vd

# %%
# **1. Matrices** of a chain of four masses, fixed at its left end: kg, N/m and N s/m. They may also come from another
# program.

mass = np.diag([0.06, 0.05, 0.04, 0.03])
stiffness = 2e6 * (2 * np.eye(4) - np.eye(4, k=1) - np.eye(4, k=-1))
stiffness[-1, -1] = 2e6
damping = 5e-6 * stiffness

# %%
# **2. The reduced model**. Labels name the coordinates for loads and bodies, by an index or by a row.

model = vd.ReducedModel.from_matrices(mass, stiffness, {"tip": 3, "pocket": [0.0, 0.5, 0.5, 0.0]}, damping=damping)
model

# %%
# **3. Its receptance** at the tip. The aim is to reduce the first mode.

hertz = np.linspace(100.0, 2000.0, 2000)
figure, axes = plt.subplots(figsize=(7.5, 3), layout="constrained")
axes.semilogy(hertz, 1e6 * abs(model.frf(hertz, "tip", "tip")))
axes.set(xlabel="frequency (Hz)", ylabel="receptance at the tip (µm/N)")
plt.show()

# %%
# **4. The scene** takes the model as its structure. A cavity at "pocket" holds a body of 5 g. The contacts are springs,
# since a collision on a flexible structure takes time.

first = model.natural_frequencies_hz[0]
scene = vd.Scene(
    structure=model,
    excitation={"frequency": 0.99 * first, "resonance_amplitude": 100e-6, "at": "tip"},
    cavity=[{"name": "c1", "gap": 40e-6, "floor": "pocket"}],
    damper=[{"cavity": "c1", "mass": 6e-3, "friction": 0.1, "restitution": 0.7}],
    contact={"law": "compliant", "stiffness": 2e7},
    time={"periods": 300, "transient": 200},
)
scene

# %%
# **5. A wrong key** causes an error that names the correct one.

try:
    scene.replace({"cavity.c1.gapp": 50e-6})
except vd.InputError as error:
    print(error)

# %%
# **6. One run**, and its results.

response = vd.simulate(scene, events=True, samples_per_period=100)
response

# %%
# **7. Its motion**. ``response.plot(scene)`` shows the same with zoom and cursor.

late = slice(-400, None)
figure, axes = plt.subplots(figsize=(7.5, 3), layout="constrained")
axes.plot(1e3 * response.time[late], 1e6 * response.displacement[late], label="tip")
axes.plot(1e3 * response.time[late], 1e6 * response.body_displacement[late], label="body in its cavity")
axes.set(xlabel="time (ms)", ylabel="displacement (µm)")
axes.legend(loc="upper right")
plt.show()

# %%
# **8. A sweep** over the frequency. ``workers=2`` distributes the points over processes; ``progress=True`` shows a bar.

result = vd.sweep(scene.replace({"sweep": {"excitation.frequency": np.linspace(0.95, 1.02, 29) * first}}))
result

# %%
# **9. The forced response.** ``result.plot()`` shows it interactively.

frequency = result.axes["excitation.frequency"]
figure, axes = plt.subplots(figsize=(7.5, 3.5), layout="constrained")
axes.plot(frequency, 1e6 * result.amplitude_undamped, color="0.6", label="without the body")
axes.plot(frequency, 1e6 * result.amplitude_fixed, "--", color="0.6", label="body fixed")
axes.plot(frequency, 1e6 * result.amplitude_mean, ".-", label="loose body")
axes.set(xlabel="excitation frequency (Hz)", ylabel="mean amplitude (µm)")
axes.legend()
plt.show()

# %%
# **10. The bifurcation diagram**: the position of the body in its cavity at the start of each period. A periodic motion
# gives one point, a doubled period two, a non-periodic motion many. Each run starts with the final state of the
# previous run.

figure, axes = plt.subplots(figsize=(7.5, 4), layout="constrained")
last = None
for hertz in np.linspace(0.95, 1.02, 201) * first:
    at = scene.replace({"excitation.frequency": hertz, "time": {"periods": 150, "transient": 110}})
    last = vd.simulate(at, start=None if last is None else last.final)
    places = 1e6 * last.slip[last.transient :, 0]
    axes.plot(np.full(len(places), hertz), places, ".", color="k", markersize=1)
axes.set(xlabel="excitation frequency (Hz)", ylabel="body in its cavity, once per period (µm)")
plt.show()
