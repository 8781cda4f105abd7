"""The stage of a pipeline: what decides about doing it again."""

from pathlib import Path

import pytest

from vanedamp.studies.identification.tables import IdentificationFile
from vanedamp.studies.pipeline.stages import Identify
from vanedamp.studies.pipeline.tables import IdentifyStage

KINDS = ("forced", "sine_sweep", "decay", "impacts")


@pytest.mark.parametrize("kind", KINDS)
def test_a_measurement_of_any_kind_that_has_changed_is_another_input(kind, tmp_path):
    Path(tmp_path / "scene.toml").write_text(
        '[structure]\nmodel = "rigid"\nmass = 1.0\nstiffness = 1e4\ndamping_ratio = 0.01\n'
        "[excitation]\nfrequency = 15.9\nforce = 0.5\n", encoding="utf-8"
    )  # fmt: skip
    study, data = tmp_path / "study.toml", tmp_path / "measured.csv"
    study.write_text(f'scene = "scene.toml"\n[[{kind}]]\nfile = "measured.csv"\n', encoding="utf-8")
    stage, found = Identify("identify", study, (), (), IdentifyStage("study.toml")), []
    for content in ("a,b\n1,2\n", "a,b\n1,3\n"):
        data.write_text(content, encoding="utf-8")
        found.append(stage.inputs())
    assert found[0] != found[1]


def test_these_are_all_kinds():
    lists = {name for name, key in IdentificationFile.__dataclass_fields__.items() if str(key.type).startswith("tuple")}
    assert lists == set(KINDS)
