"""
Loose bodies in the blades of a disk
====================================

A disk of twelve hollow blades, computed from the mesh of one sector: its waves, the amplification by mistuning, and the
reduction by a loose body in every blade, in every second one, or only in the worst one.
"""

import matplotlib.pyplot as plt
import numpy as np

import vanedamp as vd
from vanedamp.coupling.scene.mistuning import Mistuning
from vanedamp.studies.case.ring_stages import ring_analysis, ring_reduction

# %%
# **The sector** is a wedge of the disk with one blade, which has a cavity near its tip. Its faces `low` and `high` are
# joined to the faces of its neighbours.

case = vd.Case(
    mesh={
        "generator": "sector", "sectors": 12, "inner_radius": 0.05, "outer_radius": 0.15, "thickness": 0.02,
        "element_size": 0.03, "blade_length": 0.08, "blade_thickness": 0.008, "cavity_length": 0.012,
        "cavity_thickness": 0.004, "cavity_width": 0.012, "cavity_wall": 0.004,
    },
    material={"default": {"young": 2.0e11, "poisson": 0.3, "density": 7800.0, "damping_ratio": 0.002}},
    support={"clamped": ["bore"]},
    ring={"sectors": 12, "low": "low", "high": "high", "deviating": ["blade"]},
    interface={
        "tip": {"facets": "tip", "direction": [0.0, 1.0, 0.0]},
        "cavity": {
            "facets": ["cavity_left", "cavity_right", "cavity_floor", "cavity_roof"], "direction": [0.0, 1.0, 0.0],
        },
    },
    modes={"count": 3, "at": "tip"},
)  # fmt: skip
structure = vd.assemble(case)
modes = ring_analysis(structure)

figure, axes = plt.subplots(figsize=(7.5, 3.5), layout="constrained")
for family in range(2):
    own = modes.families == family
    axes.plot(modes.diameters[own], modes.frequencies_hz[own], "o-", label=f"family {family + 1}")
axes.set(xlabel="nodal diameter (-)", ylabel="natural frequency (Hz)")
axes.legend()
plt.show()

# %%
# **Mistuning**: in the first family the blades are almost uncoupled, so small deviations of their stiffness confine a
# wave to a few of them. In most of a hundred drawn disks under engine order 4, one blade moves more than any blade of
# the tuned disk. Whitehead's bound is the largest possible amplification.

ring = ring_reduction(structure, families=2)
draws = vd.mistuning_study(ring, Mistuning(frequency={"std": 0.0005}), [4], 100, "tip")
factors, worst = draws.amplification[0], int(draws.seeds[np.argmax(draws.amplification[0])])
figure, axes = plt.subplots(figsize=(7.5, 3), layout="constrained")
axes.hist(factors, bins=20, color="0.7")
axes.axvline(draws.bound, color="k", linestyle="--", label="Whitehead's bound")
axes.set(xlabel="largest amplitude of a blade over the tuned one (-)", ylabel="number of disks (-)")
axes.legend()
plt.show()
print(f"median {np.median(factors):.2f}, largest {factors.max():.2f} (seed {worst}), bound {draws.bound:.2f}")

# %%
# **The scene**: engine order 4 bends the blades, each a little later than the previous one. A cavity and its body are
# written once; `sectors` selects the blades that have them. The force would bring the tuned disk to 0.2 mm.

near = [float(factor * draws.tuned_frequency_hz[0]) for factor in (0.975, 1.01)]
scene = vd.Scene(
    structure={"model": "ring", "file": ring, "modes": 24, "natural": True},
    excitation={"frequency": near[0], "wave": 4, "at": "tip", "resonance_amplitude": 2e-4, "resonance_near": near},
    cavity=[{"name": "c", "sectors": "all", "floor": "cavity", "gap": 1.5e-4, "scatter": {"position": 0.5}}],
    damper=[{"cavity": "c", "mass": 0.5e-3, "friction": 0.1, "restitution": 0.6}],
    time={"periods": 1400, "transient": 1000},
    sweep={"excitation.frequency": np.linspace(*near, 26)},
)  # fmt: skip


def top(result):
    """The largest amplitude of any blade at any frequency, in 0.2 mm."""
    return float(np.nanmax(result.sectors["sector_amplitude_mean"])) / 2e-4


# %%
# **Bodies in all blades, in every second one, in the worst one**: the largest amplitude of a blade, tuned and mistuned.

mistuned = {"seed": worst, "frequency": {"std": 0.0005}}
tops = {}
for name, deviations in (("tuned", None), ("mistuned", mistuned)):
    disk = scene if deviations is None else scene.replace({"structure.mistuning": deviations})
    everywhere = vd.sweep(disk)
    alone = everywhere.sectors["sector_amplitude_undamped"]
    hot = int(np.argmax(alone.max(axis=0)))
    tops[name] = {
        "no bodies": float(alone.max()) / 2e-4,
        "in the worst": top(vd.sweep(disk.replace({"cavity.c.sectors": hot}))),
        "in every second": top(vd.sweep(disk.replace({"cavity.c.sectors": "alternate"}))),
        "in all": top(everywhere),
    }

figure, axes = plt.subplots(figsize=(7.5, 3.5), layout="constrained")
for place, (name, values) in enumerate(tops.items()):
    axes.bar(np.arange(4) + 0.4 * place - 0.2, list(values.values()), 0.38, label=f"{name} disk")
axes.set_xticks(np.arange(4), list(tops["tuned"]))
axes.set(xlabel="blades with a body (-)", ylabel="largest amplitude of a blade (0.2 mm)")
axes.legend()
plt.show()
for name, values in tops.items():
    print(name, {label: round(value, 3) for label, value in values.items()})

# %%
# **Result.** A body in every blade reduces the amplitude by more than two thirds, in a mistuned disk by as much as in
# the tuned one: its impacts dissipate energy wherever the wave is. A body in every second blade, or only in the blade
# that moves most, hardly helps: blades without a body still vibrate, and the masses of the bodies mistune the disk.
