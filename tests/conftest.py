"""Expensive records and working directories that several test files share; options of these tests."""

import pytest


def pytest_addoption(parser):
    parser.addoption(
        "--last-bits", type=int, metavar="SEED", help="perturb numerical results: tests/tools/last_bits.py"
    )


def pytest_configure(config):
    seed = config.getoption("last_bits")
    if seed is not None:
        from tests.tools.last_bits import begin

        begin(seed)
    import vanedamp.modal.stack  # noqa: F401


def pytest_report_header(config):
    seed = config.getoption("last_bits")
    return None if seed is None else f"last bits: seed {seed}"


def pytest_terminal_summary(terminalreporter):
    if "skipped" in terminalreporter.stats:
        terminalreporter.write_line(
            "Skipped tests: `make setup` installs what they lack (`make setup-browser setup-peers setup-docs`), "
            "unless they name a command."
        )


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A working directory with a case and a scene."""
    from tests.tools.input_files import DAMPED_BLOCK, SCENE

    (tmp_path / "case.toml").write_text(DAMPED_BLOCK)
    (tmp_path / "scene.toml").write_text(SCENE)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture(scope="session")
def cluster_solid():
    """The shipped cluster in degree 2, with the material of the reference case."""
    from vanedamp.meshes.vane_cluster import SHIPPED
    from vanedamp.modal.elasticity import Material, Solid

    return Solid(SHIPPED, {"default": Material(young=2.0e11, poisson=0.3, density=8190.0)}, degree=2)


@pytest.fixture(scope="session")
def cluster(cluster_solid):
    """SystemMatrices of the shipped cluster, held at the casing."""
    return cluster_solid.assemble(clamped={"clamp": "xyz"}, damping_ratio=0.002)


@pytest.fixture(scope="session")
def cluster_modes(cluster):
    """The ten lowest modes of the shipped cluster."""
    from vanedamp.modal.eigen import solve_modes

    return solve_modes(cluster, count=10)


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
        yield opened
        opened.close()


@pytest.fixture
def pictures(monkeypatch):
    """The figures that a test saves, by what is in them (tests.tools.pictures)."""
    from tests.tools.pictures import Pictures

    return Pictures(monkeypatch)
