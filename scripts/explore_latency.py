"""Measure in a browser how soon the page of `vanedamp explore` follows: 20 moves of a slider, and a drag of 5 s.

Needs playwright and a chromium: .venv/bin/python scripts/explore_latency.py [SCENE.toml]
"""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import statistics
import subprocess
import sys
import time
from pathlib import Path

from playwright.sync_api import Page, expect, sync_playwright

MOVES, DRAG = 20, 5.0
#: notes when sliders move and when the chart has been drawn, with what it shows
WATCH = """
window.seen = {moves: [], drawn: []};
document.addEventListener("input", event => {
  if (event.target.type === "range") window.seen.moves.push(performance.now());
}, true);
const looking = setInterval(() => {
  const chart = document.querySelector("#curve .js-plotly-plot");
  if (!chart || !chart.on) return;
  clearInterval(looking);
  chart.on("plotly_afterplot", () => {
    const shows = chart.layout.meta;
    if (shows) window.seen.drawn.push([performance.now(), shows.version, shows.complete]);
  });
}, 20);
"""


def main() -> None:
    """Print medians and the longest of both forms of the curve, and what is left behind by a drag."""
    command = [sys.executable, "-m", "vanedamp", "explore", "--no-browser", *sys.argv[1:]]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as server, sync_playwright() as playwright:
        assert server.stdout is not None
        try:
            browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=["--no-sandbox"])
            page = browser.new_context(bypass_csp=True, viewport={"width": 1400, "height": 900}).new_page()
            page.add_init_script(WATCH)
            page.goto(server.stdout.readline().strip())
            settle(page)
            time.sleep(1.0)
            spent = processor_time(server.pid)
            moves(page)
            used = (processor_time(server.pid) - spent) / MOVES
            print(f"processor time of server and workers: {1e3 * used:.0f} ms a move")
            drag(page)
            browser.close()
        finally:
            server.send_signal(signal.SIGINT)


def processor_time(parent: int) -> float:
    """Return the processor time of a process and its children so far, s (Linux)."""
    total = 0
    for file in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):
            fields = file.read_text().rpartition(")")[2].split()
            if str(parent) in (file.parent.name, fields[1]):
                total += int(fields[11]) + int(fields[12])
    return total / os.sysconf("SC_CLK_TCK")


def settle(page: Page) -> None:
    """Wait for the fine curve."""
    expect(page.locator("#message")).to_have_text("60 frequencies", timeout=60_000)


def moves(page: Page) -> None:
    """Move the slider of the gap by a key, again and again, each time after the curve has followed."""
    slider, coarse, fine = page.locator("#slider-gap"), [], []
    slider.focus()
    for count in range(MOVES):
        before = page.evaluate("window.seen.drawn.length")
        slider.press("ArrowRight" if count % 2 else "ArrowLeft")
        shown: list[tuple[float, int, bool]] = []
        while not (shown and shown[-1][2]):  # seldom: looking costs time, too
            time.sleep(0.8)
            shown = page.evaluate(f"window.seen.drawn.slice({before})")
        begun = page.evaluate("window.seen.moves.at(-1)")
        coarse.append(shown[0][0] - begun)
        fine.append(next(at for at, _, complete in shown if complete) - begun)
    for name, values in (("first form of the curve", coarse), ("60 frequencies", fine)):
        print(f"{name}: median {statistics.median(values):.0f} ms, longest {max(values):.0f} ms of {MOVES} moves")


def drag(page: Page) -> None:
    """Drag the slider to and fro, and count requests and curves meanwhile and after it."""
    waiting, most = set[object](), [0]

    def begin(request: object) -> None:
        if getattr(request, "method", "") == "POST":
            waiting.add(request)
            most[0] = max(most[0], len(waiting))

    def end(request: object) -> None:
        waiting.discard(request)

    page.on("request", begin)
    page.on("requestfinished", end)
    page.on("requestfailed", end)
    box = page.locator("#slider-gap").bounding_box()
    assert box is not None
    place, drawn = box["y"] + box["height"] / 2, page.evaluate("window.seen.drawn.length")
    page.mouse.move(box["x"] + box["width"] / 2, place)
    page.mouse.down()
    before = page.evaluate("window.seen.moves.length")
    started, count = time.perf_counter(), 0
    while time.perf_counter() - started < DRAG:
        share = abs((count % 100) / 50 - 1)
        page.mouse.move(box["x"] + box["width"] * (0.2 + 0.6 * share), place)
        count += 1
        time.sleep(0.008)
    page.mouse.up()
    events, curves = page.evaluate("[window.seen.moves.length, window.seen.drawn.length]")
    last = page.evaluate("window.seen.moves.at(-1)")
    left = len(waiting)
    while not page.evaluate(f"window.seen.drawn.length > {curves} && window.seen.drawn.at(-1)[2]"):
        time.sleep(0.2)
    time.sleep(1.0)
    shown = page.evaluate("window.seen.drawn")
    print(
        f"drag of {DRAG:g} s: {events - before} events, {curves - drawn} curves drawn meanwhile, at most {most[0]} "
        f"requests at a time, {left} left at its end, {len(shown) - curves} curves after it; fine curve "
        f"{shown[-1][0] - last:.0f} ms after the last event"
    )
    assert not waiting


if __name__ == "__main__":
    main()
