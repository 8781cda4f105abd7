"""
A reduced model of the shipped mesh
===================================

A reduced model keeps the cavity's interface and a few modes of the mesh. How many modes does the response of a loose
body require? This example uses linear elements, so that it takes seconds. They are too stiff: with quadratic elements
the first bending is at 2412 Hz.
"""

from importlib.resources import files

import matplotlib.pyplot as plt
import numpy as np

import vanedamp as vd

# %%
# The mesh has facet groups with names. Interface coordinates are mean displacements of such groups along a direction.

case = vd.Case(
    mesh={"file": str(files("vanedamp.meshes") / "vane_cluster.msh"), "degree": 1},
    material={"default": {"young": 2.0e11, "poisson": 0.3, "density": 8190.0, "damping_ratio": 0.002}},
    support={"clamped": ["clamp"]},
)
matrices = vd.assemble(case).matrices
interface = [
    vd.InterfaceCoordinate("shroud", "shroud", (0, 1, 0)),
    vd.InterfaceCoordinate("c1", "c1_floor", (0, 1, 0)),
]
print(f"{len(matrices.free)} degrees of freedom, {matrices.total_mass:.3f} kg")

# %%
# Craig-Bampton reduction: static shapes of the two coordinates and some fixed-interface modes. The receptance at the
# cavity, with the error compared with a model of many more modes.

hertz = np.linspace(1000.0, 9000.0, 600)
reference = vd.reduce(matrices, interface, modes=60)
models = {count: vd.reduce(matrices, interface, modes=count) for count in (1, 4, 12)}
figure, (top, bottom) = plt.subplots(2, sharex=True, figsize=(7.5, 6.5), layout="constrained")
exact = reference.frf(hertz, "c1", "shroud")
top.semilogy(hertz, 1e6 * abs(exact), color="0.6", linewidth=3, label="60 modes")
for count, model in models.items():
    label = "1 mode" if count == 1 else f"{count} modes"
    receptance = model.frf(hertz, "c1", "shroud")
    top.semilogy(hertz, 1e6 * abs(receptance), "--", linewidth=1, label=label)
    bottom.semilogy(hertz, abs(receptance - exact) / abs(exact).max(), label=label)
    print(f"{label:8}: first frequencies {np.round(model.natural_frequencies_hz[:3], 1)} Hz")
top.set_ylabel("receptance (µm/N)")
top.legend()
bottom.set(xlabel="frequency (Hz)", ylabel="error over the largest receptance (-)")
plt.show()

# %%
# A scene takes a reduced model as its structure. Its contact is a spring, since results with impacts of zero duration
# do not converge as modes are added.

first = reference.natural_frequencies_hz[0]
figure, axes = plt.subplots(figsize=(7.5, 4), layout="constrained")
for count, model in models.items():
    scene = vd.Scene(
        structure=model,
        excitation={"frequency": first, "resonance_amplitude": 70e-6, "at": "shroud"},
        cavity=[{"name": "c1", "gap": 35e-6, "floor": "c1"}],
        damper=[{"cavity": "c1", "mass": 3.14e-3, "friction": 0.4, "restitution": 0.7}],
        contact={"law": "compliant", "stiffness": 1e8},
        time={"periods": 550, "transient": 400},
        sweep={"excitation.frequency": np.linspace(0.965, 1.01, 19) * first},
    )
    result = vd.sweep(scene)
    axes.plot(
        result.axes["excitation.frequency"],
        1e6 * result.amplitude_mean,
        ".-",
        label="1 mode" if count == 1 else f"{count} modes",
    )
axes.plot(result.axes["excitation.frequency"], 1e6 * result.amplitude_undamped, color="0.6", label="without bodies")
axes.set(xlabel="excitation frequency (Hz)", ylabel="mean amplitude (µm)")
axes.legend()
plt.show()
