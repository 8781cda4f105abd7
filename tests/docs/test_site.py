"""The documentation site: its reference is complete, the search finds every key, the whole builds and leads on."""

import ast
import dataclasses
import json
import pkgutil
import re
import subprocess
import sys
from importlib import import_module
from itertools import pairwise
from pathlib import Path
from urllib.parse import quote

import pytest

pytest.importorskip("sphinx", reason="needs the extra docs")
pytest.importorskip("myst_parser", reason="needs the extra docs")

from docs._ext import commands, pages, python_api, toml_keys
from docs._ext.fields import _texts, described
from docs.check_site import faults
from tests.tools.input_files import SCENE
from tests.tools.processes import PATIENCE, ROOT, environment
from tests.tools.schemas import shipped_schemas
from vanedamp.coupling.quantities import quantity
from vanedamp.coupling.response.response import Event, Response, Status
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.files.reference import options
from vanedamp.files.store import load_any
from vanedamp.studies import kinds
from vanedamp.studies.commands import COMMANDS
from vanedamp.studies.file_kinds import KINDS

DOCS = ROOT / "docs"
#: a small file of every kind of result
WRITTEN = ROOT / "tests" / "files" / "written"
CHROMIUM = Path("/usr/bin/chromium")


# keys of the input files


def keys_of(kind: str) -> set[str]:
    """Dotted names of all keys and tables in a schema, found otherwise than the reference does."""
    schema, found = shipped_schemas()[kind], set()

    def descend(node: dict, path: str) -> None:
        for option in options(schema, node):
            if "x-inline" in option:
                continue
            if isinstance(option.get("items"), dict):
                descend(option["items"], path)
            for name, inner in option.get("properties", {}).items():
                found.add(f"{path}{name}")
                descend(inner, f"{path}{name}.")
            if isinstance(others := option.get("additionalProperties"), dict):
                descend(others, f"{path}<name>.")

    descend(schema, "")
    return found


@pytest.mark.parametrize("kind", KINDS)
def test_reference_has_every_key(kind):
    written = set()
    for table in toml_keys.tables(shipped_schemas()[kind]):
        written |= {table.path, table.path.removesuffix(".<name>"), *(table.dotted(key.name) for key in table.keys)}
    assert keys_of(kind) - written == set()
    least = {
        "scene": 90, "case": 60, "study": 100, "life": 100, "external": 8, "pipeline": 15, "identification": 25,
        "contact": 15, "deviations": 5, "design": 50,
    }  # fmt: skip
    assert len(keys_of(kind)) > least[kind]


@pytest.mark.parametrize("kind", KINDS)
def test_keys_have_meanings_units_and_defaults(kind):
    for table in toml_keys.tables(shipped_schemas()[kind]):
        for key in table.keys:
            assert key.meaning, (table.heading, key.name)
            assert not re.search(r"\[(m|N|kg|s|Hz|-)\]", key.meaning), key
    gap, mass = (
        next(key for table in toml_keys.tables(shipped_schemas()["scene"]) if table.path == path for key in table.keys
             if key.name == name)
        for path, name in (("cavity", "gap"), ("damper", "mass"))
    )  # fmt: skip
    assert (gap.value, gap.unit, gap.default) == ("number > 0", "m", "required")
    assert (mass.value, mass.unit) == ("number > 0", "kg")


def test_page_of_files_has_every_kind_and_its_command():
    rows = re.findall(r"^\| (\w+) \|.*\|(.*)\|$", (DOCS / "files.md").read_text(encoding="utf-8"), re.MULTILINE)
    commands_of = dict(rows)
    assert all(f"`{kind.command or kind.name}`" in commands_of[kind.name] for kind in KINDS.values())


def test_anchors_of_keys_differ():
    for kind in KINDS:
        anchors = [t.anchor(key.name) for t in toml_keys.tables(shipped_schemas()[kind]) for key in t.keys]
        assert len(anchors) == len(set(anchors))


# commands


def test_reference_has_every_command_and_option():
    parsers = commands.parsers()
    assert list(parsers) == list(COMMANDS.own())
    text = "\n".join(line for name, parser in parsers.items() for line in commands._lines(name, parser))
    for name, parser in parsers.items():
        assert f".. program:: vanedamp {name}\n" in text
        for action in parser._actions:
            assert all(f" {option}" in text for option in action.option_strings if option not in ("-h", "--help"))
    assert ".. option:: --samples N" in text and "Keep N samples of every period" in text


# results


def results(section: str) -> str:
    """Text of a section of the page of results, its inner ones included."""
    text = (DOCS / "reference" / "results.md").read_text(encoding="utf-8")
    return re.split(r"^## ", text.split(f"\n## {section}\n")[1], flags=re.MULTILINE)[0]


def test_results_are_those_of_a_run(tmp_path):
    """Every figure of the JSON and every variable of the file is on the page, each figure with a docstring."""
    (tmp_path / "scene.toml").write_text(SCENE)
    response = simulate(Scene.load(tmp_path / "scene.toml"), events=True, samples_per_period=4)
    text = results("Response of a run")
    listed, in_file = (names.split() for names in re.findall(r"response:Response\n(.*?)```", text, re.DOTALL))
    in_json = response.to_json() | response.to_xarray().attrs
    known = {*listed, *quantity.table(), "kind", "schema_version", "versions", "provenance"}
    assert in_json.keys() <= known, in_json.keys() - known
    rows = {row.name: row for row in described(Response, in_file)}
    for name, variable in response.to_xarray().variables.items():
        if not name.startswith("event_") and name != "period":
            unit = variable.attrs.get("units", "1").removeprefix("1")
            assert (rows[name].dims, rows[name].unit) == (", ".join(variable.dims), unit), name
    assert f"`{re.sub('[0-9]+', 'k', response.classification)}`" in text


def test_fields_of_results_are_described():
    """Statuses, events and figures: a docstring after each."""
    tree = ast.parse((ROOT / "coupling" / "response" / "response.py").read_text(encoding="utf-8"))
    for record in (Status, Event, Response):
        (body,) = (node.body for node in tree.body if isinstance(node, ast.ClassDef) and node.name == record.__name__)
        pairs = pairwise(body)
        names = set(record.__members__ if record is Status else (item.name for item in dataclasses.fields(record)))
        fields = [
            pair for pair in pairs if isinstance(pair[0], ast.Assign | ast.AnnAssign) and ast.unparse(
                pair[0].target if isinstance(pair[0], ast.AnnAssign) else pair[0].targets[0]) in names
        ]  # fmt: skip
        assert len(fields) == len(names)
        assert all(isinstance(after, ast.Expr) for _, after in fields), record


@pytest.mark.parametrize(
    "name", ["modes", "life", "calibration", "optimisation", "mistuning", "campbell", "ring-modes", "system-matrices"]
)
def test_fields_have_the_dimensions_and_units_of_the_file(name):
    kind, variables, _ = load_any(WRITTEN / f"{name}.h5")
    found = [one for one in described(pkgutil.resolve_name(kinds.kind(kind).RECORD)) if one.dims]
    written = [(one, field) for field in found for one in field.name.split(", ") if one in variables]
    assert len(written) > 2
    for one, field in written:
        assert (field.dims, field.unit or "1") == (", ".join(variables[one].dims), variables[one].units) or (
            name == "calibration" and one.startswith(("response", "fitted"))  # of the quantity
        ), one


@pytest.mark.parametrize("path", sorted(WRITTEN.glob("*.h5")), ids=lambda path: path.stem)
def test_page_of_results_has_all_that_files_contain(path):
    """Variables but those that label a dimension, attributes, and keys of the JSON."""
    kind, variables, attributes = load_any(path)
    text, known = (DOCS / "reference" / "results.md").read_text(encoding="utf-8"), set(quantity.table())
    if (found := kinds.kind(kind)) is not None:
        fields = described(pkgutil.resolve_name(found.RECORD))
        known |= {name for one in fields for name in one.name.split(", ")}
    known |= set(re.findall(r"`([\w.]+)`", text))
    patterns = [re.sub("QUANTITY|AXIS", r"\\w+", name) for name in known if re.search("_(QUANTITY|AXIS)$", name)]
    patterns += [f"{name}\\w+" for name in re.findall(r"`(\w+_)\.\.\.`", text)]
    in_json = path.with_suffix(".json")
    given = {name for name, one in variables.items() if one.dims != (name,)} | attributes.keys()
    given |= json.loads(in_json.read_text()).keys() if in_json.exists() else set()
    assert {name for name in given - known if not re.fullmatch("|".join(patterns), name)} == set()


def test_tables_of_statuses_have_all_of_them():
    assert _texts(Status).keys() == Status.__members__.keys()


def test_results_of_sweeps_are_listed():
    text = results("Quantities")
    assert "```{quantities}\n```" in text and "```{quantities-by-kind}\n```" in text
    assert all(len(one.about) > 10 for one in quantity.table().values())


# Python


def test_modules_have_pages_in_one_tree():
    written = dict(python_api.pages())
    for part in python_api.PARTS:
        for name in part.modules:
            import_module(f"{part.package}.{name}")
        assert python_api.modules(part), part
        assert all(name in written and f"   {name}\n" in written[part.package] for name in python_api.modules(part))
    toctree = (DOCS / "reference" / "python.md").read_text(encoding="utf-8")
    listed = re.findall(r"^(?:api/|   )([\w.-]+)$", toctree + "".join(written.values()), re.MULTILINE)
    assert {name: listed.count(name) for name in written} == dict.fromkeys(written, 1)


def test_docstrings_become_lists_and_examples():
    text = (
        "Return x_ of |y|.\n\nspan   the span, m\n       of a vane\nmass   kg\n\na: first; b: `code` two.\n\n    x = 1"
    )
    assert python_api.restructured(text, ["a", "b"]) == (
        "Return x\\_ of \\|y\\|.\n\n``span``\\ \n   the span, m of a vane\n``mass``\\ \n   kg\n\n"
        "``a``\\ \n   first\n``b``\\ \n   \\ ``code``\\  two\n\n::\n\n    x = 1"
    ).replace("   \\ ``code``", "   ``code``")


def test_examples_have_languages():
    examples = ("[structure]\nmass = 1", "[[damper]]", "import vanedamp", "vanedamp run s.toml", "mesh -> modes")
    assert [pages.language(text) for text in examples] == ["toml", "toml", "python", "shell", "text"]


# spelling and the site


def test_spelling():
    pytest.importorskip("codespell_lib", reason="needs the extra docs")
    words = re.search(r"^SPELLED = (.*)$", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)[1].split()
    done = subprocess.run(
        [sys.executable, "-m", "codespell_lib", *words], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout


def test_faults_of_a_site_are_found(tmp_path):
    (tmp_path / "a.html").write_text(
        '<p id="here"><a href="#here"><a href="b.html#gone"><a href="c.html"><script src="//x.y/z.js">'
    )
    (tmp_path / "b.html").write_text(
        '<a href="https://example.org"><link rel="canonical" href="https://x.y"><a href="a.html#here">'
    )
    (tmp_path / "s.css").write_text("@import url(https://fonts.example.org/a.css)")
    assert list(faults(tmp_path)) == [
        "a.html: loads //x.y/z.js", "a.html: no anchor b.html#gone", "a.html: no file c.html",
        "s.css: loads from another host",
    ]  # fmt: skip


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The whole site, built as `make docs` does, its examples run."""
    folder = tmp_path_factory.mktemp("site")
    done = subprocess.run(
        [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "-n", "-d", str(folder / "doctrees"), "docs",
         str(folder / "html")],
        cwd=ROOT, env=environment(OMP_NUM_THREADS="1"), capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return folder / "html"


@pytest.mark.slow
def test_site_has_no_faults(site):
    assert list(faults(site)) == []


@pytest.mark.slow
def test_search_index_has_every_key(site):
    """By its dotted name, with the page and the anchor that it leads to."""
    text = (site / "searchindex.js").read_text(encoding="utf-8")
    index = json.loads(text.removeprefix("Search.setIndex(").removesuffix(")"))
    found = {
        f"{prefix}.{name}": (index["docnames"][page], anchor)
        for prefix, entries in index["objects"].items()
        for page, kind, _, anchor, name in entries
        if index["objtypes"][str(kind)].startswith("toml:")
    }
    html = {page: (site / f"{page}.html").read_text(encoding="utf-8") for page, _ in found.values()}
    for kind in KINDS.keys() - {"study"}:
        for key in keys_of(kind):
            page, anchor = found[f"{kind}.{key}".replace(toml_keys.NAME, toml_keys.FOUND)]
            assert page == f"reference/{kind}" and f'id="{anchor}"' in html[page]
    assert found["study.optimise.seed"][0] == "reference/study"


@pytest.mark.slow
def test_search_in_a_browser_from_files(site):
    """Without a server: the search finds keys, of tables with names as well, and no page asks for more than files."""
    sync_api = pytest.importorskip("playwright.sync_api", reason="needs playwright")
    if not CHROMIUM.exists():
        pytest.skip("needs chromium")
    asked: list[str] = []
    with sync_api.sync_playwright() as program:
        browser = program.chromium.launch(executable_path=str(CHROMIUM), args=["--no-sandbox"])
        page = browser.new_page()
        page.on("request", lambda request: asked.append(request.url))
        for key in ("normal_load", "base_acceleration", "damper.normal_load", "orientation_deg", "centrifugal_deg"):
            page.goto(f"{(site / 'search.html').as_uri()}?q={key}")
            first = page.locator("#search-results ul.search li a").first
            first.wait_for(timeout=1000 * PATIENCE)
            target = first.get_attribute("href")
            assert target.startswith("reference/scene.html#") and target.endswith(f".{key.split('.')[-1]}"), target
            page.goto(f"{site.as_uri()}/{target}")
            assert page.locator(":target").inner_text() == key.split(".")[-1]
        for asked_for in ("external.interface.<name>.direction", "external.interface.direction"):
            page.goto(f"{(site / 'search.html').as_uri()}?q={quote(asked_for)}")
            first = page.locator("#search-results ul.search li a").first
            first.wait_for(timeout=1000 * PATIENCE)
            assert first.get_attribute("href") == "reference/external.html#interface.name.direction"
            assert first.inner_text() == "external.interface.NAME.direction"
        for name in ("index", "engine", "reference/commands", "tutorial/index", "auto_gallery/index"):
            page.goto((site / f"{name}.html").as_uri())
            page.wait_for_load_state("networkidle")
        browser.close()
    assert len(asked) > 50 and all(url.startswith(("file://", "data:")) for url in asked)
