"""The project as packages: built from what it ships, installed where there is no checkout and no finite elements."""

import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from tests.tools.extras import bare
from tests.tools.input_files import DAMPED_BLOCK
from vanedamp.studies.demo.figure_file import FigureStructure

ROOT = Path(__file__).parent.parent
PARTS = ("files", "meshes", "modal", "rom", "coupling", "studies")
SUFFIXES = {".py", ".toml", ".html", ".js", ".css", ".msh"}


def test_shipped_rigid_model_is_that_of_the_shipped_mesh(cluster_analysis, tmp_path):
    cluster_analysis.save(tmp_path / "modes.h5")
    modes = FigureStructure.load(tmp_path / "modes.h5", Path("rom.h5"))
    shipped = FigureStructure.shipped()
    for name in ("mass", "stiffness", "damping_ratio", "frequency", "amplitude"):
        assert getattr(shipped, name) == pytest.approx(getattr(modes, name), rel=1e-7)


def test_rigid_demo_needs_no_finite_elements(tmp_path):
    """With few points and periods: the whole one runs from the installed package below."""
    code = """
from vanedamp.studies.cli import main
from vanedamp.studies.demo import demo
demo.EFFORT = demo.Effort(points=4, periods=430, transient=390)
raise SystemExit(main(["demo", "--rigid", "-o", "out", "--workers", "1"]))
"""
    subprocess.run([sys.executable, "-c", code], cwd=tmp_path, env=bare(), check=True, capture_output=True)
    stems = ["fig9", "fig10_single", "fig10_separate", "fig10_shared"]
    names = {f"{stem}{suffix}" for stem in stems for suffix in (".toml", ".h5")}
    names |= {f"{figure}{suffix}" for figure in ("fig9", "fig10") for suffix in (".png", ".claims.json")}
    names |= {"fig10_single_peak.h5", "report.html", "scene.schema.json"}
    names |= {"pipeline.toml", "pipeline.schema.json", "pipeline.record.json"}
    assert {path.name for path in (tmp_path / "out").iterdir()} == names


@pytest.mark.slow
def test_packages_hold_the_project_and_run_without_a_checkout(tmp_path):
    source = tmp_path / "source"
    tracked = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=True).stdout.decode()
    for name in tracked.rstrip("\0").split("\0"):
        (source / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, source / name, follow_symlinks=False)
    # the wheel is built from the sdist
    subprocess.run([sys.executable, "-m", "build", "--no-isolation", str(source)], check=True, capture_output=True)
    (wheel,) = (source / "dist").glob("*.whl")
    held = set(zipfile.ZipFile(wheel).namelist())
    shipped = {path.relative_to(ROOT) for part in PARTS for path in (ROOT / part).rglob("*") if path.suffix in SUFFIXES}
    tracked_files = set(tracked.split("\0"))
    assert {f"vanedamp/{path}" for path in shipped if str(path) in tracked_files} <= held
    assert {name.split("/")[0].split("-")[0] for name in held} == {"vanedamp"}
    assert {name.split("/")[1] for name in held if name.startswith("vanedamp/")} == {
        *PARTS,
        "__init__.py",
        "__init__.pyi",
        "__main__.py",
        "py.typed",
    }
    fresh = tmp_path / "fresh"
    subprocess.run([sys.executable, "-m", "venv", str(fresh)], check=True)
    install = [str(fresh / "bin" / "pip"), "install", "--quiet", str(wheel)]
    subprocess.run(install, check=True, cwd=tmp_path)
    command = str(fresh / "bin" / "vanedamp")
    ran = subprocess.run([command, "demo", "--rigid", "-o", "out"], cwd=tmp_path, capture_output=True, text=True)
    assert ran.returncode == 0, ran.stderr
    for evidence in ("bench", "paper"):
        refused = subprocess.run([command, evidence, "--help"], cwd=tmp_path, capture_output=True, text=True)
        assert (refused.returncode, refused.stderr.count("\n")) == (2, 1)
        assert "run it in a checkout" in refused.stderr
    assert (tmp_path / "out" / "report.html").is_file()
    (tmp_path / "case.toml").write_text(DAMPED_BLOCK)
    refused = subprocess.run([command, "modal", "case.toml"], cwd=tmp_path, capture_output=True, text=True)
    assert refused.returncode == 2
    assert refused.stderr.count("\n") == 1
    assert "pip install 'vanedamp[fem]'" in refused.stderr
