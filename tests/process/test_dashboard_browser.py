"""The dashboard's page in a real browser, before a mission that real processes fly."""

from __future__ import annotations

import contextlib
import json
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import urlsplit

import pytest
from playwright.sync_api import Locator, Page, expect

from swarm.model import Mission, Origin, Task, TaskId, Uav, UavId
from tests.process.browser import open_page
from tests.process.by_hand import ByHand
from tests.process.mission import wait_until
from tests.process.pace import pace

pytestmark = [pytest.mark.process]

UAVS = ["uav1", "uav2", "uav3"]
SIDE = 12
"""Tasks in a row, and rows of them: so many, and each so long, that none but an abort ends the
mission, which would take three minutes otherwise; and so near that the way home is short."""
MISSION = Mission(
    "watched",
    9000.0,
    tuple(Uav(UavId(u), (12.0 * n, 0.0, 0.0), 3.0) for n, u in enumerate(UAVS)),
    tuple(
        Task(
            TaskId(f"t{n + 1}"),
            (10.0 * (n % SIDE - 4), 5.0 * (1 + n // SIDE), 0.0),
            1.0,
            service_s=12.0,
        )
        for n in range(SIDE * SIDE)
    ),
    origin=Origin(46.8, 9.7, 1100.0),
)
LOOK_S = 0.05
SOON_MS = 60_000.0
"""For what takes a flight or a start of processes."""
expect.set_options(timeout=60_000.0)


def dashboard(by_hand: ByHand, name: str, port: int = 0) -> tuple[subprocess.Popen[str], str]:
    process = by_hand.start(name, ["dashboard", "--port", str(port), "--json", *by_hand.seat])
    assert process.stdout is not None
    return process, json.loads(process.stdout.readline())["url"]


def uav_row(page: Page, uav: str) -> Locator:
    return page.locator(f"#panel-fleet tr[data-id={uav}]")


def places(page: Page) -> dict[str, str]:
    return {uav: uav_row(page, uav).locator(".col-place").text_content() or "" for uav in UAVS}


def painted(page: Page) -> str:
    """What is drawn of the UAVs on the map."""
    return str(page.evaluate("document.querySelector('canvas.moving').toDataURL()"))


def confirm(page: Page, label: str) -> None:
    page.locator("dialog").get_by_role("button", name=label, exact=True).click()
    expect(page.locator("dialog")).to_have_count(0)


@pytest.fixture
def flown(tmp_path: Path) -> Iterator[ByHand]:
    with contextlib.ExitStack() as stack:
        yield ByHand(tmp_path, stack, MISSION, speedup=4)


def test_an_operator_sees_and_commands_a_living_fleet_in_a_browser(flown: ByHand) -> None:
    coordinator = flown.coordinator("coordinator", "--state", str(flown.folder))
    served, url = dashboard(flown, "dashboard")
    port = urlsplit(url).port or 0
    with open_page(url) as watched:
        page = watched.page
        expect(page.locator("#mission-name")).to_have_text("watched", timeout=SOON_MS)
        expect(page.locator("#phase")).to_have_text("running", timeout=SOON_MS)
        assert_accessible(page)
        all_uavs_move(page)

        task = add_a_task_by_a_click(page)
        draw_a_zone_and_take_it_away(page)
        held_and_resumed(page, "uav1")

        # Without its coordinator the fleet, the page and the commands go on.
        coordinator.kill()
        coordinator.wait()
        expect(page.locator(".banner")).to_contain_text("Coordinator lost", timeout=SOON_MS)
        served.kill()
        served.wait()
        expect(page.locator("#connection")).to_have_text("no connection")
        expect(page.locator(".banner")).to_contain_text("Connection lost since")
        served, _ = dashboard(flown, "dashboard-again", port)
        expect(page.locator("#connection")).to_have_text("live", timeout=SOON_MS)
        flown.coordinator("coordinator-again", "--state", str(flown.folder))
        expect(page.locator(".banner")).to_have_count(0, timeout=SOON_MS)
        expect(page.locator("#phase")).to_have_text("running")
        all_uavs_move(page)

        task_is_done(page, task)
        shown_lost_within(page, "uav3", flown.agents[2], 2.0 / pace(1.0))
        abort(page)
        for uav in ("uav1", "uav2"):
            expect(uav_row(page, uav).locator(".col-does")).to_contain_text("home", timeout=SOON_MS)
        expect(page.locator("#phase")).to_have_text("aborted", timeout=SOON_MS)
        for width in (390, 350):  # a phone, and one with a large font
            page.set_viewport_size({"width": width, "height": 844})
            assert page.evaluate("document.documentElement.scrollWidth") == width
        assert watched.faults == []
        assert watched.strangers == []


def all_uavs_move(page: Page) -> None:
    expect(page.locator("#panel-fleet tbody tr[data-id]")).to_have_count(len(UAVS))
    before, picture = places(page), painted(page)
    wait_until(
        lambda: all(now != before[uav] for uav, now in places(page).items()),
        60.0,
        "a move of every UAV",
    )
    wait_until(lambda: painted(page) != picture, 60.0, "a new picture")


def add_a_task_by_a_click(page: Page) -> str:
    page.get_by_role("button", name="+ Task").click()
    box = page.locator("#map").bounding_box()
    assert box is not None
    page.mouse.click(box["x"] + 0.53 * box["width"], box["y"] + 0.47 * box["height"])
    page.get_by_label("Id", exact=True).fill("added")
    page.get_by_label("Value", exact=True).fill("90")
    confirm(page, "Add task")
    expect(page.locator(".toast")).to_contain_text("added")
    page.get_by_role("tab", name="Tasks").click()
    expect(page.locator("#panel-tasks tr[data-id=added] .col-by")).to_have_text("operator")
    page.get_by_role("tab", name="Fleet").click()
    return "added"


def draw_a_zone_and_take_it_away(page: Page) -> None:
    """Beyond everything, by clicks on its corners."""
    page.get_by_role("button", name="+ Zone").click()
    box = page.locator("#map").bounding_box()
    assert box is not None
    for right, down in ((0.02, 0.10), (0.07, 0.10), (0.04, 0.18)):
        page.mouse.click(box["x"] + right * box["width"], box["y"] + down * box["height"])
    page.keyboard.press("Enter")
    page.get_by_label("Id", exact=True).fill("pond")
    confirm(page, "Draw zone")
    page.get_by_role("tab", name="Operator").click()
    drawn = page.get_by_role("button", name="Zone pond ×")
    expect(drawn).to_have_count(1, timeout=SOON_MS)
    expect(page.locator("#panel-operator")).to_contain_text("zone pond", timeout=SOON_MS)
    drawn.click()
    confirm(page, "Take away")
    expect(drawn).to_have_count(0, timeout=SOON_MS)
    page.get_by_role("tab", name="Fleet").click()


def task_is_done(page: Page, task: str) -> None:
    page.get_by_role("tab", name="Tasks").click()
    row = page.locator(f"#panel-tasks tr[data-id={task}]")
    expect(row.locator(".col-state")).to_contain_text("done", timeout=SOON_MS)
    assert row.locator(".col-uav").text_content() in UAVS
    page.get_by_role("tab", name="Fleet").click()


def held_and_resumed(page: Page, uav: str) -> None:
    uav_row(page, uav).click()
    card = page.get_by_role("complementary", name=f"UAV {uav}")
    card.get_by_role("button", name="Hold").click()
    page.get_by_label("Reason (optional)").fill("helicopter")
    confirm(page, "Hold")
    expect(uav_row(page, uav).locator(".col-does")).to_contain_text("holding", timeout=SOON_MS)
    expect(page.locator(".toast").last).to_contain_text("helicopter", timeout=SOON_MS)
    expect(page.locator("#panel-story")).to_contain_text("operator holds uav1: helicopter")
    card.get_by_role("button", name="Resume").click()
    confirm(page, "Resume")
    expect(uav_row(page, uav).locator(".col-does")).not_to_contain_text("holding", timeout=SOON_MS)
    page.keyboard.press("Escape")
    expect(card).to_have_count(0)


def shown_lost_within(page: Page, uav: str, agent: subprocess.Popen[str], limit_s: float) -> None:
    """What this machine is late by while the page is looked at does not count."""
    does = uav_row(page, uav).locator(".col-does")
    late_s, began_s = 0.0, time.monotonic()
    agent.kill()
    agent.wait()
    while "lost" not in (does.text_content() or ""):
        looked_s = time.monotonic()
        assert looked_s - began_s < SOON_MS / 1e3, does.text_content()
        page.wait_for_timeout(LOOK_S * 1e3)
        late_s += time.monotonic() - looked_s - LOOK_S
    assert time.monotonic() - began_s - late_s < limit_s
    expect(page.locator("#panel-story .trouble").first).to_contain_text(f"{uav} lost")


def abort(page: Page) -> None:
    page.get_by_role("button", name="Abort mission").click()
    page.get_by_label("Yes, bring all UAVs home now").check()
    confirm(page, "Abort mission")
    expect(page.locator("#phase")).to_contain_text("abort", timeout=SOON_MS)


def assert_accessible(page: Page) -> None:
    """Every control has a name, and the keyboard alone reaches each."""
    unnamed = page.evaluate(
        """() => [...document.querySelectorAll("button, input, select, [role=tab]")]
            .filter((each) => each.checkVisibility())
            .filter((each) => !(each.ariaLabel || each.textContent.trim() || each.labels?.length))
            .map((each) => each.outerHTML)"""
    )
    assert unnamed == []
    wanted = page.evaluate(
        """() => {
            const controls = [...document.querySelectorAll("a[href], button, input, [tabindex]")]
                .filter((each) => each.checkVisibility() && !each.disabled && each.tabIndex >= 0);
            controls.forEach((each, index) => { each.dataset.reach = index; });
            document.activeElement.blur();
            return controls.length;
        }"""
    )
    reached = set()
    for _ in range(2 * wanted):
        page.keyboard.press("Tab")
        reached.add(page.evaluate("() => document.activeElement?.dataset?.reach ?? null"))
    assert {str(index) for index in range(wanted)} <= reached
    page.keyboard.press("Escape")
