"""Shrinking: only what is needed for the breach is left."""

from __future__ import annotations

from dataclasses import replace

from sim.faults.case import Case
from sim.faults.generator import random_case
from sim.faults.schedule import Disturbance, Kind
from sim.faults.shrink import shrink
from sim.rough_network import Topology
from sim.world import Recall


def test_faults_that_do_not_matter_are_left_out() -> None:
    case = random_case(4)
    culprit = Disturbance(7.0, Kind.CUT, ("u0",), lasts_s=2.0)
    case = replace(case, schedule=(*case.schedule, culprit))

    small = shrink(case, lambda tried: any(e.kind is Kind.CUT for e in tried.schedule))

    (left,) = small.schedule
    assert left.kind is Kind.CUT
    assert (small.uavs, small.tasks, small.popups) == (1, 1, 0)
    assert (small.topology, small.method) == (Topology.ROUTER, "greedy")


def test_two_faults_that_only_break_together_are_both_kept() -> None:
    case = random_case(11, (Kind.BLINK,))
    pair = (
        Disturbance(3.0, Kind.UNPLUG, ("u0",), lasts_s=9.0),
        Disturbance(5.0, Kind.ROUTERS, lasts_s=1.0),
    )
    case = replace(case, schedule=(pair[0], *case.schedule, pair[1]))

    def breaks(tried: Case) -> bool:
        return {Kind.UNPLUG, Kind.ROUTERS} <= {each.kind for each in tried.schedule}

    assert [each.kind for each in shrink(case, breaks).schedule] == [Kind.UNPLUG, Kind.ROUTERS]


def test_what_is_left_is_made_rounder_shorter_and_smaller() -> None:
    crash = Disturbance(12.34, Kind.CRASH, ("u1",), lasts_s=7.77, memory=Recall.PAST)
    cut = Disturbance(3.21, Kind.CUT, ("coordinator", "u0", "u1"), lasts_s=16.5)
    case = Case(1, 4, 9, popups=3, schedule=(cut, crash))

    def breaks(tried: Case) -> bool:
        cuts = [e for e in tried.schedule if e.kind is Kind.CUT and (e.lasts_s or 0.0) >= 5.0]
        crashes = [e for e in tried.schedule if e.kind is Kind.CRASH and e.lasts_s is not None]
        return bool(cuts and crashes) and "u0" in cuts[0].names and tried.tasks >= 5

    small = shrink(case, breaks)

    assert (small.uavs, small.tasks, small.popups) == (2, 5, 0)
    assert [str(each) for each in small.schedule] == [
        "3 cut u0 for 8",
        "12 crash u1 for 1 with disk",
    ]


def test_a_uav_that_a_fault_names_stays() -> None:
    refusal = Disturbance(1.0, Kind.REFUSE, ("u3", "t7"))

    small = shrink(Case(1, 6, 15, schedule=(refusal,)), lambda tried: refusal in tried.schedule)

    assert (small.uavs, small.tasks) == (4, 8)


def test_the_search_ends_when_its_plays_are_spent() -> None:
    plays = []

    def breaks(tried: Case) -> bool:
        plays.append(tried)
        return True

    shrink(random_case(3), breaks, most_plays=7)

    assert len(plays) <= 7
