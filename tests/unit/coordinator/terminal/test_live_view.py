"""The live picture: it fits, it is complete, and it needs neither colour nor UTF-8."""

from __future__ import annotations

import contextlib
import io
import re
from dataclasses import replace

import pytest
from rich.cells import cell_len
from rich.console import Console

from coordinator.mission_view.mission_state import MissionState
from coordinator.terminal.live_view import LiveView, live_picture
from swarm.model import Task, TaskId, UavId
from swarm.model.ids import COORDINATOR
from swarm.protocol.messages import MissionPhase
from swarm.protocol.uav_messages import AttemptResult, Status, StatusPhase
from tests.support.builders import brief_of
from tests.support.observed_mission import Teller, random_mission, shipped, watch

SIZES = ((80, 24), (100, 30), (104, 24), (200, 60))


def shown(
    mission_state: MissionState,
    now_s: float,
    size: tuple[int, int] = (80, 24),
    *,
    ascii_only: bool = False,
    speedup: float = 1.0,
    secure: bool = False,
) -> str:
    """The picture as text, checked to have the size it should have."""
    width, height = size
    console = Console(file=io.StringIO(), width=width + 10, color_system=None)
    with console.capture() as captured:
        console.print(
            live_picture(
                mission_state,
                now_s,
                width=width,
                height=height,
                ascii_only=ascii_only,
                speedup=speedup,
                secure=secure,
            )
        )
    text = captured.get()
    lines = text.split("\n")
    assert lines.pop() == ""
    assert len(lines) == height
    assert max(cell_len(line.rstrip()) for line in lines) <= width
    return text


def terminal(size: tuple[int, int] = (80, 24)) -> Console:
    return Console(
        file=io.StringIO(),
        force_terminal=True,
        width=size[0],
        height=size[1],
        color_system="truecolor",
        _environ={"TERM": "xterm-256color"},
    )


def printed(console: Console) -> str:
    assert isinstance(console.file, io.StringIO)
    return console.file.getvalue()


@pytest.mark.parametrize("size", SIZES)
def test_whole_mission_fits_and_tells_what_happens(size: tuple[int, int]) -> None:
    pictures: list[str] = []
    watch(
        shipped("table-1"),
        step_s=0.3,
        see=lambda mission_state, now_s: pictures.append(shown(mission_state, now_s, size)),
    )

    assert "RUNNING" in pictures[1]
    assert "greedy: uav1 > uav3 > uav2" in pictures[1]
    assert "3 taken" in pictures[1]
    assert "5 open" in pictures[1]
    assert "uav3 ended t4: done" in pictures[3]
    assert "ENDED" in pictures[-1]
    assert "8 of 8 done" in pictures[-1]
    assert "118.49 of 118.49 planned, optimum 120.33" in pictures[-1]
    assert "mission ends: every task has ended" in pictures[-1]


@pytest.mark.parametrize("size", [(1, 1), (5, 3), (20, 8), (40, 12), (79, 9), (300, 10), (30, 60)])
@pytest.mark.parametrize("ascii_only", [False, True])
def test_any_size_of_terminal_is_good_for_something(
    size: tuple[int, int], ascii_only: bool
) -> None:
    mission_state = watch(shipped("table-1"))
    shown(mission_state, 4.0, size, ascii_only=ascii_only)


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("ascii_only", [False, True])
def test_large_fleet_says_how_many_are_hidden_and_shows_the_lost_first(
    size: tuple[int, int], ascii_only: bool
) -> None:
    mission = random_mission(100, 1000, seed=1)
    teller = Teller(mission)
    teller.begin()
    for number, uav in enumerate(mission.uavs):
        teller.end(uav.id, f"t{number}", 5.0 + number / 100.0)
        teller.claim(uav.id, f"t{100 + number}", 20.0, now_s=7.0)
        teller.status(uav.id, StatusPhase.FLYING, 7.0, position_enu_m=(500.0, 9.0 * number, 0.0))
    teller.lose("uav77", 8.0)

    text = shown(teller.mission_state, 9.0, size, ascii_only=ascii_only)

    lines = text.split("\n")
    heading = next(number for number, line in enumerate(lines) if " UAV " in line)
    assert "uav77  LOST" in lines[heading + 1] or "uav77 LOST" in lines[heading + 1]
    assert " more: " in text
    assert "100 of 1000 done" in text
    assert "99 taken" in text
    assert "uav77 lost; task t177 is open again" in text


def test_a_mission_with_keys_is_told_to_be_secure_and_what_was_refused() -> None:
    teller = Teller(shipped("table-1"))
    teller.begin()
    assert "secure" not in shown(teller.mission_state, 1.0)
    assert "RUNNING · secure · mission time" in shown(teller.mission_state, 1.0, secure=True)

    dropped = {"not signed": 4, "stale": 9}
    teller.say("uav1", Status(StatusPhase.FLYING, None, None, None, None, 1.0, dropped, ""))
    assert "RUNNING · secure, 4 refused · " in shown(teller.mission_state, 1.0, secure=True)


def test_picture_without_utf8_is_pure_ascii() -> None:
    texts: list[str] = []
    watch(
        shipped("valley-popups"),
        step_s=50.0,
        see=lambda mission_state, now_s: texts.extend(
            shown(mission_state, now_s, size, ascii_only=True) for size in SIZES
        ),
        lost_at_s={UavId("uav2"): 60.0},
    )
    teller = Teller(shipped("table-1"))
    teller.status("uav1", StatusPhase.PREPARING, note="wartet auf Höhe\x1b[2J\n▲")
    texts.append(shown(teller.mission_state, 0.0, ascii_only=True))

    assert all(text.isascii() for text in texts)
    assert "\x1b" not in texts[-1]


def test_preparing_uavs_tell_what_they_wait_for() -> None:
    teller = Teller(shipped("table-1"))
    assert "starting" in shown(teller.mission_state, 0.0)
    teller.epoch(MissionPhase.PREPARING)
    teller.status("uav1", StatusPhase.PREPARING, note="waits for a position")
    teller.status("uav2", StatusPhase.LEARNING)

    text = shown(teller.mission_state, 3.0)

    assert "PREPARING" in text
    assert "uav1 preparing waits for a position" in text
    assert "uav2 learning" in text
    assert "mission time" not in text
    assert "0 of 8 done" in text


def test_task_states_differ_in_shape() -> None:
    mission = shipped("table-1")
    teller = Teller(mission)
    teller.begin()
    teller.end("uav1", "t2", 0.9)
    teller.end("uav2", "t7", 1.0, AttemptResult.FAILED)
    teller.claim("uav3", "t5", 2.5, now_s=1.0)
    teller.post(mission.tasks[0], 0, withdrawn=True, now_s=1.0)

    text = shown(teller.mission_state, 1.0, ascii_only=True)

    assert "* 1 of 7 done  @ 1 taken  o 4 open  x 1 failed" in text
    assert "1 withdrawn" in text
    for sign in ("*t2", "xt7", "@t5", "ot3"):
        assert sign in text
    assert "t1" not in text.split("tasks")[0].replace("uav1", "").split("lists")[0]


def test_pop_up_is_not_drawn_before_it_appears() -> None:
    mission = shipped("valley-popups")
    popup = next(task for task in mission.tasks if task.appears_s > 0.0)
    teller = Teller(mission)
    teller.begin()
    assert popup.id not in shown(teller.mission_state, 1.0, (200, 60))

    teller.post(popup, 99, now_s=30.0)

    text = shown(teller.mission_state, 30.0, (200, 60))
    assert f"task {popup.id} appeared" in text
    assert text.count(popup.id) == 2, "on the map and in the story"


def test_uav_out_of_the_mission_stands_out_with_its_reason() -> None:
    teller = Teller(shipped("table-1"))
    teller.begin()
    teller.status("uav2", StatusPhase.OUT, 1.0, note="pilot took over")

    text = shown(teller.mission_state, 1.0)

    assert "▽ uav2 OUT" in text
    assert "pilot took over" in text


def test_battery_is_shown_where_it_is_known() -> None:
    teller = Teller(shipped("table-1"))
    teller.begin()
    assert "batt" not in shown(teller.mission_state, 1.0)

    teller.status("uav1", StatusPhase.IDLE, 1.0, battery_frac=0.87)

    assert "87%" in shown(teller.mission_state, 1.0)


def test_arrival_counts_down_to_the_claimed_completion() -> None:
    teller = Teller(shipped("table-1"))
    teller.begin(now_s=100.0)
    teller.claim("uav1", "t3", 102.5, now_s=100.5)

    assert "t3   2.00 s" in shown(teller.mission_state, 100.5)
    assert "t3      now" in shown(teller.mission_state, 103.0)


def test_last_losses_stay_in_the_story_when_much_else_happens() -> None:
    mission = random_mission(3, 60, seed=2)
    teller = Teller(mission)
    teller.begin()
    teller.claim("uav1", "t59", 5.0)
    teller.lose("uav1", 1.0)
    for number in range(50):
        teller.end("uav0", f"t{number}", 2.0 + 0.05 * number)  # before anybody is missed

    text = shown(teller.mission_state, 4.5)

    assert "uav1 lost" in text
    assert "uav0 ended t49: done" in text


def test_speed_up_and_a_passed_horizon_are_told() -> None:
    teller = Teller(shipped("table-1"))
    teller.begin()

    assert "×4" in shown(teller.mission_state, 1.0, speedup=4.0)
    assert "mission time 7.5 s (D = 5 s)" in shown(teller.mission_state, 7.5)


def test_all_places_at_one_point_can_be_drawn() -> None:
    mission = random_mission(2, 0, seed=3)
    here = Task(TaskId("here"), mission.uavs[0].position_enu_m, 1.0)
    for tasks in ((), (here,)):
        alone = type(mission)("alone", 10.0, mission.uavs[:1], tasks)
        teller = Teller(alone)
        teller.begin()
        for size in SIZES:
            shown(teller.mission_state, 1.0, size)


def test_terminal_gets_pictures_of_constant_height() -> None:
    console = terminal()
    with LiveView(console) as view:
        mission_state = watch(shipped("table-1"), step_s=0.5, see=view.update)

    text = printed(console)
    assert "mission ends" in text
    assert text.count("map, north up") >= 7
    ups = {part.count("\x1b[1A") for part in text.split("table-1")[1:] if "\x1b[1A" in part}
    assert ups == {22}  # 23 lines: always the same way back up
    assert text.endswith("\x1b[?25h"), "the cursor is back"
    assert mission_state.story


def test_picture_ends_in_order_when_the_mission_is_interrupted() -> None:
    console = terminal()
    view = LiveView(console)
    with contextlib.suppress(KeyboardInterrupt), view:
        view.update(Teller(shipped("table-1")).mission_state, 0.0)
        raise KeyboardInterrupt

    assert printed(console).endswith("\x1b[?25h")


def test_without_a_terminal_each_line_of_the_story_is_printed_once() -> None:
    console = Console(file=io.StringIO(), width=40)
    with LiveView(console) as view:
        mission_state = watch(shipped("table-1"), step_s=0.2, see=view.update)

    lines = printed(console).splitlines()
    assert len(lines) == len(mission_state.story)
    assert lines[1] == "   0.56 s  uav3 ended t4: done"
    assert lines[-1].endswith("mission ends: every task has ended")
    assert "\x1b" not in printed(console)


def crowd(n_uav: int) -> Teller:
    """So many UAVs in one sky, two of them at each other, one that is nearly empty."""
    flown = replace(random_mission(n_uav, n_uav, 0), separation_m=10.0)
    teller = Teller(flown)
    teller.say(COORDINATOR, replace(brief_of(flown), separation_m=10.0))
    teller.begin()
    for number, each in enumerate(flown.uavs):
        place = (300.0 * number, 0.0, 30.0)
        velocity = (0.0, 0.0, 0.0)
        battery_frac = 0.05 if each.id == "uav150" else 0.9
        if each.id in ("uav190", "uav191"):
            way = 1.0 if each.id == "uav191" else -1.0
            place, velocity = (50.0 - 25.0 * way, 500.0, 42.0), (5.0 * way, 0.0, 0.0)
        told = Status(StatusPhase.FLYING, None, place, velocity, battery_frac, 1.0, {}, "")
        teller.say(each.id, told, 1.0)
    return teller


@pytest.mark.parametrize("ascii_only", [False, True])
def test_of_a_large_fleet_those_come_first_that_are_to_be_looked_at(*, ascii_only: bool) -> None:
    text = shown(crowd(200).mission_state, 1.5, (100, 30), ascii_only=ascii_only)

    rows = [line.rsplit(" flying ", 1)[0] for line in text.split("\n") if " idle " in line]
    first, second, third = (row[-60:] for row in rows[:3])
    assert "uav190" in first
    assert "uav191" in second
    assert "uav150" in third
    assert re.search(r"and 18\d more", text)
    assert "42 m" in text
    assert "meet   uav190 and uav191" in text
    assert ("X" if ascii_only else "╳") in text
