"""The report: its numbers and curves are those of the files, and it fetches nothing."""

import base64
import csv
import hashlib
import io
import json
import re
import shutil
import subprocess
from dataclasses import replace

import numpy as np
import pytest

from tests.tools.input_files import OSCILLATOR, RESONANCE
from tests.tools.processes import PATIENCE
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.coupling.sweep.record import Sweep
from vanedamp.coupling.sweep.sweep import sweep
from vanedamp.files.store import Variable, load, save, write_json
from vanedamp.files.toml_input import InputError, validate
from vanedamp.rom.recovery import hot_spots
from vanedamp.rom.reduced import ReducedModel
from vanedamp.studies.cli import main
from vanedamp.studies.kinds.modes import page as modes_section
from vanedamp.studies.report.forced_response import forced_responses, linear_curves
from vanedamp.studies.report.forced_response_charts import energy_figure, jumps
from vanedamp.studies.report.mode_chart import sharp_edges, surface, viewpoint
from vanedamp.studies.report.page import body_note, write_report
from vanedamp.studies.report.results import collect

FREQUENCIES = (np.linspace(0.97, 1.02, 7) * RESONANCE).tolist()
ONE, TWO = (f"rigid model (sweep_{name}), frequency = 15.9155 Hz" for name in ("one", "two"))


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """A folder with results of every kind: modes of a block, a reduced model, two sweeps, and what is none of them."""
    folder = tmp_path_factory.mktemp("results")
    (folder / "case.toml").write_text(
        '[mesh]\ngenerator="block"\nlength=0.1\nwidth=0.02\nthickness=0.01\ndivisions=[6,2,1]\n'
        "[material.default]\nyoung=2e11\npoisson=0.3\ndensity=8000.0\ndamping_ratio=0.01\nfatigue_strength=4e8\n"
        '[support]\nclamped=["root"]\n[modes]\ncount=3\ndirection=[0,0,1]\n'
        '[interface.tip]\nfacets="tip"\ndirection=[0,0,1]\n'
    )
    assert main(["modal", str(folder / "case.toml"), "-o", str(folder / "modes.h5")]) == 0
    assert main(["reduce", str(folder / "case.toml"), "--modes", "2", "-o", str(folder / "rom.h5")]) == 0
    along = {"excitation.frequency": FREQUENCIES}
    sweep(validate(Scene, OSCILLATOR | {"sweep": along}, "x")).save(folder / "sweep_one.h5")
    two = {"cavity.c1.gap": [2e-4, 4e-4], "excitation.frequency": FREQUENCIES}
    sweep(validate(Scene, OSCILLATOR | {"sweep": two}, "x")).save(folder / "sweep_two.h5")
    scene = validate(Scene, OSCILLATOR, "x")
    simulate(scene, events=True, samples_per_period=20).save(folder / "run.h5", {"scene": scene.to_dict()})
    map_ = {"cavity.c1.gap": [4e-4, 2e-4, 3e-4, 1e-4], "excitation.frequency": FREQUENCIES}
    sweep(validate(Scene, OSCILLATOR | {"sweep": map_}, "x")).save(folder / "fig9_gaps.h5")
    claims = [
        {"claim": "Half is < enough", "ours": "0.5", "verdict": "shown"},
        {"claim": "Half is too much", "ours": "0.5", "verdict": "not shown", "why": "no air", "figures": {"peak": 0.5}},
    ]
    study = {"study": "fig9", "title": "Four gaps", "sources": ["fig9_gaps.h5"], "claims": claims}
    write_json(folder / "fig9.claims.json", study)
    save(folder / "other.h5", "something", {"peak": Variable(np.zeros(3), ("period",))})
    return folder


@pytest.fixture(scope="module")
def page(results):
    write_report(collect([results]), results / "report.html")
    return (results / "report.html").read_text(encoding="utf-8")


def charts(page):
    """The traces of all charts by the id of their element, arrays decoded."""
    found = {}
    for match in re.finditer(r'Plotly\.newPlot\(\s*"([\w-]+)",\s*', page):
        traces, _ = json.JSONDecoder().raw_decode(page, match.end())
        found[match.group(1)] = [{key: decoded(value) for key, value in trace.items()} for trace in traces]
    return found


def names_of(traces):
    """The responses to which the curves of a chart belong."""
    return {name for trace in traces for name in trace["meta"]["curves"]}


def decoded(value):
    if isinstance(value, dict) and "bdata" in value:
        return np.frombuffer(base64.b64decode(value["bdata"]), value["dtype"])
    return value


def test_curves_are_in_the_page(page, results):
    found = charts(page)
    kinds = ("response", "mistuning", "energy")
    expected = {f"{kind}-{group}" for kind in kinds for group in (0, 1)}
    expected |= {"summary-0", "history-0", "map-0", "mode-0"}
    assert set(found) == expected
    one, two = (Sweep.load(results / f"sweep_{name}.h5") for name in ("one", "two"))
    expected = {
        f"{ONE}, c1.gap = 200 µm": (one, ()),
        f"{TWO}, c1.gap = 200 µm": (two, (0,)),
        f"{TWO}, c1.gap = 400 µm": (two, (1,)),
    }
    traces = found["response-0"]
    assert names_of(traces) == set(expected)
    for name, (record, point) in expected.items():
        for title, measure in {"damped, maximum": "amplitude_max", "damped, mean of peaks": "amplitude_mean"}.items():
            (trace,) = (t for t in traces if t["meta"]["curves"] == [name] and t["name"] == title)
            np.testing.assert_allclose(trace["x"], FREQUENCIES)
            np.testing.assert_allclose(trace["y"], getattr(record, measure)[point] / 1e-3)
    # gaps do not change the linear curves: drawn once
    for title, measure in {"without bodies": "amplitude_undamped", "bodies fixed": "amplitude_fixed"}.items():
        (trace,) = (t for t in traces if t["name"] == title)
        assert set(trace["meta"]["curves"]) == set(expected)
        at = np.searchsorted(trace["x"], FREQUENCIES)
        np.testing.assert_array_equal(trace["x"][at], FREQUENCIES)
        np.testing.assert_allclose(trace["y"][at], getattr(one, measure) / 1e-3)
        # between the points as well: the peak itself is there
        assert trace["y"].max() == pytest.approx(float(one.peaks[f"{measure.split('_')[1]}_peak"]) / 1e-3, rel=1e-3)
        assert len(trace["x"]) > 20 * len(FREQUENCIES)
    attached = next(t for t in found["mistuning-0"] if t["meta"]["curves"] == [f"{ONE}, c1.gap = 200 µm"])
    np.testing.assert_allclose(attached["y"], one.attached_mass_fraction)
    shares = [t for t in found["energy-0"] if t["stackgroup"] == "0-0"]
    np.testing.assert_allclose(np.sum([t["y"] for t in shares], axis=0), 100.0)


def test_time_history_is_that_of_the_run(page, results):
    values, _ = load(results / "run.h5", "response")
    structure, impacts, body = charts(page)["history-0"]
    np.testing.assert_allclose(structure["x"], 1e3 * values["time"])
    np.testing.assert_allclose(structure["y"], 1e6 * values["displacement"])
    np.testing.assert_allclose(body["y"], 1e6 * values["body_displacement"][:, 0])
    np.testing.assert_allclose(impacts["x"], 1e3 * values["event_time"][values["event_kind"] == "impact"])
    assert len(impacts["x"]) > 5
    # the body is at a wall when it hits
    at = np.interp(impacts["x"], body["x"], np.abs(body["y"]))
    assert np.median(at) > 0.9 * 1e6 * 1e-4


def test_map_is_in_order_of_its_axes(page, results):
    record = Sweep.load(results / "fig9_gaps.h5")
    (trace,) = charts(page)["map-0"]
    np.testing.assert_allclose(trace["y"], [100, 200, 300, 400])
    values = np.reshape(trace["z"], (4, len(FREQUENCIES))) if np.ndim(trace["z"]) == 1 else trace["z"]
    np.testing.assert_allclose(values, record.amplitude_mean[[3, 1, 2, 0]] / 1e-3)


def test_study_has_its_claims_and_its_sweeps(page):
    assert re.search('<h2 id="[^"]+">Forced response: Four gaps</h2>', page)
    energies, claims = page.index("Where the energy goes</h2>"), page.index("Claims of the studies</h2>")
    assert page.index("Forced response: Four gaps") < energies < claims < page.rindex("Four gaps</h3>")
    assert "Half is &lt; enough" in page
    for verdict in ("shown", "not shown"):
        assert re.search(rf'class="verdict \w+">{verdict}<', page)
    names = names_of(charts(page)["response-1"])
    assert names == {f"gaps, c1.gap = {gap} µm" for gap in (100, 200, 300, 400)}


def test_every_chart_has_its_data_and_their_provenance(page, results):
    links = dict(re.findall(r'download="([\w-]+)\.csv" href="data:text/csv;charset=utf-8;base64,([^"]+)"', page))
    assert set(links) == set(charts(page)) | {"motion-0"}
    table = list(csv.DictReader(io.StringIO(base64.b64decode(links["response-0"]).decode())))
    record = Sweep.load(results / "sweep_one.h5")
    mine = [row for row in table if row["response"] == f"{ONE}, c1.gap = 200 µm"]
    np.testing.assert_array_equal([float(row["damped_mean"]) for row in mine], record.amplitude_mean)
    np.testing.assert_array_equal([float(row["excitation.frequency"]) for row in mine], FREQUENCIES)
    for anchor in re.findall(r'href="#([\w-]+)"', page):
        assert f'id="{anchor}"' in page
    assert hashlib.sha256((results / "sweep_one.h5").read_bytes()).hexdigest() in page


def test_surface_of_blocks_is_closed_and_outside():
    """Twelve tetrahedra or two hexahedra fill a bar: area and volume by the divergence theorem."""
    points = np.array([[x, y, z] for x in (0.0, 1.0, 2.0) for y in (0.0, 1.0) for z in (0.0, 1.0)])
    hexahedra = np.array([[0, 4, 6, 2, 1, 5, 7, 3], [4, 8, 10, 6, 5, 9, 11, 7]])
    split = [[0, 1, 2, 6], [0, 2, 3, 6], [0, 3, 7, 6], [0, 7, 4, 6], [0, 4, 5, 6], [0, 5, 1, 6]]
    for cells in (hexahedra, hexahedra[:, split].reshape(-1, 4)):
        triangles = surface(cells)
        a, b, c = points[triangles].transpose(1, 0, 2)
        normals = np.cross(b - a, c - a) / 2
        assert np.linalg.norm(normals, axis=1).sum() == pytest.approx(10.0)
        assert np.einsum("ij,ij->", normals, (a + b + c) / 9) == pytest.approx(2.0)
        lengths = np.linalg.norm(np.diff(points[sharp_edges(points, triangles)], axis=1), axis=-1)
        assert lengths.sum() == pytest.approx(16.0)  # no edge across a flat side


def test_hot_spots_are_marked_where_the_stress_is_largest(results, tmp_path):
    rom = tmp_path / "rom.h5"
    assert main(["reduce", str(results / "case.toml"), "--modes", "2", "--hot-spots", "2", "-o", str(rom)]) == 0
    write_report(collect([rom, results / "modes.h5"]), tmp_path / "report.html")
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    mesh, spots = charts(text)["spots-0"]
    facts = hot_spots(ReducedModel.load(rom))
    assert spots["text"] == list(facts)
    first = 1e3 * np.array(facts["hot1"]["coordinates"])
    assert [spots[axis][0] for axis in "xyz"] == pytest.approx(first)
    # nodes have the largest stress of their cells, in MPa per um
    stress, places = np.array(mesh["intensity"]), np.column_stack([mesh[axis] for axis in "xyz"])
    own = stress[np.argmin(np.linalg.norm(places - first, axis=1))]
    assert own == pytest.approx(stress.max(), rel=0.01)
    assert own == pytest.approx(1e-12 * facts["hot1"]["per_amplitude"]["von_mises"], rel=0.01)
    error = facts["hot1"]["error"]
    assert f"MPa (+- {100.0 * error:.2g} % by the mesh) per um of tip" in text
    assert error > 0.3 and "the mesh leaves open" in text


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("chromium") is None, reason="needs chromium")
def test_browser_shows_the_page_without_a_complaint(page, results):
    """Requests to hosts would fail, and be told: no name is resolved."""
    command = [
        "chromium", "--headless", "--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader",
        "--enable-unsafe-swiftshader", "--enable-logging=stderr", "--host-resolver-rules=MAP * ~NOTFOUND",
        f"--timeout={1000 * PATIENCE:.0f}", "--dump-dom", f"file://{results / 'report.html'}",
    ]  # fmt: skip
    finished = subprocess.run(command, capture_output=True, text=True, check=True)
    assert finished.stdout.count("main-svg") >= 2 * len(charts(page))
    told = [line for line in finished.stderr.splitlines() if "CONSOLE" in line and "willReadFrequently" not in line]
    assert told == []


def test_page_begins_with_contents_and_the_answer(results, tmp_path):
    """Every heading is in the contents, and the summary has the best curve of the sweeps."""
    write_report(collect([results]), tmp_path / "titled.html", "Stage 3 <shroud>")
    text = (tmp_path / "titled.html").read_text(encoding="utf-8")
    assert "<title>Stage 3 &lt;shroud&gt;</title>" in text
    assert "<h1>Stage 3 &lt;shroud&gt;</h1>" in text
    headings = dict(re.findall('<h2 id="([^"]+)">(.*?)</h2>', text, flags=re.DOTALL))
    assert dict(re.findall('<li><a href="#([^"]+)">(.*?)</a>', text, flags=re.DOTALL)) == headings
    ratios = [
        (record.amplitude_mean_dynamic.max(axis=-1) / record.peaks["undamped_peak"]).min()
        for record in (Sweep.load(results / f"{name}.h5") for name in ("sweep_one", "sweep_two", "fig9_gaps"))
    ]
    assert f"{min(ratios):.1%} is left" in text
    assert f"{1e3 * validate(Scene, OSCILLATOR, 'x').damper[0].mass:.4g} g" in text
    (shape,) = charts(text)["mode-0"][1:2]
    assert np.ptp(shape["x"]) == pytest.approx(100.0, rel=0.1)  # mm


def test_lines_end_where_the_response_jumps():
    x = np.linspace(0.0, 1.0, 41)
    smooth = 0.2 + 0.5 * np.exp(-(((x - 0.5) / 0.2) ** 2))
    sure = np.zeros(len(x))
    assert len(jumps(smooth, sure, 1.0)) == 0
    jumped = smooth - 0.2 * (np.arange(len(x)) >= 24)
    assert jumps(jumped, sure, 1.0).tolist() == [24]
    assert len(jumps(jumped, sure + 0.2, 1.0)) == 0  # the step may be chance
    assert len(jumps(smooth[:1], sure[:1], 1.0)) == 0


def test_page_fetches_nothing(page):
    markup = re.sub(r"<script>.*?</script>", "", page, flags=re.DOTALL)
    assert not re.search(r"""(?:src|href|url)\s*[=(]\s*["']?(?:https?:)?//""", markup)
    assert not re.search(r"<script[^>]+src", page)
    assert "@import" not in markup


def test_tables_hold_the_results(page, results):
    for frequency in ReducedModel.load(results / "rom.h5").natural_frequencies_hz:
        assert f"{frequency:.2f}" in page
    for text in ("effective masses", "rigid model", "mesh_sha256", "damper.0.restitution"):
        assert text.lower() in page.lower()


def test_files_of_other_kinds_are_passed_over_in_folders_only(results):
    assert len(collect([results]).kinds["sweep"]) == 3
    with pytest.raises(InputError, match=r"other.h5: holds no result"):
        collect([results / "other.h5"])


def test_sweeps_alone_make_a_page(results, tmp_path):
    write_report(collect([results / "sweep_one.h5"]), tmp_path / "report.html")
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert set(charts(text)) == {"summary-0", "response-0", "mistuning-0", "energy-0"}
    assert ">Modes</h2>" not in text


def test_page_without_a_picture_says_so(results, tmp_path, monkeypatch):
    monkeypatch.setattr(modes_section, "mode_picture", lambda *_: None)
    monkeypatch.setattr(modes_section, "small_surface", lambda _: None)
    write_report(collect([results / "modes.h5"]), tmp_path / "report.html")
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "No picture: this machine cannot render one" in text
    assert "Plotly" not in text
    with pytest.raises(InputError, match=r"take vanedamp export MODES.h5 -o FILE.vtkhdf"):
        modes_section.figure(load(results / "modes.h5", "modes"))


GAPS = [1e-5, 5e-5, 1e-4, 2e-4, 3e-4, 4e-4, 5e-4, 6e-4, 7e-4, 8e-4, 1e-3, 2e-3]


@pytest.fixture(scope="module")
def many(tmp_path_factory):
    """A sweep with a dozen curves, the last of which is nowhere steady, and its report."""
    folder = tmp_path_factory.mktemp("many")
    axes = {"cavity.c1.gap": GAPS, "excitation.frequency": FREQUENCIES}
    found = sweep(validate(Scene, OSCILLATOR | {"sweep": axes}, "x"))
    status = found.status.copy()
    status[-1] = "not_steady"
    replace(found, status=status).save(folder / "gaps.h5")
    write_report(collect([folder / "gaps.h5"]), folder / "report.html")
    return folder


def test_the_best_curves_come_first_and_all_are_there(many):
    page = (many / "report.html").read_text(encoding="utf-8")
    record = Sweep.load(many / "gaps.h5")
    ratios = [float(text) for text in re.findall(r"<td><b>([\d.]+)</b></td>", page)]
    mean = np.where(record.status == "ok", record.amplitude_mean, -np.inf)
    # that of the widest gap comes last
    best = mean.max(axis=1)[:-1] / float(record.peaks["undamped_peak"][0])
    assert ratios == pytest.approx(np.sort(best), abs=6e-4)
    assert "<td><b>none</b></td>" in page
    damped = [t for t in charts(page)["response-0"] if t["name"] == "damped, mean of peaks"]
    assert len(damped) == len(GAPS)
    drawn = [t.get("visible", True) for t in damped]
    assert drawn == [True] * 8 + [False] * 4
    assert np.nanmax(damped[0]["y"]) == pytest.approx(best.min())


def test_curves_are_picked_and_sorted_in_the_page(many, browser):
    page = browser.new_page()
    complaints = []
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.goto((many / "report.html").as_uri())
    page.wait_for_function("document.querySelectorAll('.js-plotly-plot .main-svg').length > 0")
    drawn = "document.getElementById('response-0').data.filter(t => t.visible !== false).map(t => t.meta.curves).flat()"
    last = page.locator(".curves tbody tr").last.locator("input")
    name = last.get_attribute("value")
    assert page.evaluate(f"({drawn}).filter(name => name === {json.dumps(name)}).length") == 2  # the linear curves
    last.check()
    assert page.evaluate(f"({drawn}).filter(name => name === {json.dumps(name)}).length") == 4
    gaps = "[...document.querySelectorAll('.curves tbody input')].map(box => parseFloat(box.value.split('= ')[1]))"
    heading = page.locator(".curves th button").first
    heading.click()
    assert page.evaluate(gaps) == pytest.approx([1e6 * gap for gap in GAPS])
    heading.press("Enter")
    assert page.evaluate(gaps) == pytest.approx([1e6 * gap for gap in GAPS[::-1]])
    assert complaints == []


def test_linear_curves_of_a_structure_that_is_no_longer_there_are_those_of_the_sweep(many):
    record = Sweep.load(many / "gaps.h5")
    (response, *_) = forced_responses(record)
    fine = linear_curves(record, response)
    assert len(fine.x) > len(response.x)
    other = replace(record, scene=record.scene.replace({"structure.mass": 1.001}))
    np.testing.assert_array_equal(linear_curves(other, response).x, response.x)


def test_energies_have_gaps_where_points_are_not_ok(many):
    record = Sweep.load(many / "gaps.h5")
    status = record.status.copy()
    status[:-1, 3] = "not_steady"
    figure = energy_figure(forced_responses(replace(record, status=status)))
    first = [trace for trace in figure.data if trace.stackgroup.startswith("0-") and trace.name == "viscous"]
    assert [trace.x.tolist() for trace in first] == [FREQUENCIES[:3], FREQUENCIES[4:]]
    assert all(np.isfinite(trace.y).all() for trace in figure.data)
    assert tuple(figure.layout.xaxis.range) == (FREQUENCIES[0], FREQUENCIES[-1])


def test_facts_of_several_files_stand_once(results, page):
    """A model and its modes come from one mesh: its facts are those of both."""
    both = page.index("<h3>modes.h5, rom.h5</h3>")
    (young,) = re.finditer(r"<code>matrices\.materials\.\w+\.young</code>", page)
    assert young.start() > both
    assert re.search(r'id="from-rom-h5">rom.h5</h3>', page)


def test_notes_on_sliders_agree_with_the_scene():
    block = {"shape": "block", "length": 0.01, "height": 0.005, "restitution": 0.6, "mass": 0.01, "cavity": "c2"}
    slider = OSCILLATOR["damper"][0]
    cavities = [*OSCILLATOR["cavity"], {"name": "c2", "gap": 2e-4, "play": 1e-5}]
    for dampers, begin in (
        ([slider], "The body is a slider"),
        ([slider, slider | {"cavity": "c2"}], "The bodies are sliders"),
        ([block, slider], "Sliders, here body 2, move"),
    ):
        note = body_note({}, validate(Scene, OSCILLATOR | {"cavity": cavities, "damper": dampers}, "x"))
        assert note is not None and note.startswith(begin)
    assert body_note({}, validate(Scene, OSCILLATOR | {"cavity": cavities, "damper": [block]}, "x")) is None


def test_names_are_escaped(results, tmp_path):
    found = sweep(validate(Scene, OSCILLATOR | {"sweep": {"excitation.frequency": FREQUENCIES[:2]}}, "x"))
    found.save(tmp_path / "a<b>.h5")
    write_report(collect([tmp_path / "a<b>.h5"]), tmp_path / "report.html")
    assert "a<b>" not in (tmp_path / "report.html").read_text(encoding="utf-8")


def test_a_sweep_that_failed_everywhere_still_makes_a_page(results, tmp_path, monkeypatch):
    from vanedamp.coupling.sweep import worker

    def broken(*_: object, **__: object) -> None:
        raise ZeroDivisionError("everywhere")

    monkeypatch.setattr(worker, "kind_of", lambda *_: None)  # points run one by one
    monkeypatch.setattr(worker, "simulate", broken)
    sweep(validate(Scene, OSCILLATOR | {"sweep": {"excitation.frequency": FREQUENCIES}}, "x")).save(tmp_path / "bad.h5")
    write_report(collect([tmp_path]), tmp_path / "report.html")
    assert "7 of 7 points are left out, which are not ok." in (tmp_path / "report.html").read_text(encoding="utf-8")


def test_files_of_the_same_name_are_told_apart(results, tmp_path):
    for folder in ("stiff", "soft"):
        (tmp_path / folder).mkdir()
        shutil.copy(results / "sweep_one.h5", tmp_path / folder / "sweep.h5")
    write_report(collect([tmp_path / "stiff", tmp_path / "soft"]), tmp_path / "report.html")
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    names = names_of(charts(page)["response-0"])
    assert names == {"rigid model (stiff/sweep)", "rigid model (soft/sweep)"}
    assert {'id="from-stiff-sweep-h5"', 'id="from-soft-sweep-h5"'} <= set(re.findall(r'id="[\w-]+"', page))


def test_scenes_say_what_they_share_and_what_is_their_own(results, tmp_path):
    for number in range(6):
        case = OSCILLATOR | {"damper": [OSCILLATOR["damper"][0] | {"friction": 0.1 * number}]}
        sweep(validate(Scene, case | {"sweep": {"excitation.frequency": FREQUENCIES[:2]}}, "x")).save(
            tmp_path / f"case{number}.h5"
        )
    for files, told in (
        (2, "<th>case0.h5</th><th>case1.h5</th>"),
        (6, "<td>case5.h5</td><td><code>damper.0.friction</code> = 0.5</td>"),
    ):
        write_report(collect([tmp_path / f"case{number}.h5" for number in range(files)]), tmp_path / "report.html")
        page = (tmp_path / "report.html").read_text(encoding="utf-8")
        assert told in page
        assert page.count("<td><code>damper.0.restitution</code></td><td>0.6</td>") == 1


@pytest.mark.parametrize("side", [-1.0, 1.0])
@pytest.mark.parametrize("axis", [0, 1])
def test_a_mode_is_seen_from_the_side_that_moves(axis, side):
    """A plate that is held hides a plate that moves, unless one looks from the other side."""
    other = 1 - axis
    across, up = (part.ravel() for part in np.meshgrid(np.linspace(-1, 1, 21), np.linspace(-1, 1, 21)))
    points = np.zeros((2, len(up), 3))
    points[:, :, other], points[:, :, 2] = across, up
    points[0, :, axis], points[1, :, axis] = -side, side
    shape = np.zeros_like(points)
    shape[1, :, other] = 1.0
    view = viewpoint(points.reshape(-1, 3), shape.reshape(-1, 3))
    assert np.linalg.norm(view) == pytest.approx(1.0)
    assert side * view[axis] > 0.5
    assert view[2] > 0
