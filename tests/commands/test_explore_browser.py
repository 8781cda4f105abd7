"""The page of `vanedamp explore` in a browser: sliders move the curve, the scene that it writes gives its figures."""

import json
import signal
import subprocess
import sys
import time

import pytest

from tests.commands.test_interrupts import heed_interrupts
from tests.tools.input_files import SCENE
from tests.tools.processes import PATIENCE, environment, without_stages
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.sweep.sweep import sweep
from vanedamp.studies.report.forced_response import forced_responses

pytest.importorskip("dash", reason="the page is made with dash")
playwright = pytest.importorskip("playwright.sync_api", reason="needs playwright: pip install playwright")

DONE = "60 frequencies"


class Visit:
    """A page in a browser, with all that it asks for and complains of."""

    def __init__(self, browser, address):
        self.page = browser.new_page()
        self.requests, self.complaints, self.figures = [], [], []
        self.page.route("**/*", self._route)
        self.page.on("console", lambda message: self.complaints.append(message.text))
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.page.on("response", self._note)
        self.page.goto(address)
        self.settled()

    def _route(self, route):
        self.requests.append(route.request.url)
        route.continue_()

    def _note(self, response):
        if response.request.method == "POST" and response.status == 200:
            figure = response.json().get("response", {}).get("curve", {}).get("figure")
            if figure:
                self.figures.append(figure)

    def settled(self):
        """Wait for the fine curve of what is asked for now."""
        playwright.expect(self.page.locator("#message")).to_have_text(DONE, timeout=1000 * PATIENCE)

    def changed(self, action):
        """Do something that moves the curve, and return its path before and after."""
        before = self.path()
        action()
        deadline = time.monotonic() + PATIENCE
        while self.path() == before and time.monotonic() < deadline:
            self.page.wait_for_timeout(20)
        self.settled()
        return before, self.path()

    def path(self):
        """Path of the damped mean in the picture."""
        return self.page.locator("#curve .scatterlayer .trace").nth(3).locator("path.js-line").get_attribute("d")

    def field(self, name):
        return self.page.locator(f"#number-{name}").input_value()


@pytest.fixture
def visit(tmp_path, browser):
    """Open the page of a scene; at its end nothing came from elsewhere and nothing was complained of."""
    (tmp_path / "scene.toml").write_text(SCENE)
    command = [sys.executable, "-m", "vanedamp", "explore", "scene.toml", "-o", "out.toml", "--no-browser"]
    server = subprocess.Popen(
        command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment(),
        preexec_fn=heed_interrupts,
    )  # fmt: skip
    address = server.stdout.readline().strip()
    try:
        visits = []

        def open_page():
            visits.append(Visit(browser, address))
            return visits[-1]

        yield open_page
        host = address.split("?")[0]
        for seen in visits:
            assert all(url.startswith((host, "data:", "blob:")) for url in seen.requests)
            assert seen.complaints == []
            seen.page.close()
    finally:
        server.send_signal(signal.SIGINT)
        _, error = server.communicate(timeout=PATIENCE)
    assert without_stages(error) == "vanedamp: interrupted\n"


def test_sliders_move_the_curve_and_the_written_scene_gives_its_figures(visit, tmp_path):
    seen = visit()
    page = seen.page
    page.get_by_label("gap", exact=True).focus()
    before, after = seen.changed(lambda: [page.keyboard.press("ArrowRight") for _ in range(5)])
    assert before != after and float(seen.field("gap")) > 200

    before, after = seen.changed(lambda: drag(page, "#slider-restitution", 0.95))
    assert before != after and float(seen.field("restitution")) > 0.85

    field = page.get_by_label("mass of a body, g")
    before, after = seen.changed(lambda: (field.fill("30"), field.press("Enter")))
    assert before != after

    field.fill("much")
    message = page.locator("#message")
    playwright.expect(message).to_have_text(
        "mass of a body: expected a number in g, not 'much'", timeout=1000 * PATIENCE
    )
    playwright.expect(page.locator("#frame")).to_have_class("old")
    assert seen.path() == after

    with page.expect_download() as download:
        page.get_by_role("button", name="write scene").click()
    saved = download.value.path().read_text()
    playwright.expect(page.locator("#written")).to_contain_text("out.toml written")
    (tmp_path / "saved.toml").write_text(saved)
    written = Scene.load(tmp_path / "saved.toml")
    assert Scene.load(tmp_path / "out.toml").to_dict() == written.to_dict()
    assert [damper.mass for damper in written.damper] == [0.03]
    (response,) = forced_responses(sweep(written))
    *_, maximum, mean = seen.figures[-1]["data"]
    assert mean["customdata"] == pytest.approx(response.x, rel=1e-12)
    assert mean["y"] == pytest.approx(response.damped_mean / response.reference, rel=1e-12)
    assert maximum["y"] == pytest.approx(response.damped_max / response.reference, rel=1e-12)


@pytest.mark.slow
def test_every_control_is_reached_by_the_keyboard_and_named(visit):
    page = visit().page
    names = page.locator("input").evaluate_all("inputs => inputs.map(input => input.id)")
    reached = []
    page.locator("body").press("Tab")
    for _ in range(3 * len(names)):
        focused = page.locator(":focus")
        reached.append(focused.get_attribute("id") if focused.count() else None)
        page.keyboard.press("Tab")
    assert {*names, "write"} <= set(reached)
    for name in names:
        assert page.locator(f'label[for="{name}"]').inner_text()


@pytest.mark.slow
def test_tabs_are_independent(visit):
    one, other = visit(), visit()
    kept = other.path()
    before, after = one.changed(lambda: drag(one.page, "#slider-gap", 0.8))
    assert before == kept != after
    other.page.wait_for_timeout(500)
    assert other.path() == kept
    other.page.reload()
    other.settled()
    assert other.field("gap") == "200"


@pytest.mark.slow
def test_a_fast_drag_leaves_no_requests_behind(visit):
    seen = visit()
    waiting, most = set(), []

    def begin(request):
        if request.method == "POST":
            waiting.add(request)
            most.append(len(waiting))

    seen.page.on("request", begin)
    seen.page.on("requestfinished", lambda request: waiting.discard(request))
    box = seen.page.locator("#slider-gap").bounding_box()
    seen.page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    seen.page.mouse.down()
    for step in range(150):
        seen.page.mouse.move(box["x"] + box["width"] * (0.2 + step % 50 / 100), box["y"] + box["height"] / 2)
    asked = len(most)
    seen.page.mouse.up()
    seen.settled()
    seen.page.wait_for_timeout(1000)
    assert max(most) <= 2  # the rest of an old curve, and the newest
    assert asked < 150 and not waiting
    shown = seen.figures[-1]["layout"]["meta"]
    assert shown["complete"] and json.dumps(shown["version"])


def drag(page, slider, share):
    """Drag a slider's handle to a share of its width."""
    box = page.locator(slider).bounding_box()
    middle = box["y"] + box["height"] / 2
    page.mouse.move(box["x"] + box["width"] / 2, middle)
    page.mouse.down()
    page.mouse.move(box["x"] + box["width"] * share, middle, steps=8)
    page.mouse.up()
