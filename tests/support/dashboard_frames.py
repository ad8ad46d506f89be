"""How smooth the page is before a large fleet: `python -m tests.support.dashboard_frames [UAVS]`.

Acts a mission of so many UAVs (200) on a real bus, five statuses of each a second, follows it with
a dashboard's process and a real browser, motion on, and prints frame times and bytes as JSON.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import sys
from pathlib import Path
from typing import Any

from playwright.async_api import Page, async_playwright

from sim.bench.dashboard_load import served
from sim.bench.fleets import survey_mission
from sim.bench.scripted_mission import ScriptedMission
from swarm.bus.config import BusConfig, ClientTopology
from swarm.bus.zenoh_bus import open_zenoh_bus
from swarm.runtime.clock import SystemClock

TASKS_EACH = 5
RATE_HZ = 5.0
SETTLE_S = 10.0
SECONDS = 20.0
PICTURE = Path("dashboard-frames.png")
_RECORD = """
() => {
  window.deltas = [];
  let last = performance.now();
  const next = (now) => {
    window.deltas.push(now - last);
    last = now;
    requestAnimationFrame(next);
  };
  requestAnimationFrame(next);
}
"""
_TIMES = """
async () => {
  const { timing } = await import("/static/js/timing.js");
  return Object.fromEntries(["frame", "ground", "moving"].map((name) => [name, timing(name)]));
}
"""


async def measure(uavs: int) -> dict[str, Any]:
    """Act, look on, and give what was measured."""
    mission = survey_mission(uavs, TASKS_EACH * uavs, 0)
    async with served(mission.name) as (endpoint, _, url), async_playwright() as playwright:
        bus = await open_zenoh_bus(BusConfig(ClientTopology((endpoint,))))
        acted = ScriptedMission(mission, bus, SystemClock(), RATE_HZ, 0)
        acted.appear()
        acted.begin()
        acting = asyncio.get_running_loop().create_task(acted.run())
        browser = await playwright.chromium.launch(
            executable_path="/usr/bin/chromium", args=["--no-sandbox", "--disable-gpu"]
        )
        try:
            page = await browser.new_page(viewport={"width": 1440, "height": 900})
            return await _watch(page, url.replace("ws", "http", 1).removesuffix("feed"), acted)
        finally:
            await browser.close()
            acting.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await acting
            bus.close()


async def _watch(page: Page, url: str, acted: ScriptedMission) -> dict[str, Any]:
    received = []
    page.on(
        "websocket", lambda feed: feed.on("framereceived", lambda data: received.append(len(data)))
    )
    await page.goto(url)
    await asyncio.sleep(SETTLE_S / 2.0)
    acted.begin()  # whoever joined late has missed it
    await asyncio.sleep(SETTLE_S / 2.0)
    whole = max(received)
    received.clear()
    await page.evaluate(_RECORD)
    await asyncio.sleep(SECONDS)
    deltas = sorted(await page.evaluate("() => window.deltas"))
    times = await page.evaluate(_TIMES)
    await page.screenshot(path=PICTURE)
    return {
        "frames_per_s": len(deltas) / SECONDS,
        "frame_ms": {
            "median": deltas[len(deltas) // 2],
            "p95": deltas[int(0.95 * len(deltas))],
            "longest": deltas[-1],
        },
        "page_ms": times,
        "whole_bytes": whole,
        "feed_bytes_per_s": sum(received) / SECONDS,
        "feed_frames_per_s": len(received) / SECONDS,
    }


if __name__ == "__main__":
    fleet = int(sys.argv[1]) if len(sys.argv) > 1 else 200
    sys.stdout.write(json.dumps(asyncio.run(measure(fleet)), indent=1) + "\n")
