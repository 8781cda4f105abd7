"""Try an installation as its users do: public names, commands, small files of every kind, exports, the lines of pages.

    PYTHON scripts/try_installation.py CHECKOUT SAMPLES [--tutorial]

PYTHON is the interpreter of the installation, which need have nothing else. SAMPLES: a folder of small files
(tests.tools.fuzz_files). --tutorial: the demonstration with finite elements and the tutorial too, some minutes. Prints
what fails and the counts; exit status 1 if something does. A refusal for want of a package is right where the command
needs a group of packages that is not installed.
"""

from __future__ import annotations

import contextlib
import io
import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
import traceback
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

#: commands that solve finite elements, and those that ask for a checkout
SOLVERS = {"mesh", "modal", "campbell", "ring", "calibrate", "matrices", "reduce", "pipeline"}
OF_CHECKOUT = {"bench", "paper"}
ENDINGS = ("csv", "mat", "mtx", "pch", "op4", "uff", "vtkhdf")
#: what a user without finite elements does with the sample files
CALLS = """
run scene.toml -o mine.h5; sweep swept.toml --workers 2 -o mine_sweep.h5; ramp ramp.toml; ringdown down.toml
orbits orbit.toml; optimise optimise.toml --workers 1; import external.toml -o mine_rom.h5
new scene -o new.toml; check new.toml; run new.toml; schema scene
"""


class Trial:
    """What was tried, and what failed."""

    def __init__(self, checkout: Path) -> None:
        with (checkout / "pyproject.toml").open("rb") as file:
            project = tomllib.load(file)["project"]
        groups = project["optional-dependencies"]
        named = [text for group in ("exchange", "nastran") for text in groups[group]]
        self.formats = {re.split(r"[\[<>=~;! ]", text)[0].lower() for text in named}
        self.fem = find_spec("petsc4py") is not None
        self.tried, self.refused, self.failed = 0, 0, list[str]()

    def judge(self, words: list[str], status: int, error: str) -> None:
        """Count a call of the command by its end."""
        self.tried += 1
        said = error.strip().splitlines()[-1:] or [""]
        needs = re.search(r"needs ([\w.]+)|pip install '?vanedamp\[(\w+)\]", error)
        command = words[0] if words else ""
        if status == 2 and "Traceback" not in error:
            self.refused += 1
            if not needs or command in OF_CHECKOUT or (command in SOLVERS and not self.fem):
                return
            if command == "export" and needs[1] and needs[1].replace("_", "-").lower() in self.formats:
                return
        if status:
            self.failed.append(f"{shlex.join(['vanedamp', *words])}: status {status}: {said[0]}")

    def call(self, *words: str) -> None:
        """Call the command in this process."""
        from vanedamp.studies.cli import main

        error = io.StringIO()
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(error):
            try:
                status = main(list(words))
            except SystemExit as end:
                status = int(end.code or 0)
            except Exception:
                status = 1
                traceback.print_exc()
        self.judge(list(words), status, error.getvalue())

    def process(self, *words: str) -> None:
        """Call the command as it is installed."""
        command = str(Path(sys.executable).with_name("vanedamp"))
        done = subprocess.run([command, *words], capture_output=True, text=True, check=False)
        self.judge(list(words), done.returncode, done.stderr)

    def python(self, name: str, text: str) -> None:
        """Run lines of Python."""
        self.tried += 1
        done = subprocess.run([sys.executable, "-c", text], capture_output=True, text=True, check=False)
        if done.returncode:
            self.failed.append(f"{name}: {done.stderr.strip().splitlines()[-1]}")


def names(trial: Trial) -> None:
    """Load every public name."""
    import vanedamp

    for name in vanedamp.__all__:
        trial.tried += 1
        try:
            getattr(vanedamp, name)
        except Exception as error:
            if trial.fem or "vanedamp[fem]" not in str(error):
                trial.failed.append(f"vanedamp.{name}: {type(error).__name__}: {error}")
            else:
                trial.refused += 1


def commands(trial: Trial) -> list[str]:
    """Ask every command for help."""
    command = str(Path(sys.executable).with_name("vanedamp"))
    text = subprocess.run([command, "--help"], capture_output=True, text=True, check=True).stdout
    listed = re.findall(r"^    (\w+)(?: |$)", text.split("COMMAND\n")[1], re.MULTILINE)
    for name in listed:
        trial.process(name, "--help")
    return listed


def files(trial: Trial, samples: Path) -> None:
    """Show, report and export every sample; run what needs no finite elements."""
    shutil.copytree(samples, Path.cwd(), dirs_exist_ok=True)
    for call in re.split(r"[;\n]", CALLS):
        if call.strip():
            trial.call(*shlex.split(call))
    for path in sorted(samples.iterdir()):
        if path.suffix == ".toml":
            trial.call("check", path.name)
        elif path.suffix == ".h5":
            trial.call("info", path.name)
            trial.call("report", path.name, "-o", "page.html")
            for ending in ENDINGS:
                trial.call("export", path.name, "-o", f"out.{ending}")
    for end in ("info", "report"):  # once as processes
        trial.process(end, "sweep.h5", *(["-o", "page.html"] if end == "report" else []))


def readme(trial: Trial, checkout: Path, whole: bool) -> None:
    """Run the demonstration, then the lines of the README that use its files."""
    trial.process("demo", *([] if whole else ["--rigid"]), "-o", "out")
    blocks = re.findall(r"(?:^    .*\n|^\n)+", (checkout / "README.md").read_text(encoding="utf-8"), re.MULTILINE)
    for block in blocks:
        text = re.sub(r"^    ", "", block, flags=re.MULTILINE).strip()
        if text.startswith("from vanedamp"):
            trial.python("README.md", text)
        if text.startswith("cd out"):
            with contextlib.chdir("out"):
                for line in text.splitlines()[1:]:
                    words = shlex.split(line, comments=True)[1:]
                    if whole or Path(words[1]).exists() or words[0] in SOLVERS:
                        trial.process(*words)


def tutorial(trial: Trial, checkout: Path) -> None:
    """Follow the tutorial from its first block to its last."""
    page = checkout / "docs" / "tutorial" / "index.md"
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    session = ["import matplotlib; matplotlib.use('Agg')"]
    for kind, name, body in re.findall(
        r"^```\{(file|shell|python)\}(.*?)\n(.*?)\n```", page.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL
    ):
        options = dict(re.findall(r"^:(\w+):(.*)$", body, re.MULTILINE))
        text = re.sub(r"\A(?::\w+:.*\n)*", "", body)
        for file in options.get("files", "").split():
            shutil.copy(page.parent / file, ".")
        if kind == "file":
            with Path(name.strip()).open("a" if "append" in options else "w", encoding="utf-8") as file:
                file.write(f"\n{text}\n")
        elif kind == "shell":
            trial.tried += 1
            done = subprocess.run(
                ["bash", "-ec", text], env=os.environ | {"PATH": path}, capture_output=True, text=True, check=False
            )
            if done.returncode:
                trial.failed.append(f"tutorial: {text}: {done.stderr.strip()[-300:]}")
        else:
            session.append(text)
            trial.python(f"tutorial: {text[:40]!r}", "\n".join(session))


def main() -> int:
    checkout, samples = (Path(word).resolve() for word in sys.argv[1:3])
    whole = "--tutorial" in sys.argv
    trial, begun = Trial(checkout), time.monotonic()
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        names(trial)
        commands(trial)
        files(trial, samples)
        readme(trial, checkout, whole and trial.fem)
        if whole and trial.fem:
            tutorial(trial, checkout)
    for text in trial.failed:
        print(f"failed: {text}")
    versions = ", ".join(f"{name} {import_module(name).__version__}" for name in ("numpy", "scipy", "numba", "h5py"))
    print(f"Python {sys.version.split()[0]}, {versions}, {'with' if trial.fem else 'without'} finite elements:")
    counts = f"{trial.tried} tried, {trial.refused} refused in words, {len(trial.failed)} failed"
    print(f"{counts}; {time.monotonic() - begun:.0f} s")
    return bool(trial.failed)


if __name__ == "__main__":
    sys.exit(main())
