"""Make docs/explore.png: the page of `vanedamp explore` with its whole curve, and the motion at its peak.

Needs playwright and a chromium: .venv/bin/python scripts/explore_picture.py
"""

from __future__ import annotations

import shutil
import signal
import subprocess
import sys
from pathlib import Path

from playwright.sync_api import expect, sync_playwright

PICTURE = Path(__file__).parents[1] / "docs" / "explore.png"
PATIENCE = 300_000  # ms


def main() -> None:
    """Take the picture."""
    command = [sys.executable, "-m", "vanedamp", "explore", "--no-browser"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as server, sync_playwright() as playwright:
        assert server.stdout is not None
        try:
            browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=["--no-sandbox"])
            page = browser.new_page(viewport={"width": 1400, "height": 1420})
            page.goto(server.stdout.readline().strip())
            expect(page.locator("#message")).to_have_text("60 frequencies", timeout=PATIENCE)
            peak = page.get_by_text("damped peak (mean)").locator("xpath=following-sibling::dd[1]").inner_text()
            field = page.get_by_label("at excitation frequency, Hz")
            field.fill(peak.split(" at ")[1].removesuffix(" Hz"))
            field.press("Enter")
            expect(page.locator("#point-status")).to_contain_text("mean of peaks", timeout=PATIENCE)
            page.wait_for_timeout(1000)  # until the charts are drawn
            page.evaluate("document.activeElement.blur(); window.scrollTo(0, 0)")
            page.screenshot(path=PICTURE)
            browser.close()
        finally:
            server.send_signal(signal.SIGINT)


if __name__ == "__main__":
    main()
