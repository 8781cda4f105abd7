"""
Dampers under platforms, or bodies in blades
============================================

A ring of blades with a damper under every pair of platforms, or with a loose body in every blade: the best preload, the
resonances of the tuned and of a mistuned ring, and the mass that each remedy takes.
"""

import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from scipy import sparse

import vanedamp as vd
from vanedamp.modal.cyclic import cyclic_sector
from vanedamp.modal.matrices import Patch, SystemMatrices
from vanedamp.rom.interface import InterfaceCoordinate
from vanedamp.rom.ring.reduction import reduce_ring

# %%
# **The sector** has four points: its two faces, the platform and the tip, each with a radial, a tangential and an axial
# motion. The blade bends axially; neighbouring platforms slide on each other axially and press tangentially.

sectors, order, radius = 6, 2, 0.4
blade = np.diag([1e8, 2e6, 3e5, 1e8, 1e8, 1e5])  # platform, tip
blade[[2, 5], [5, 2]] = -1e5
blade[[1, 2], [2, 1]] = 0.6e5
disk = np.kron([[1, 0, -1], [0, 1, -1], [-1, -1, 2]], 4e3 * np.eye(3))  # faces, platform
stiffness = np.zeros((12, 12))
stiffness[6:, 6:] += blade
stiffness[:9, :9] += disk
mass = np.diag(np.repeat([1e-6, 1e-6, 0.1, 0.1], 3))
side = radius * np.exp(1j * np.pi / sectors)
points = np.array([[side.real, -side.imag, 0], [side.real, side.imag, 0], [radius, 0, 0], [radius + 0.1, 0, 0]])
patches = {name: Patch(np.array([k]), np.ones(1)) for k, name in enumerate(("low", "high", "platform", "tip"))}
matrices = SystemMatrices(*map(sparse.csr_array, (stiffness, mass)), points, np.empty(0, int), patches, 0.002)
interface = [
    InterfaceCoordinate("slide", "platform", (0, 0, 1), "node"),
    InterfaceCoordinate("press", "platform", (0, 1, 0), "node"),
    InterfaceCoordinate("tip", "tip", (0, 0, 1), "node"),
]
file = str(Path(tempfile.mkdtemp()) / "ring.h5")
reduce_ring(cyclic_sector(matrices, "low", "high", sectors), interface, 3).save(file)

# %%
# **The scene**: engine order 2 on every tip. The joint is written once and stands in every sector.

tuned = vd.Scene(
    structure={"model": "ring", "file": file},
    excitation={"frequency": 140.0, "force": 0.5, "at": "tip", "wave": order},
    time={"periods": 400, "transient": 300},
)
rings = {"tuned": tuned, "mistuned": tuned.replace({"structure.mistuning": {"seed": 1, "frequency": {"std": 0.002}}})}
joint = {
    "between": ["slide", "slide@+1"], "normal": ["press", "press@+1"], "sectors": "all", "friction": 0.4,
    "normal_stiffness": 2e6, "preload": 1.0,
}  # fmt: skip


def top(result, name="mean"):
    """The largest amplitude of a blade over the frequencies, µm."""
    return 1e6 * np.nanmax(result.sectors[f"sector_amplitude_{name}"], axis=(-2, -1))


# %%
# **The preload** of all joints is varied, in the tuned ring and in one whose blades deviate by 0.2 % in frequency.
# **Loose bodies** of 4 g in the tips, 4 % of the tip's mass, are tried in three gaps.

preloads, gaps = np.array([1.0, 2.0, 4.0, 8.0]), [4e-4, 1.6e-3, 6.4e-3]
joints = {"joint.preload": preloads, "excitation.frequency": np.linspace(118.0, 162.0, 12)}
near = {"cavity.c.gap": gaps, "excitation.frequency": np.linspace(119.8, 122.6, 8)}
bodies = {
    "cavity": [{"name": "c", "sectors": "all", "floor": "tip", "gap": 1e-3, "scatter": {"position": 0.5}}],
    "damper": [{"cavity": "c", "mass": 4e-3, "friction": 0.1, "restitution": 0.6}],
}

figure, axes = plt.subplots(figsize=(7.5, 4.2), layout="constrained")
for colour, (name, scene) in zip(("C0", "C1"), rings.items(), strict=True):
    damped = vd.sweep(scene.replace({"joint": [joint], "sweep": joints}))
    loose = vd.sweep(scene.replace(bodies | {"sweep": near, "time": {"periods": 700, "transient": 500}}))
    tops, of_gaps = top(damped), top(loose)
    axes.loglog(preloads, tops, "o-", color=colour, label=f"{name} ring, joints")
    axes.axhline(of_gaps.min(), color=colour, linestyle="--", label=f"{name} ring, bodies of 4 g")
    found = {"free": top(loose, "undamped").max(), "bodies": of_gaps.min(), "joints": tops.min()}
    print(f"{name} ring:", {key: f"{value:.0f} µm" for key, value in found.items()}, "joints:", tops.round())
    print("statuses:", sorted({*damped.status.flat, *loose.status.flat}))
grams = 1e3 / (radius * (2 * np.pi * 140.0 / order) ** 2)  # per newton: N = m r Omega^2 at 140 Hz
print(f"mass of a damper for 2 N: {2 * grams:.3f} g")
above = axes.secondary_xaxis("top", functions=(lambda force: 1e3 * grams * force, lambda mass: mass / (1e3 * grams)))
above.set(xlabel="mass of a damper whose centrifugal force is the preload (mg)")
axes.set(xlabel="preload of each joint (N)", ylabel="largest amplitude of a blade (µm)")
axes.legend()
plt.show()

# %%
# **Result.** The best of the four preloads leaves 20 µm of 1.5 mm at these points in the tuned ring, and as little in
# the mistuned one. A damper whose centrifugal force is that preload has 26 mg. Bodies of 4 g leave more than a third
# in the tuned and a quarter in the mistuned ring: per gram, the joints are far better here. Half the preload leaves
# eight times as much, twice the preload not twice as much. These bodies are without centrifugal load: in a straight
# cavity at the radius r of the tip, friction holds a body until the blade moves by friction r / order², 12 mm here.
