"""Kinds of results: each is read back, told, drawn, shown, exported and documented; a new one is a folder."""

import csv
import pkgutil
import sys

import numpy as np
import pytest

import vanedamp as vd
from docs._ext.fields import ResultKinds, described
from vanedamp.files.record import Record
from vanedamp.studies import kinds
from vanedamp.studies.cli import main
from vanedamp.studies.report.page import write_report
from vanedamp.studies.report.results import collect

INIT = '''
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from vanedamp.files.display import Plotted
from vanedamp.files.record import Array, Record
from vanedamp.studies.facts import Fact

NAME, ABOUT, COMMANDS, RECORD = "cooling", "how a blade cools", ("run",), "vanedamp.studies.kinds.cooling:Cooling"


@dataclass(frozen=True, eq=False, repr=False)
class Cooling(Record, Plotted):
    """The temperature of a blade."""

    KIND: ClassVar[str] = NAME
    time: Annotated[np.ndarray, Array(("time",), "s")]
    """after the stop"""
    temperature: Annotated[np.ndarray, Array(("time",), "K")]
    """of the tip"""


def facts(found):
    yield Fact("hottest", float(found.variables["temperature"].values.max()), "K")
'''
PAGE = """
import plotly.graph_objects as go

from vanedamp.studies.kinds.cooling import NAME
from vanedamp.studies.report.charts import dressed

ORDER = 900


def section(results, page):
    shown = []
    for file, result in results.items():
        rows = zip(result.record.time.tolist(), result.record.temperature.tolist())
        drawn = dressed(figure(result.record), height=300)
        shown.append(page.chart(NAME, drawn, ("time", "temperature"), rows, [file]))
    return shown


def figure(record):
    drawn = go.Figure(go.Scatter(x=record.time, y=record.temperature))
    drawn.update_xaxes(title_text="time, s")
    drawn.update_yaxes(title_text="temperature, K")
    return drawn
"""
TEMPLATE = "{% for chart in section %}<h2>A blade cools</h2>{{ plot(chart) }}{% endfor %}"


@pytest.fixture
def cooling(tmp_path, monkeypatch):
    folder = tmp_path / "parts" / "cooling"
    folder.mkdir(parents=True)
    for name, text in {"__init__.py": INIT, "page.py": PAGE, "page.html": TEMPLATE}.items():
        (folder / name).write_text(text, encoding="utf-8")
    monkeypatch.setattr(kinds, "__path__", [*kinds.__path__, str(folder.parent)])
    yield pkgutil.resolve_name("vanedamp.studies.kinds.cooling:Cooling")
    for name in [name for name in sys.modules if name.startswith("vanedamp.studies.kinds.cooling")]:
        del sys.modules[name]
    del kinds.cooling


def test_a_kind_is_a_folder_of_three_files(cooling, tmp_path, capsys):
    file = tmp_path / "blade.h5"
    made = cooling(time=np.arange(3.0), temperature=np.array([900.0, 600.0, 450.0]))
    made.save(file)
    assert np.array_equal(cooling.load(file).temperature, made.temperature)
    assert main(["info", str(file)]) == 0
    assert "hottest" in capsys.readouterr().out
    assert vd.plot(file).layout.yaxis.title.text == vd.plot(made).layout.yaxis.title.text == "temperature, K"
    write_report(collect([file]), tmp_path / "report.html")
    assert "A blade cools" in (tmp_path / "report.html").read_text(encoding="utf-8")
    assert main(["export", str(file), "-o", str(tmp_path / "blade.csv")]) == 0
    with open(tmp_path / "blade.csv", encoding="utf-8") as text:
        assert next(csv.reader(text)) == ["time [s]", "temperature [K]"]
    assert made.to_xarray().temperature.attrs["units"] == "K"
    assert "cooling" in kinds.names() and "how a blade cools" in str(ResultKinds.run(None)[0])


@pytest.mark.parametrize("name", kinds.names())
def test_every_kind_is_read_back_and_documented(name):
    """What files of each kind show is compared in tests/files/test_written_files.py."""
    kind = kinds.kind(name)
    record = pkgutil.resolve_name(kind.RECORD)
    assert kind.ABOUT and callable(record.load)
    if issubclass(record, Record):
        assert hasattr(record, "to_xarray")
        assert [field.name for field in described(record) if not field.meaning] == []
    else:
        assert record.__doc__.count("\n") > 5
