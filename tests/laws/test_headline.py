"""Whatever scene is accepted: the headline's figures once more, from the result files and the scene's own matrices."""

import json

import h5py
import numpy as np
import pytest
import tomli_w

from tests.tools.random_scenes import random_reduced, random_scene
from tests.tools.tiers import cases
from vanedamp.studies.cli import main

PATH = "excitation.frequency"


def matrices(data, seed):
    """M, C, K, rows of response and floors by label, and load (a function of the base's or the force's amplitude)."""
    structure = data["structure"]
    if structure["model"] == "rigid":
        mass, stiffness = (np.array([[structure[name]]]) for name in ("mass", "stiffness"))
        damping = 2 * structure["damping_ratio"] * np.sqrt(mass * stiffness)
        rows, rigid = dict.fromkeys(("a", None), np.ones(1)), np.ones(1)
    else:
        model = random_reduced(seed)
        mass, damping, stiffness = model.mass, model.damping, model.stiffness
        rows = {label: model.row(label) for label in ("a", "b")}
        rigid = np.linalg.solve(mass, model.base_load[:, 1])
    return mass, damping, stiffness, rows, rigid


def linear(data, seed, frequencies, fixed):
    """Amplitudes (f,) by the matrices, one frequency after the other."""
    mass, damping, stiffness, rows, rigid = matrices(data, seed)
    excitation, mass = data["excitation"], np.array(mass)
    floors = {cavity["name"]: rows[cavity.get("floor")] for cavity in data["cavity"]}
    for body in data["damper"] if fixed else []:
        mass = mass + body["mass"] * np.outer(floors[body["cavity"]], floors[body["cavity"]])
    load = rows["a"] * excitation.get("force", 0.0) - mass @ rigid * excitation.get("base_acceleration", 0.0)
    omegas = 2 * np.pi * np.asarray(frequencies)
    return np.array(
        [abs(rows["a"] @ np.linalg.solve(stiffness + 1j * w * damping - w**2 * mass, load)) for w in omegas]
    )


@pytest.mark.parametrize(
    ("seed", "structure", "bodies", "shift"),
    cases(
        [(1, "rigid", 1, 0.0), (2, "rigid", 2, 0.0), (3, "rigid", 1, 0.3), (4, "rom", 1, 0.0), (5, "rom", 2, 0.0),
         (6, "rom", 1, 0.2), (7, "rigid", 3, 0.0)],
        fast=[(2, "rigid", 2, 0.0), (3, "rigid", 1, 0.3), (5, "rom", 2, 0.0), (6, "rom", 1, 0.2)],
    ),
)  # fmt: skip
def test_headline_from_the_files(tmp_path, monkeypatch, seed, structure, bodies, shift):
    """shift: of the swept range from the structure's first frequency, as a share of it."""
    monkeypatch.chdir(tmp_path)
    scene = random_scene(seed, structure, bodies)
    data = scene.to_dict()
    if structure == "rom":
        random_reduced(seed).save(f"random-{seed}.h5")
    mass, _, stiffness, *_ = matrices(data, seed)
    first = np.sqrt(np.linalg.eigvals(np.linalg.solve(mass, stiffness)).real.min()) / (2 * np.pi) * (1 + shift)
    swept = first * np.linspace(0.94, 1.04, 15)
    data["time"] = {"periods": 400, "transient": 300}
    data["solver"] = {"max_events": 4000}  # too few for some points
    data["sweep"] = {PATH: swept.tolist()}
    (tmp_path / "scene.toml").write_text(tomli_w.dumps(data))
    assert main(["sweep", "scene.toml", "-o", "s.h5", "--json", "s.json", "--workers", "1"]) == 0
    (told,) = json.loads((tmp_path / "s.json").read_text())["headlines"]

    with h5py.File("s.h5") as file:
        status = np.array([text.decode() for text in file["status"][:]])
        names = ("excitation_frequency", "amplitude_mean_dynamic", "attached_mass_fraction", "impacts_per_period")
        x, mean, attached, impacts = (file[name][:] for name in names)
    ok = status == "ok"
    assert told["points_left_out"] == np.count_nonzero(~ok)
    fine = np.linspace(swept[0], swept[-1], 20001)
    undamped, fixed = (linear(data, seed, fine, glued) for glued in (False, True))
    # half a step is 2.5e-6 of the frequency, beside a half width of zeta >= 1.4e-3: (2.5e-6 / 1.4e-3)^2 of the height
    assert told["undamped_peak"] == pytest.approx(undamped.max(), rel=5e-6)
    assert told["fixed_peak"] == pytest.approx(fixed.max(), rel=5e-6)
    assert told["undamped_peak_at"] == pytest.approx(fine[undamped.argmax()], rel=6e-6)
    assert told["fixed_peak_at"] == pytest.approx(fine[fixed.argmax()], rel=6e-6)
    assert told["undamped_at_edge"] == (undamped.argmax() in (0, len(fine) - 1))
    if not ok.any():
        assert told["peak_ratio"] is None
        return
    top = np.flatnonzero(ok)[mean[ok].argmax()]
    assert told["damped_peak_at"] == x[top]
    assert told["peak_ratio"] == pytest.approx(mean[top] / undamped.max(), rel=5e-6)
    assert told["attached_mass_fraction"] == pytest.approx(attached[top])
    assert told["peak_at_edge"] == (top in (np.flatnonzero(ok)[0], np.flatnonzero(ok)[-1]))
    hit = ok & (impacts > 0.0)
    assert told["onset"] == (x[hit][0] if hit.any() else None)
