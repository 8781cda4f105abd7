"""
The best mass and gap
=====================

The optimisation searches for the mass and the gap with the largest reduction of the largest amplitude in a band: as
designed, and within manufacturing tolerances. This is the same as ``vanedamp optimise STUDY.toml``.
"""

import matplotlib.pyplot as plt
import numpy as np

import vanedamp as vd

# %%
# A study is a scene with a table ``optimise``. Here the search is short; for a decision use more evaluations, samples
# and frequencies.

scene = vd.Scene(
    structure={"model": "rigid", "mass": 0.157, "stiffness": 3.605e7, "damping_ratio": 0.002},
    excitation={"frequency": 2412.0, "resonance_amplitude": 70e-6},
    cavity=[{"name": "c1", "gap": 35e-6}],
    damper=[{"cavity": "c1", "mass": 3.14e-3, "friction": 0.4, "restitution": 0.7}],
    time={"periods": 500, "transient": 400},
)
study = vd.Study.of(
    scene.to_dict()
    | {
        "optimise": {
            "band": {"start": 2340.0, "stop": 2440.0, "num": 15},
            "variables": {"mass_ratio": [0.005, 0.04], "gap_ratio": [0.1, 1.2]},
            "tolerances": {"gap": 0.1, "restitution": 0.1},
            "samples": 2,
            "evaluations": 15,
            "map": {"mass_ratio": 5, "gap_ratio": 6},
        }
    }
)
best = vd.optimise(study)
print(best.sentence)

# %%
# The map shows designs without deviations, each from rest. Near an edge of the map a small error of the gap costs much,
# and the robust optimum avoids it.

figure, axes = plt.subplots(figsize=(7.5, 4.8), layout="constrained")
reduction = 100 * (1 - best.map_amplitude)
levels = np.arange(0, 101, 10)
filled = axes.contourf(best.map_gap_ratio, 100 * best.map_mass_ratio, reduction, levels, cmap="cividis")
for name, item, marker in (("as designed", best.nominal, "o"), ("robust", best.robust, "s")):
    design = item.design
    axes.plot(
        design.gap_ratio, 100 * design.mass_ratio, marker, color="w", markeredgecolor="k", markersize=10, label=name
    )
    print(f"{name}: {100 * item.reduction:.0f} %, within the tolerances {100 * item.reduction_tolerances:.0f} %")
axes.set(xlabel="gap over X (-)", ylabel="mass over that of the structure (%)")
axes.legend(loc="upper right", title="optimum")
figure.colorbar(filled, label="gained of the largest amplitude (%)")
plt.show()
