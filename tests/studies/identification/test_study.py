"""Studies and their measurements: bad input ends in one line that names the file, the key and the remedy."""

import numpy as np
import pytest
import tomli_w

from tests.studies.identification.oscillator import SCENE
from vanedamp.coupling.scene.paths import number_at
from vanedamp.files.toml_input import InputError
from vanedamp.studies.identification.study import IdentificationStudy

FORCED = "frequency_hz,amplitude_m\n15.3,1e-4\n15.6,2e-4\n15.9,2e-3\n16.2,1e-4\n"
DECAY = "time_s,amplitude_m\n0.03,9e-4\n0.06,8e-4\n0.09,7e-4\n"
STUDY = {
    "scene": "scene.toml",
    "numbers": {
        "structure.damping_ratio": {"min": 0.002, "max": 0.05, "scale": "log"},
        "structure.stiffness": {"min": 9e3, "max": 1.1e4},
    },
    "forced": [{"file": "forced.csv", "noise": 0.02}], "decay": [{"file": "decay.csv", "noise": 0.02}],
}  # fmt: skip
RMS = {"change": lambda data: data["forced"][0].update(measure="amplitude_max")}
PHASES = "f [Hz];x [mm];phase [deg]\n15,3;0,1;5\n15,6;0,2;10\n15,9;2,0;90\n16,2;0,1;170\n"


def write(folder, change=lambda data: None, forced=FORCED, decay=DECAY, scene=None):
    data = {key: value for key, value in STUDY.items()}
    data = {**data, "numbers": {k: dict(v) for k, v in data["numbers"].items()}}
    data |= {kind: [dict(table) for table in data[kind]] for kind in ("forced", "decay")}
    change(data)
    for name, text in (("forced", forced), ("decay", decay)):
        (folder / f"{name}.csv").write_text(text)
    (folder / "scene.toml").write_text(tomli_w.dumps(scene or SCENE))
    path = folder / "study.toml"
    path.write_text(tomli_w.dumps(data))
    return path


def test_study_reads_its_files(tmp_path):
    lines = [f"{line},{way}" for line, way in zip(FORCED.split(), ("direction", "up", "up", "down", "up"), strict=True)]
    study = IdentificationStudy.load(write(tmp_path, forced="\n".join(lines)))
    sweep, decay = study.measured
    assert sweep.at.tolist() == [15.3, 15.6, 15.9, 16.2] and sweep.direction == ("up", "up", "down", "up")
    assert (decay.channels[0].compare, decay.channels[0].deviation) == ("ratio", 0.02)
    z = study.coordinates(study.start)
    assert study.values(z) == pytest.approx(study.start, rel=1e-14)
    assert study.values([0.5, 0.5]) == pytest.approx([1e-2, 1e4])  # geometric and arithmetic middle
    assert number_at(study.scene_at([0.02, 9500.0]).to_dict(), "structure.damping_ratio") == 0.02
    assert study.proposals()["excitation.force"] == [0.25, 0.5, 1.0]


def set_at(*path, value):
    def change(data):
        for step in path[:-1]:
            data = data[step]
        data[path[-1]] = value

    return change


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (set_at("scene", value="other.toml"), "other.toml"),
        (set_at("numbers", value={}), "numbers: expected at least 1 entries"),
        (set_at("numbers", "structure.stifness", value={"min": 1.0, "max": 2.0}), "stifness"),
        (set_at("numbers", "excitation.frequency", value={"min": 1.0, "max": 20.0}), "no number of structure"),
        (set_at("numbers", "structure.mass", value={"min": 2.0, "max": 3.0}), "the scene's 1 lies outside 2 to 3"),
        (set_at("numbers", "structure.mass", value={"min": 2.0, "max": 1.0}), "max: expected more than min"),
        (set_at("numbers", "structure.mass", value={"min": -1.0, "max": 1.0, "scale": "log"}), "min: expected a posi"),
        (set_at("numbers", "structure.mass", value={"min": -1.0, "max": 1.0}), "numbers: structure.mass"),
        (set_at("forced", 0, "noise", value=2.0), "forced[0].noise"),
        (set_at("forced", 0, "deviation", value=1e-5), "give one of noise (relative) and deviation"),
        (set_at("forced", 0, "set", value={"structure.stiffness": 1.0}), "is one of the numbers that are sought"),
        (set_at("forced", 0, "set", value={"excitation.forse": 1.0}), "forced 'forced'"),
        (set_at("propose", value={"excitation.forse": [1.0]}), "propose"),
        (set_at("forced", 0, "file", value="none.csv"), "none.csv"),
    ],
)  # fmt: skip
def test_bad_studies_end_in_one_line(tmp_path, change, told):
    with pytest.raises(InputError) as error:
        IdentificationStudy.load(write(tmp_path, change))
    text = str(error.value)
    assert (told in text and "\n" not in text and ".toml" in text) or ".csv" in text


@pytest.mark.parametrize(
    ("header", "options", "scale", "measure"),
    [
        ("frequency_hz,amplitude_m", {}, 1.0, "amplitude_mean"),
        ("f [Hz],x [mm pk-pk]", {}, 0.5e-3, "amplitude_mean"),
        ("f,Peak (µm)", {"measure": "amplitude_max"}, 1e-6, "amplitude_max"),
        ("f,x_rms_mm", {}, 1e-3, "amplitude_rms"),
        ("f,x [mm rms]", {"measure": "amplitude_harmonic"}, 2**0.5 * 1e-3, "amplitude_harmonic"),
        ("f,Laser [mm/s]", {"measure": "amplitude_harmonic"}, 1e-3 / (2 * np.pi * 15.3), "amplitude_harmonic"),
        ("f,acc_g", {"measure": "amplitude_harmonic"}, 9.80665 / (2 * np.pi * 15.3) ** 2, "amplitude_harmonic"),
    ],
)
def test_amplitudes_as_headers_say(tmp_path, header, options, scale, measure):
    text = FORCED.replace("frequency_hz,amplitude_m", header)
    read = IdentificationStudy.load(write(tmp_path, lambda data: data["forced"][0].update(options), text)).measured[0]
    assert read.channels[0].values[0] == pytest.approx(1e-4 * scale, rel=1e-12) and read.measure == measure
    assert f"{header.split(',')[1]!r} as {measure} of " in read.source and "'f" in read.source


@pytest.mark.parametrize("conjugate", [False, True])
@pytest.mark.parametrize(("unit", "turned"), [("mm", 0.0), ("mm/s", 90.0), ("g", 180.0)])
def test_phases_of_a_displacement(tmp_path, unit, turned, conjugate):
    """That of a velocity is a quarter of a turn ahead of it, that of an acceleration half a turn."""
    lags = np.array([-5.0, -10.0, -90.0, -170.0])
    given = (lags + turned) * (-1.0 if conjugate else 1.0)
    rows = [f"{f};1e-4;{phase}" for f, phase in zip((15.3, 15.6, 15.9, 16.2), given.tolist(), strict=True)]
    text = "\n".join([f"f [Hz];x [{unit}];phase [deg]", *rows])
    options = {"measure": "amplitude_harmonic", "conjugate": conjugate}
    read = IdentificationStudy.load(write(tmp_path, lambda data: data["forced"][0].update(options), text)).measured[0]
    assert np.angle(np.exp(1j * (read.channels[1].values - np.radians(lags)))) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize(
    ("files", "told"),
    [
        ({"forced": FORCED.replace("amplitude_m", "size_kg")}, "unknown column 'size_kg'; expected frequency_hz, ampl"),
        ({"forced": FORCED.replace("amplitude_m", "amplitude")}, "no unit; write one such as 'amplitude [m]'"),
        ({"forced": FORCED.replace("amplitude_m", "amplitude [mm rms]")} | RMS, "no rms value; take \"amplitude_har"),
        ({"forced": FORCED.replace("amplitude_m", "acc [g]")}, "acceleration gives the displacement of a sine only"),
        ({"forced": FORCED.partition("\n")[2]}, "forced.csv: names no columns; expected the header frequency_hz, ampl"),
        ({"forced": PHASES}, "looks like exp(-iwt): the phase rises through the resonance; give conjugate = true"),
        ({"forced": PHASES.replace("[deg]", "[rad]")}, "rad is more than two turns; write phase_deg for degr"),
        ({"forced": FORCED.replace("2e-3", "-2e-3")}, "forced.csv: line 4: amplitude_m: expected a positive number"),
        ({"forced": FORCED.replace("2e-3", "x")}, "line 4: amplitude_m: expected a finite number"),
        ({"decay": DECAY.replace("0.06", "0.02")}, "decay.csv: line 3: time_s: expected times from 0 that rise"),
        ({"decay": ""}, "decay.csv: holds no rows of numbers"),
        ({"scene": {k: v for k, v in SCENE.items() if k != "ring_down"}}, "decay 'decay': ring_down: missing"),
        ({"scene": SCENE | {"solver": {"method": "moreau"}}}, 'solver.method: identification takes "exact"'),
    ],
)  # fmt: skip
def test_bad_measurements_end_in_one_line(tmp_path, files, told):
    with pytest.raises(InputError) as error:
        IdentificationStudy.load(write(tmp_path, **files))
    assert told in str(error.value) and "\n" not in str(error.value)


def test_too_few_values(tmp_path):
    def one(data):
        data["decay"] = []

    with pytest.raises(InputError, match="2 of them need more than 2 measured values, not 1"):
        IdentificationStudy.load(write(tmp_path, one, forced="frequency_hz,amplitude_m\n15.3,1e-4\n"))
