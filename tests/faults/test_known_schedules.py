"""Schedules that once broke an invariant, in the small form they were shrunk to."""

from __future__ import annotations

import pytest

from sim.faults.case import parse_case, play

ONCE_BROKEN = {
    "a new life repeats the claim that others remember of the old one": """
        fleet seed=12219 uavs=4 tasks=4 popups=3 topology=mesh method=greedy
        20 unplug u1 for 6
        25 crash u1 for 1 with past
    """,
    "a claim known by hearsay is of one that hangs with a living token": """
        fleet seed=10181 uavs=5 tasks=5 popups=1 topology=router method=greedy
        9 blink
        16 deadlock u1
        17 hang u3
        37 crash u2 for 6 with disk
    """,
    "who was cut off hears nothing of a coordinator that came and went": """
        fleet seed=14600 uavs=2 tasks=1 popups=0 topology=router method=greedy standby=yes
        7 cut coordinator u0 for 7
        13 crash standby for 0.1 with disk
    """,
    "a coordinator speaks below what another said in its place": """
        fleet seed=14600 uavs=2 tasks=1 popups=0 topology=mesh method=greedy standby=yes
        7 cut coordinator u0 for 7
        13 crash standby
    """,
    "two coordinators outbid each other": """
        fleet seed=17137 uavs=4 tasks=2 popups=1 topology=router method=guided standby=yes
        3 deadlock u3
        9 cut coordinator u0 u1 for 19.7
    """,
    "two coordinators outbid each other by what they overhear": """
        fleet seed=17137 uavs=4 tasks=3 popups=1 topology=routers method=guided standby=yes
        3 deadlock u3
        9 cut coordinator u0 u1 for 19.68
    """,
    "a coordinator's first words reach neither its disk nor anybody": """
        fleet seed=82105 uavs=2 tasks=1 popups=0 topology=mesh method=greedy
        0.02 crash coordinator for 1 with past
    """,
    "who was cut off forgets what it visited there": """
        fleet seed=97670 uavs=5 tasks=9 popups=0 topology=router method=greedy
        3.2 routers for 11
        10.4 crash u4 for 1 with none
    """,
    "a task is added while the word that ends the mission is under way": """
        fleet seed=98650 uavs=3 tasks=14 popups=0 topology=router method=greedy
        5 hang u0 for 3
        7 hold u2 for 1
        8 blink
        14 add by 1
        32.6 add by 1
    """,
    "who was refused goes home before it may try again, as there is no coordinator": """
        fleet seed=92515 uavs=2 tasks=3 popups=0 topology=router method=greedy
        1 return u1
        2 refuse u0 t2 for 18
        8 hold u0 for 0.1
        18 deadlock coordinator
    """,
}


@pytest.mark.parametrize("what", ONCE_BROKEN)
def test_it_breaks_no_more(what: str) -> None:
    lines = [line.strip() for line in ONCE_BROKEN[what].strip().splitlines()]

    assert play(parse_case(lines, what)).broken is None
