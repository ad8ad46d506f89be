"""Pictures of the dashboard for the README: `python -m tests.support.dashboard_pictures [FOLDER]`.

Flies `valley-survey` with real processes, kills one agent on the way, and takes three pictures
of the page with a real browser. Look at each before it is kept.
"""

from __future__ import annotations

import os
import signal
import sys
import tempfile
from pathlib import Path

from playwright.sync_api import Page, expect

from coordinator.dashboard.access import listen
from tests.process.browser import open_page
from tests.process.mission import SwarmRun
from tests.support.gallery import keep

FOLDER = Path("coordinator/dashboard/screenshots")
PATIENCE_MS = 120_000.0


def wait_for_done(page: Page, count: int) -> None:
    """Wait until so many tasks are done."""
    page.wait_for_function(
        "count => Number(document.getElementById('figure-done').textContent) >= count",
        arg=count,
        timeout=PATIENCE_MS,
    )


def take(folder: Path) -> None:
    """Fly, and write desktop.png, decisions.png and phone.png into ``folder``."""
    folder.mkdir(parents=True, exist_ok=True)
    free = listen("127.0.0.1", 0)
    port = free.getsockname()[1]
    free.close()
    arguments = ["valley-survey", "--speedup", "4", "--dashboard", str(port)]
    with tempfile.TemporaryDirectory() as scratch, SwarmRun(arguments, Path(scratch)) as run:
        run.wait_for_line("epoch 1")
        with open_page(f"http://127.0.0.1:{port}/") as watched:
            page = watched.page
            page.emulate_media(color_scheme="dark")
            expect(page.locator("#phase")).to_have_text("running", timeout=PATIENCE_MS)
            wait_for_done(page, 18)
            keep(page.screenshot(), folder / "desktop.png")

            page.emulate_media(color_scheme="light")
            page.locator("#panel-fleet tr[data-id=uav03]").click()
            page.get_by_role("tab", name="Decisions").click()
            page.locator("#panel-choices summary").first.click()
            page.wait_for_timeout(1000)
            keep(page.screenshot(), folder / "decisions.png")

            page.keyboard.press("Escape")
            page.get_by_role("tab", name="Fleet").click()
            os.kill(run.child("agent", "uav07"), signal.SIGKILL)
            page.set_viewport_size({"width": 390, "height": 844})
            expect(page.locator("#panel-fleet tr[data-trouble]")).to_have_count(1)
            page.emulate_media(color_scheme="dark")
            page.keyboard.press("f")
            page.wait_for_timeout(1500)
            keep(page.screenshot(), folder / "phone.png")


if __name__ == "__main__":
    take(Path(sys.argv[1]) if len(sys.argv) > 1 else FOLDER)
