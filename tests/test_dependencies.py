"""What the code imports is declared in pyproject.toml, and the product works without groups that nobody asked for."""

import ast
import json
import re
import subprocess
import sys
import tomllib
from functools import cache
from importlib.metadata import packages_distributions

import pytest

from tests.tools.extras import EXTRAS, FINITE_ELEMENTS, bare
from tests.tools.processes import ROOT

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
GROUPS = {"": PROJECT["dependencies"]} | PROJECT["optional-dependencies"]
PRODUCT = ("files", "meshes", "modal", "rom", "coupling", "studies", "vanedamp")
EVIDENCE = ("tests", "docs", "benchmarks", "paper", "scripts")
#: of the evidence: Debian's packages, and a program that its page tells how to install
UNDECLARED = {"siconos", "emcee"}
KNOWN = packages_distributions()
#: modules of packages that may be missing here
DISTRIBUTIONS = {"sksparse": "scikit-sparse", "sksundae": "scikit-sundae", "netgen": "ngsolve", "skfem": "scikit-fem"}


def normal(name):
    return re.sub(r"[-_.]+", "-", re.match(r"[\w.-]+", name)[0]).lower()


def declared(*groups):
    return {normal(requirement) for group in groups for requirement in GROUPS[group]}


@cache
def imported(folders):
    """Return the modules of others that files import, with one of the files."""
    found = {}
    for folder in folders:
        for path in (ROOT / folder).rglob("*.py"):  # without the links to the parts
            if {"_build", "auto_gallery"}.isdisjoint(path.parts):
                found |= {name.partition(".")[0]: path for name in names(ast.parse(path.read_text(encoding="utf-8")))}
    beside = {path.stem for path in (ROOT / "tests" / "tools").glob("*_path/*.py")}
    own = {*PRODUCT, *EVIDENCE, *sys.stdlib_module_names, *beside}
    return {name: path for name, path in found.items() if name not in own}


def names(tree):
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (each.name for each in node.names)
        elif isinstance(node, ast.ImportFrom) and not node.level:
            yield node.module
        elif isinstance(node, ast.Call):
            called = getattr(node.func, "attr", getattr(node.func, "id", ""))
            if called in ("import_module", "importorskip"):
                yield from (word.value for word in node.args[:1] if isinstance(word, ast.Constant))


def distributions(module):
    """Return the packages that bring a module; Debian's metadata know some of them by other names, or not at all."""
    if module in FINITE_ELEMENTS:
        return {"dolfinx-solver-real"}
    known = KNOWN.get(module, [])
    return {normal(name.partition(".-debian")[0]) for name in known} | {normal(DISTRIBUTIONS.get(module, module))}


def test_the_product_imports_what_is_declared():
    found = imported(PRODUCT)
    assert len(found) > 20
    missing = [f"{module} of {path}" for module, path in found.items()
               if not distributions(module) & declared(EXTRAS.get(module, ""))]  # fmt: skip
    assert not missing


def test_evidence_imports_what_is_declared():
    missing = [f"{module} of {path}" for module, path in imported(EVIDENCE).items()
               if not distributions(module) & declared(*GROUPS) and module not in UNDECLARED]  # fmt: skip
    assert not missing


def test_what_is_declared_is_imported():
    assert declared("") <= {name for module in imported(PRODUCT) for name in distributions(module)}


@pytest.fixture(scope="module")
def said():
    """The names that the package does not have without the groups, and the commands without help."""
    code = """
import contextlib, io, json, sys
import vanedamp as vd
from vanedamp.studies.cli import main
from vanedamp.studies.commands import COMMANDS
absent, silent = {}, {}
for name in dir(vd):
    try:
        getattr(vd, name)
    except ImportError as error:
        absent[name] = str(error)
for name in COMMANDS.own():
    try:
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()) as error:
            silent[name] = main([name, "--help"]), error.getvalue()
    except SystemExit as end:
        assert end.code == 0
print(json.dumps([absent, silent]))
"""
    done = subprocess.run([sys.executable, "-c", code], env=bare(), capture_output=True, text=True, check=True)
    return json.loads(done.stdout)


def test_names_that_need_finite_elements_say_so(said):
    assert sorted(said[0]) == ["assemble", "campbell", "reduce_ring", "ring_modes", "solve_modes"]
    for line in said[0].values():
        assert line.startswith("needs mpi4py, which cannot be loaded") and "pip install 'vanedamp[fem]'" in line


def test_commands_need_no_group_for_their_help(said):
    assert said[1] == {}
