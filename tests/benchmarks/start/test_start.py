"""The benchmark of starts leaves its results, and commands import only what they use. No test asserts a time."""

import csv
import json
import subprocess
import sys

import pytest

from benchmarks.start import measure
from benchmarks.start.measure import Start, imports_of, small_scene


@pytest.mark.parametrize(
    "arguments", [["--help"], ["run", "scene.toml", "-o", "response.h5", "--json", "response.json"]]
)
def test_commands_import_nothing_that_they_do_not_use(arguments, tmp_path):
    """scipy's statistics and optimisation, and pools of processes, take longer to import than a small run."""
    small_scene().save(tmp_path / "scene.toml")
    done = subprocess.run(
        [
            sys.executable, "-c",
            "import sys\nfrom vanedamp.studies.cli import main\n"
            "try: status = main(sys.argv[1:])\nexcept SystemExit as end: status = end.code\n"
            "print(status, sorted({'scipy.stats', 'scipy.optimize', 'multiprocessing'} & set(sys.modules)))",
            *arguments,
        ],
        cwd=tmp_path, capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert done.stdout.splitlines()[-1] == "0 []"


def test_benchmark_leaves_its_results(tmp_path, capsys, pictures):
    bench = Start(1, compile=False)
    result = bench.run(tmp_path)
    assert json.loads((tmp_path / "bench_start.json").read_text())["ratio"] == result["ratio"]
    with (tmp_path / "bench_start.csv").open(newline="") as stream:
        rows = {row["what"] for row in csv.DictReader(stream)}
    assert rows >= {*measure.COMMANDS, *measure.PACKAGES, "imports", "loading compiled functions", "run", "writing"}
    assert result["ratio"][measure.UNIT] == {"median": 1.0, "low": 1.0, "high": 1.0}
    panels = pictures["bench_start"]
    assert len({panel.title for panel in panels}) == 3
    assert {panel.x for panel in panels} == {f"processor time over that of `{result['unit']}`"}
    bench.print_summary(result)
    assert "vanedamp run" in capsys.readouterr().out


def test_imports_by_package():
    text = (
        "import time: self [us] | cumulative | imported package\n"
        "import time:       100 |        100 |   numpy.core\n"
        "import time:        50 |        150 | numpy\n"
        "import time:         7 |          7 | json\n"
        "another line\n"
    )
    found = imports_of(text)
    assert found["numpy"] == pytest.approx(150e-6)
    assert found["others"] == pytest.approx(7e-6)
    assert found["scipy"] == 0.0
