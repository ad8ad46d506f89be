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
    "a vehicle refuses a line that it would fly backwards": """
        fleet seed=2000039 uavs=3 tasks=7 popups=0 topology=routers method=guided
        8.37 drain u2 by 0.92
        17.88 refuse u0 t0
        18.52 drain u0 by 0.36
    """,
    "a slow vehicle finds out on its way that it comes too late": """
        fleet seed=2000310 uavs=2 tasks=12 popups=2 topology=router method=greedy
        7.14 slow u1 by 0.85
        7.92 weather by 0.16 for 1.62
        14.07 drain u0 by 0.28
        17.51 skew coordinator by 0.69
        31.35 mute u1 u0 for 2
        33.68 withdraw t10
    """,
    "who turns aside in flight has flown on since it was last heard": """
        fleet seed=2000566 uavs=5 tasks=12 popups=1 topology=router method=guided
        6.47 drain u2 by 0.23
        6.79 add by 0.71
    """,
    "the shortest way out of a zone leads through another one": """
        fleet seed=2001794 uavs=6 tasks=5 popups=1 topology=routers method=greedy
        16.44 zone u4 by 0.92
        26.54 lose coordinator
        32.58 zone u5 by 0.71
    """,
    "a lost UAV stands on the only slot for a new battery": """
        fleet seed=2001169 uavs=3 tasks=6 popups=1 topology=mesh method=guided standby=yes
        14.71 zone u2 by 0.78 for 2.77
        25.95 lose u1
        32.73 zone u1 by 0.97 for 2.6
    """,
    "a mission ends between an outcome and the flight to a base that follows": """
        fleet seed=2001776 uavs=2 tasks=15 popups=5 topology=routers method=greedy
        0.7 slow u0 by 0.98
        17.5 weather by 0.48 for 0.22
        19.54 drain u0 by 0.61
        22.7 drain u0 by 0.22
        25.16 skew coordinator by 0.95
        28.6 zone u1 by 0.99 for 1.74
    """,
    "a coordinator's next life sees a UAV before it hears from it": """
        fleet seed=2001368 uavs=3 tasks=5 popups=0 topology=routers method=greedy
        9.97 skew coordinator by 0.35
        14.47 weather by 0.39 for 1.91
        20.88 routers for 0.15
        22.19 return u1
        23.64 drain u2 by 0.93
        25.99 withdraw t4
        27.78 crash coordinator for 8.74 with past
        34.48 zone u1 by 0.6 for 0.24
    """,
}


@pytest.mark.parametrize("what", ONCE_BROKEN)
def test_it_breaks_no_more(what: str) -> None:
    lines = [line.strip() for line in ONCE_BROKEN[what].strip().splitlines()]

    assert play(parse_case(lines, what)).broken is None
