"""Expensive records and working directories that several test files share; options of these tests."""

import os
import site
import sys
from pathlib import Path

import pytest

from tests.tools.processes import PATIENCE, startup, without_stages


def pytest_addoption(parser):
    parser.addoption(
        "--last-bits", type=int, metavar="SEED", help="perturb numerical results: tests/tools/last_bits.py"
    )
    parser.addoption(
        "--slow-clock", type=float, nargs="?", const=100.0, metavar="FACTOR",
        help="let all that vanedamp does take as many times as long, 100 by default, by its clocks: "
        "tests/tools/startup_path/slow_clock.py",
    )  # fmt: skip


def pytest_configure(config):
    seed, factor = config.getoption("last_bits"), config.getoption("slow_clock")
    if seed is not None:
        from tests.tools.last_bits import begin

        begin(seed)
    if factor is not None:
        from tests.tools.startup_path import slow_clock

        os.environ |= startup() | {slow_clock.VARIABLE: str(factor)}
        slow_clock.install()
    import vanedamp.modal.stack  # noqa: F401


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems():
    """Tell hypothesis, which draws constants of the project, that Debian's packages are no part of it."""
    scrutineer = sys.modules.get("hypothesis.internal.scrutineer")
    folders = getattr(scrutineer, "SITE_PACKAGES_DIRS", set())
    folders.update(Path(folder).resolve() for folder in site.getsitepackages())


def pytest_report_header(config):
    return [
        f"{name.replace('_', ' ')}: {value:g}"
        for name in ("last_bits", "slow_clock")
        if (value := config.getoption(name)) is not None
    ]


def pytest_terminal_summary(terminalreporter):
    if "skipped" in terminalreporter.stats:
        terminalreporter.write_line(
            "Skipped tests: `make setup` installs what they lack (`make setup-browser setup-peers setup-docs`), "
            "unless they name a command."
        )


def timeless(capture):
    """What is printed on a fast machine: a busy one names its stages and tells its progress."""
    read = capture.readouterr

    def readouterr():
        found = read()
        return found._replace(err=without_stages(found.err))

    capture.readouterr = readouterr
    return capture


@pytest.fixture
def capsys(capsys):
    return timeless(capsys)


@pytest.fixture
def capfd(capfd):
    return timeless(capfd)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A working directory with a case and a scene."""
    from tests.tools.input_files import DAMPED_BLOCK, SCENE

    (tmp_path / "case.toml").write_text(DAMPED_BLOCK)
    (tmp_path / "scene.toml").write_text(SCENE)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture(scope="session")
def cluster_analysis(tmp_path_factory):
    """ModalAnalysis of the demo's case: the shipped cluster in degree 2, held at the casing, with ten modes."""
    import shutil

    from vanedamp.meshes.vane_cluster import SHIPPED
    from vanedamp.studies.case.stages import assemble, modal_analysis
    from vanedamp.studies.case.tables import Case
    from vanedamp.studies.demo.figure_file import FOLDER

    folder = tmp_path_factory.mktemp("cluster")
    for source in (FOLDER / "case.toml", SHIPPED):
        shutil.copy(source, folder)
    return modal_analysis(assemble(Case.load(folder / "case.toml")))


@pytest.fixture(scope="session")
def cluster(cluster_analysis):
    """SystemMatrices of the shipped cluster."""
    return cluster_analysis.structure.matrices


@pytest.fixture(scope="session")
def cluster_modes(cluster_analysis):
    """The ten lowest modes of the shipped cluster."""
    return cluster_analysis.modes


@pytest.fixture(scope="session")
def browser():
    """Debian's chromium, without a window."""
    import shutil

    program = shutil.which("chromium")
    if program is None:
        pytest.skip("no chromium here")
    playwright = pytest.importorskip("playwright.sync_api")
    with playwright.sync_playwright() as engine:
        opened = engine.chromium.launch(executable_path=program, args=["--no-sandbox"])
        context = opened.new_context(viewport={"width": 1400, "height": 1000})
        context.set_default_timeout(1000 * PATIENCE)
        yield context
        opened.close()


@pytest.fixture
def pictures(monkeypatch):
    """The figures that a test saves, by what is in them (tests.tools.pictures)."""
    from tests.tools.pictures import Pictures

    return Pictures(monkeypatch)
