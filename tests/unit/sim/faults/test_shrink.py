"""Shrinking: only what is needed for the breach is left."""

from __future__ import annotations

from dataclasses import replace

from sim.faults.case import Case
from sim.faults.generator import random_case
from sim.faults.schedule import Disturbance, DisturbanceKind
from sim.faults.soak import shrink
from sim.world.network import Topology
from sim.world.settings import RestartMemory


def test_faults_that_do_not_matter_are_left_out() -> None:
    case = random_case(4)
    culprit = Disturbance(7.0, DisturbanceKind.CUT, ("u0",), lasts_s=2.0)
    case = replace(case, schedule=(*case.schedule, culprit))

    small = shrink(case, lambda tried: any(e.kind is DisturbanceKind.CUT for e in tried.schedule))

    (left,) = small.schedule
    assert left.kind is DisturbanceKind.CUT
    assert (small.uavs, small.tasks, small.popups) == (1, 1, 0)
    assert (small.topology, small.method) == (Topology.ROUTER, "greedy")


def test_two_faults_that_only_break_together_are_both_kept() -> None:
    case = random_case(11, (DisturbanceKind.BLINK,))
    pair = (
        Disturbance(3.0, DisturbanceKind.UNPLUG, ("u0",), lasts_s=9.0),
        Disturbance(5.0, DisturbanceKind.ROUTERS, lasts_s=1.0),
    )
    case = replace(case, schedule=(pair[0], *case.schedule, pair[1]))

    def breaks(tried: Case) -> bool:
        return {DisturbanceKind.UNPLUG, DisturbanceKind.ROUTERS} <= {
            each.kind for each in tried.schedule
        }

    assert [each.kind for each in shrink(case, breaks).schedule] == [
        DisturbanceKind.UNPLUG,
        DisturbanceKind.ROUTERS,
    ]


def test_what_is_left_is_made_rounder_shorter_and_smaller() -> None:
    crash = Disturbance(
        12.34, DisturbanceKind.CRASH, ("u1",), lasts_s=7.77, memory=RestartMemory.PAST
    )
    cut = Disturbance(3.21, DisturbanceKind.CUT, ("coordinator", "u0", "u1"), lasts_s=16.5)
    case = Case(1, 4, 9, popups=3, schedule=(cut, crash))

    def breaks(tried: Case) -> bool:
        cuts = [
            e for e in tried.schedule if e.kind is DisturbanceKind.CUT and (e.lasts_s or 0.0) >= 5.0
        ]
        crashes = [
            e for e in tried.schedule if e.kind is DisturbanceKind.CRASH and e.lasts_s is not None
        ]
        return bool(cuts and crashes) and "u0" in cuts[0].names and tried.tasks >= 5

    small = shrink(case, breaks)

    assert (small.uavs, small.tasks, small.popups) == (2, 5, 0)
    assert [str(each) for each in small.schedule] == [
        "3 cut u0 for 8",
        "12 crash u1 for 1 with disk",
    ]


def test_a_uav_that_a_fault_names_stays() -> None:
    refusal = Disturbance(1.0, DisturbanceKind.REFUSE, ("u3", "t7"))

    small = shrink(Case(1, 6, 15, schedule=(refusal,)), lambda tried: refusal in tried.schedule)

    assert (small.uavs, small.tasks) == (4, 8)


def test_the_search_ends_when_its_plays_are_spent() -> None:
    plays = []

    def breaks(tried: Case) -> bool:
        plays.append(tried)
        return True

    shrink(random_case(3), breaks, most_plays=7)

    assert len(plays) <= 7
