"""
A Campbell diagram
==================

Rotation stiffens a blade, so its natural frequencies rise with the speed. The blade resonates where an engine order
crosses one of them.
"""

import matplotlib.pyplot as plt
import numpy as np

import vanedamp as vd

# %%
# A case describes the mesh, the materials and the supports. This one is a small parametric blade; the axis of rotation
# lies 150 mm below its root. ``assemble`` gives its matrices, at standstill and in rotation.

case = vd.Case(
    mesh={"generator": "block", "length": 0.19, "width": 0.05, "thickness": 0.004, "divisions": [12, 4, 1]},
    material={"default": {"young": 2.0e11, "poisson": 0.3, "density": 8000.0}},
    support={"clamped": ["root"]},
    rotation={"axis": [0.0, 0.574, 0.819], "point": [-0.15, 0.0, 0.06], "max_rpm": 15000.0},
)
structure = vd.assemble(case)
rpm = np.linspace(0.0, 15000.0, 31)
diagram = vd.campbell(structure.rotating, rpm * np.pi / 30, orders=[1, 2, 3, 4, 5, 6], count=4)

# %%
# Modes are followed by their shapes. If two of them come close they may cross, or veer and exchange their shapes.

for crossing in diagram.crossings:
    print(
        f"mode {crossing.mode + 1} meets engine order {crossing.order:g} at {crossing.rpm:7.0f} rpm, "
        f"{crossing.frequency_hz:6.1f} Hz"
    )
for veering in diagram.veerings:
    print(f"modes {veering.first + 1} and {veering.second + 1} veer at {veering.speed * 30 / np.pi:.0f} rpm")

figure, axes = plt.subplots(figsize=(7.5, 5), layout="constrained")
for order in diagram.orders:
    axes.plot(diagram.rpm, order * diagram.rpm / 60, color="0.75", linewidth=0.8)
    axes.text(15100, order * 15000 / 60, f"{order:g}", color="0.4", va="center")
for mode, frequencies in zip(diagram.modes, diagram.frequencies_hz, strict=True):
    axes.plot(diagram.rpm, frequencies, label=f"mode {mode + 1}")
axes.plot(
    [crossing.rpm for crossing in diagram.crossings],
    [crossing.frequency_hz for crossing in diagram.crossings],
    "ko", fillstyle="none", label="crossings",
)  # fmt: skip
axes.set(xlabel="speed (rpm)", ylabel="natural frequency (Hz), engine orders in grey", xlim=(0, 15600), ylim=(0, None))
axes.legend(ncols=5, loc="upper center", bbox_to_anchor=(0.5, 1.12))
plt.show()
