"""Directives of pages that a reader follows at the keyboard: what they show is run as the page is built.

    ```{file} case.toml          a file that the reader writes; with :append: what is added to its end
    ```{shell}                   commands, then what they print
    ```{python}                  a part of one Python session, then what it prints and draws; :alt: says what is drawn

Every page has an empty folder of its own, in which `:files:` of its first directive, relative to the page, are put.
"""

from __future__ import annotations

import contextlib
import io
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any, ClassVar

from docutils import nodes
from docutils.parsers.rst import directives
from sphinx.application import Sphinx
from sphinx.errors import ExtensionError
from sphinx.util.docutils import SphinxDirective

ROOT = Path(__file__).parents[2]
_PROGRESS = re.compile(r"vanedamp: \w+: \d+ of \d+")


class Session:
    """A folder in which files are written, commands run, and one Python session goes on."""

    def __init__(self, folder: Path) -> None:
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        self.folder, self.names = folder, {"__name__": "__main__"}

    def write(self, name: str, text: str, append: bool = False) -> None:
        """Write a file, or add to it."""
        with (self.folder / name).open("a" if append else "w", encoding="utf-8") as file:
            file.write(("\n" if append else "") + text + "\n")

    def shell(self, text: str) -> str:
        """Run commands as a shell does, until one fails. Returns what they print; raises RuntimeError with it."""
        path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
        sources = os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH")]))
        done = subprocess.run(
            ["bash", "-ec", text], cwd=self.folder, env=os.environ | {"PATH": path, "PYTHONPATH": sources},
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False,
        )  # fmt: skip
        if done.returncode:
            raise RuntimeError(f"{text}\n{done.stdout}")
        # a terminal would show a bar in one place
        lines = [line for line in done.stdout.splitlines() if not _PROGRESS.match(line)]
        return "\n".join(lines).rstrip()

    def python(self, text: str, dpi: int = 110) -> tuple[str, list[bytes]]:
        """Run a part of the session. Returns what it prints, and the PNG of each figure that it leaves open."""
        import matplotlib as mpl

        mpl.use("Agg")
        from matplotlib import pyplot as plt

        printed, pictures = io.StringIO(), []
        with contextlib.chdir(self.folder), contextlib.redirect_stdout(printed):
            exec(compile(text, "session", "exec"), self.names)
        for number in plt.get_fignums():
            picture = io.BytesIO()
            plt.figure(number).savefig(picture, dpi=dpi, format="png")
            pictures.append(picture.getvalue())
        plt.close("all")
        return printed.getvalue().rstrip(), pictures


class _Run(SphinxDirective):
    """Base: the page's session, and the blocks that show it."""

    has_content = True
    option_spec: ClassVar = {"files": directives.unchanged}

    def session(self) -> Session:
        key = "page session"
        if key not in self.env.temp_data:
            self.env.temp_data[key] = Session(Path(self.env.app.outdir).parent / "sessions" / self.env.docname)
        session: Session = self.env.temp_data[key]
        for name in self.options.get("files", "").split():
            relative, path = self.env.relfn2path(name)
            self.env.note_dependency(relative)
            shutil.copy(path, session.folder)
        return session

    @property
    def text(self) -> str:
        return "\n".join(self.content)

    def block(self, text: str, language: str, kind: str) -> nodes.Node:
        block = nodes.literal_block(text, text, classes=[kind])
        block["language"] = language
        self.set_source_info(block)
        return block

    def output(self, text: str) -> list[nodes.Node]:
        return [self.block(text, "text", "session-output")] if text else []


class File(_Run):
    """A file that the reader writes."""

    required_arguments = 1
    option_spec: ClassVar = {**_Run.option_spec, "append": directives.flag}

    def run(self) -> list[nodes.Node]:
        name, append = self.arguments[0], "append" in self.options
        self.session().write(name, self.text, append)
        caption = nodes.caption("", "", nodes.literal("", name), *([nodes.Text(", at its end")] if append else []))
        return [
            nodes.container(
                "",
                caption,
                self.block(self.text, "toml" if name.endswith(".toml") else "text", "file"),
                literal_block=True,
            )
        ]


class Shell(_Run):
    """Commands, and what they print."""

    def run(self) -> list[nodes.Node]:
        try:
            printed = self.session().shell(self.text)
        except RuntimeError as error:
            raise ExtensionError(f"{self.get_location()}: {error}") from None
        return [self.block(self.text, "shell", "session-input"), *self.output(printed)]


class Python(_Run):
    """A part of the Python session, and what it prints and draws."""

    option_spec: ClassVar = {**_Run.option_spec, "alt": directives.unchanged}

    def run(self) -> list[nodes.Node]:
        try:
            printed, pictures = self.session().python(self.text)
        except Exception as error:
            raise ExtensionError(f"{self.get_location()}: {type(error).__name__}: {error}") from error
        shown = [self.block(self.text, "python", "session-input"), *self.output(printed)]
        return shown + [self.picture(data, number) for number, data in enumerate(pictures)]

    def picture(self, data: bytes, number: int) -> nodes.Node:
        name = f"{self.env.docname.replace('/', '-')}-{self.lineno}-{number}.png"
        folder = Path(self.env.app.outdir).parent / "sessions" / "pictures"
        folder.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(data)
        relative = os.path.relpath(folder / name, Path(self.env.doc2path(self.env.docname)).parent)
        return nodes.image(uri=relative, alt=self.options.get("alt", ""), classes=["session-picture"])


def setup(app: Sphinx) -> dict[str, Any]:
    """Add the directives."""
    app.add_directive("file", File)
    app.add_directive("shell", Shell)
    app.add_directive("python", Python)
    return {"version": "1", "parallel_read_safe": False}
