"""A real browser for the dashboard's page: Chromium, driven by Playwright."""

from __future__ import annotations

import contextlib
import shutil
from collections.abc import Iterator
from urllib.parse import urlsplit

import pytest
from playwright.sync_api import BrowserContext, ConsoleMessage, Page, Request, sync_playwright

LOAD_MS = 120_000.0
"""Only bounds how long a test hangs: a browser takes its time on a busy machine."""
_NAMES = ("chromium", "chromium-browser", "google-chrome")


class Watched:
    """A page, and what must not happen on it.

    Args:
        context: of the browser; one page is opened.
        url: of the dashboard.
    """

    def __init__(self, context: BrowserContext, url: str) -> None:
        self.page: Page = context.new_page()
        self.faults: list[str] = []
        """Errors of the page, but for connections that are refused while a server is down."""
        self.strangers: list[str] = []
        """Requests to another origin."""
        self._home = urlsplit(url).netloc
        self.page.on("console", self._hear)
        self.page.on("pageerror", lambda error: self.faults.append(str(error)))
        self.page.on("request", self._see)
        self.page.goto(url)

    def _hear(self, message: ConsoleMessage) -> None:
        if message.type == "error" and "/feed' failed" not in message.text:
            self.faults.append(message.text)

    def _see(self, request: Request) -> None:
        parts = urlsplit(request.url)
        if parts.scheme != "data" and parts.netloc != self._home:
            self.strangers.append(request.url)


@contextlib.contextmanager
def open_page(url: str) -> Iterator[Watched]:
    """The dashboard at ``url`` in a headless browser of 1440 × 900; `make browser` gets one."""
    found = next((path for name in _NAMES if (path := shutil.which(name))), None)
    if found is None:
        pytest.fail("no Chromium found: install one, on Debian by `apt-get install chromium`")
    with sync_playwright() as playwright:
        # Root may not have Chromium's sandbox; the page is our own.
        browser = playwright.chromium.launch(
            executable_path=found, args=["--no-sandbox", "--disable-gpu"]
        )
        try:
            # Without motion between frames the browser leaves the processors to the fleet.
            context = browser.new_context(
                viewport={"width": 1440, "height": 900}, reduced_motion="reduce"
            )
            context.set_default_timeout(LOAD_MS)
            yield Watched(context, url)
        finally:
            browser.close()
