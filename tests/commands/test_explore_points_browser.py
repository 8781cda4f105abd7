"""Points of a curve and sweep files in a browser: a click shows three views, sliders move through a sweep."""

import base64
import json
import re
import signal
import subprocess
import sys
from contextlib import contextmanager

import numpy as np
import pytest

from tests.commands.test_interrupts import heed_interrupts
from tests.tools.input_files import SCENE, changed
from tests.tools.processes import PATIENCE, environment, until
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.sweep.record import Sweep
from vanedamp.coupling.sweep.sweep import sweep

pytest.importorskip("dash", reason="the page is made with dash")
playwright = pytest.importorskip("playwright.sync_api", reason="needs playwright: pip install playwright")

GAPS = [4e-4, 1e-4, 2e-4]
AXES = f"""
"excitation.frequency" = {{start = 15.4, stop = 16.2, num = 9}}
"cavity.c1.gap" = {GAPS}
"""


@contextmanager
def opened(browser, folder, *words):
    """Open the page of `vanedamp explore`; at its end nothing came from elsewhere and nothing was complained of."""
    server = subprocess.Popen(
        [sys.executable, "-m", "vanedamp", "explore", *words, "--no-browser", "--workers", "1"], cwd=folder,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment(), preexec_fn=heed_interrupts,
    )  # fmt: skip
    try:
        address = server.stdout.readline().strip()
        page = browser.new_page()
        requests, complaints = [], []
        page.on("request", lambda request: requests.append(request.url))
        page.on("console", lambda message: complaints.append(message.text))
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.goto(address)
        yield page
        assert all(url.startswith((address.split("?")[0], "data:", "blob:", "about:")) for url in requests)
        assert complaints == []
        page.close()
    finally:
        server.send_signal(signal.SIGINT)
        server.communicate(timeout=PATIENCE)


def says(page, selector, text):
    playwright.expect(page.locator(selector)).to_contain_text(text, timeout=1000 * PATIENCE)


def click(page, points, number):
    box = page.locator(points).nth(number).bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y, steps=3)
    page.wait_for_timeout(200)  # plotly takes clicks on what hovers
    page.mouse.click(x, y)


def test_click_shows_history_phase_planes_and_motion(tmp_path, browser):
    (tmp_path / "scene.toml").write_text(SCENE)
    with opened(browser, tmp_path, "scene.toml") as page:
        says(page, "#message", "60 frequencies")
        click(page, "#curve .scatterlayer .trace:nth-child(4) .points path", 25)
        says(page, "#point-status", "mean of peaks")
        frequency = float(page.locator("#point-value").input_value())
        assert page.locator("#point-status").inner_text().startswith(f"{frequency:.6g} Hz")
        names = page.locator("#point-history .legendtext").all_text_contents()
        assert {"structure", "body 1 in its cavity"} <= set(names)
        assert page.locator("#point-phase .xaxislayer-above").count() == 2
        page.get_by_text("All quantities").click()
        told = page.locator("#point-quantities")
        assert {"amplitude_rms", "phase", "energy_share"} <= {*told.locator("dt").all_text_contents()}
        assert told.locator("dd").all_text_contents()[0].endswith(" m")
        frame = page.frame_locator("#point-motion")
        playwright.expect(frame.locator("polygon.body")).to_be_visible()

        # without a mouse: the next point, a frequency, nonsense
        page.locator("#point-higher").press("Enter")
        playwright.expect(page.locator("#point-value")).not_to_have_value(re.compile(re.escape(str(frequency))))
        field = page.get_by_label("at excitation frequency, Hz")
        field.fill("15.8")
        field.press("Enter")
        says(page, "#point-status", "15.8 Hz: mean of peaks")
        # beside the resonance the body moves in every period; at the point of a curve that is still coarse it may stick
        before = frame.locator("polygon.body").get_attribute("points")

        def moves():  # the frame may be that of the point before, and be loaded anew as it plays
            if frame.get_by_role("button", name="Play").is_visible():
                frame.get_by_role("button", name="Play").click()
            page.wait_for_timeout(200)
            return frame.locator("polygon.body").get_attribute("points") != before

        until(moves)
        field.fill("-1")
        field.press("Enter")
        says(page, "#point-status", "should be greater than 0")
        playwright.expect(page.locator("#point-views")).to_be_hidden()
        field.fill("15.8")
        field.press("Enter")
        says(page, "#point-status", "15.8 Hz: mean of peaks")
        page.get_by_label("mass of a body, g").fill("30")
        says(page, "#point-stale", "The scene has changed since")
        page.locator("#point-show").click()
        playwright.expect(page.locator("#point-stale")).to_be_empty(timeout=1000 * PATIENCE)


def test_sliders_move_through_a_sweep(tmp_path, browser):
    long = changed(SCENE, ("periods = 90", "periods = 150"), ("transient = 80", "transient = 100"))
    (tmp_path / "scene.toml").write_text(long.split("[sweep]")[0] + "[sweep]" + AXES)
    sweep(Scene.load(tmp_path / "scene.toml")).save(tmp_path / "gaps.h5")
    short = changed(SCENE, ("periods = 90", "periods = 30"), ("transient = 80", "transient = 10"))
    (tmp_path / "scene.toml").write_text(short)
    sweep(Scene.load(tmp_path / "scene.toml")).save(tmp_path / "one.h5")
    record = Sweep.load(tmp_path / "gaps.h5")
    with opened(browser, tmp_path, "gaps.h5", "one.h5") as page:
        says(page, "#sweep-best", "Best of 3 designs")
        slider = page.get_by_role("slider").first
        for place, gap in enumerate(sorted(GAPS)):
            slider.focus()
            page.keyboard.press("Home")
            for _ in range(place):
                page.keyboard.press("ArrowRight")
            says(page, "#sweep-axes strong", f"{1e6 * gap:.4g} µm")
            says(page, "#sweep-status", f"c1.gap = {1e6 * gap:.4g} µm")
            shown = drawn(page)
            np.testing.assert_allclose(shown, 1e6 * record.amplitude_mean[:, GAPS.index(gap)], rtol=1e-12)
        click(page, "#sweep-curve .scatterlayer .trace .points path", 3)
        says(page, "#sweep-point-status", "mean of peaks")
        value = float(page.locator("#sweep-point-value").input_value())
        at = int(np.argmin(np.abs(record.axes["excitation.frequency"] - value)))
        mean = 1e6 * record.amplitude_mean[at, GAPS.index(max(GAPS))]
        says(page, "#sweep-point-status", f"{value:.6g} Hz: mean of peaks {mean:.4g} µm")
        page.locator("#sweep-file").click()
        page.get_by_role("option", name="one.h5").click()
        says(page, "#sweep-best", "No design is complete")  # 30 periods are too few


def drawn(page):
    """The damped mean as the page's chart has it, µm."""
    traces = page.locator("#sweep-curve .js-plotly-plot").evaluate("chart => JSON.stringify(chart.data)")
    (mean,) = [trace for trace in json.loads(traces) if trace.get("name") == "damped, mean of peaks"]
    values = mean["y"]
    return np.frombuffer(base64.b64decode(values["bdata"])) if isinstance(values, dict) else values
