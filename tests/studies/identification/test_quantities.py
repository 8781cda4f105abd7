"""Measurements of any quantity of results: closed forms of a linear structure, and files with their columns."""

import numpy as np
import pytest
from scipy.linalg import eigh

from tests.coupling.strength.test_stressed_runs import FIRST, MASS, STIFFNESS, file, scene
from tests.studies.identification.oscillator import SCENE
from tests.studies.identification.test_study import FORCED, set_at, write
from vanedamp.files.toml_input import InputError
from vanedamp.studies.identification.data import forced
from vanedamp.studies.identification.fit import Fit
from vanedamp.studies.identification.study import IdentificationStudy
from vanedamp.studies.identification.tables import ForcedTable, Sought

__all__ = ["file"]
AT, FORCE = FIRST * np.array([0.97, 0.99, 1.0, 1.01, 1.02]), 20.0
GAUGE = "stress_von_mises.hot1"


def stress(force):
    """Tension by the last spring, Pa, of whole matrices with a damping ratio of 0.01 in all modes."""
    values, modes = eigh(STIFFNESS, MASS)
    w = 2 * np.pi * AT[:, None]
    transfer = 1.0 / (values - w**2 + 0.02j * np.sqrt(values) * w)
    moved = (modes[2] * transfer * force) @ modes.T
    return 1e12 * np.abs(moved[:, 2] - moved[:, 1])


def test_a_force_is_told_by_a_strain_gauge(file):
    given = scene(file, cavity=[], damper=[], excitation={"frequency": float(FIRST), "force": 10.0, "at": "tip"},
                  time={"periods": 700, "transient": 650})  # fmt: skip
    table = ForcedTable("", noise=0.01, measure=GAUGE)
    measured = forced("gauge", AT, stress(FORCE), {}, table)
    sought = IdentificationStudy(given, {"excitation.force": Sought(5.0, 40.0)}, [measured])
    fit, z = Fit(sought), sought.coordinates([FORCE])
    assert np.abs(fit.residual(z)).max() < 0.1  # in 1 % of noise: samples miss peaks by less than 1e-3
    assert fit.jacobian(z)[:, 0] == pytest.approx(35.0 / FORCE / 0.01, rel=1e-3)  # the logarithm of a linear response
    assert sought.values(fit.minimum(sought.coordinates([10.0])).z) == pytest.approx([FORCE], rel=1e-3)


IMPACTS = "frequency_hz,impacts_per_period\n15.3,1\n15.6,2\n15.9,2\n16.2,1\n"


def measure(name):
    return set_at("forced", 0, "measure", value=name)


def named(header):
    return IMPACTS.replace("impacts_per_period", header)


MEASURED = measure("impacts_per_period")
BODY = {"damper": [{"cavity": "c1", "mass": 0.05, "friction": 0.2, "restitution": 0.6}]}


def test_columns_are_named_as_in_results(tmp_path):
    measured = IdentificationStudy.load(write(tmp_path, MEASURED, IMPACTS, scene=SCENE | BODY)).measured[0]
    assert measured.measure == "impacts_per_period" and measured.channels[0].values.tolist() == [1, 2, 2, 1]
    assert (measured.channels[0].name, measured.channels[0].unit) == ("impacts_per_period", "1")
    force = IMPACTS.replace("impacts_per_period", "contact_force [N]")
    body = SCENE | BODY | {"contact": {"law": "newton", "pair": {"young": 2e11, "radius": 0.01}}}
    changed = measure("contact_force")
    assert IdentificationStudy.load(write(tmp_path, changed, force, scene=body)).measured[0].channels[0].unit == "N"


@pytest.mark.parametrize(
    ("change", "forced", "said"),
    [
        (MEASURED, FORCED, "unknown column 'amplitude_m'; expected frequency_hz, impacts_per_period"),
        (MEASURED, IMPACTS.replace(",1\n", ",0\n", 1), "line 2: impacts_per_period: expected a positive number, not 0"),
        (measure("amplitud"), FORCED, "unknown quantity 'amplitud'; there are amplitude_max"),
        (measure("tilt_max"), named("tilt_max [rad]"), "is a number for each damper; name one, such as 'tilt_max.0'"),
        (measure("tilt_max.3"), named("tilt_max.3 [rad]"), "no damper '3' of tilt_max; there are 0"),
        (measure("tilt_max.0.1"), named("tilt_max.0.1 [rad]"), "tilt_max.0.1: tilt_max has 1 dimensions, not 2"),
        (measure("utilisation.a"), named("utilisation.a"), "runs of this scene have no utilisation, which is"),
    ],
)  # fmt: skip
def test_a_quantity_that_is_not_there_is_rejected(tmp_path, change, forced, said):
    block = [BODY["damper"][0] | {"shape": "block", "length": 1e-2, "height": 1e-2}]
    plane = SCENE | {"damper": block, "cavity": [{"name": "c1", "gap": 1e-3, "play": 1e-4}]}
    with pytest.raises(InputError, match="forced") as caught:
        IdentificationStudy.load(write(tmp_path, change, forced, scene=plane))
    assert said in str(caught.value), caught.value
