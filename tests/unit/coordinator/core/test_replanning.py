"""When a running mission is planned anew, and when the fleet is told."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import pytest

from coordinator.core.lifecycle import Replan, Replanned, StopPlanning
from coordinator.core.replan_policy import ReplanPolicy
from coordinator.planner.online import (
    EpochPolicy,
    Lists,
    Prediction,
    ReplanResult,
    Situation,
    replan,
)
from swarm.model import Uav
from swarm.protocol.messages import Body, MissionPhase, PlanEpoch
from tests.support.builders import IDLE, OUT, done, entries_of, failed, held, mission, task, uav
from tests.support.running_mission import RunningMission

INTERVAL_S = 5.0
FLEET = uav("a"), uav("b", east_m=100.0), uav("c", east_m=50.0)
TASKS = [
    *(task(f"t{n}", 10.0 * n) for n in range(1, 8)),
    task("late", 60.0, appears_s=20.0),
]
EXPECTED_S = {f"t{n}": 10.0 * n for n in range(1, 8)}
GOING_ON: Lists = {"a": ("t1", "t2", "t3"), "b": ("t7", "t6"), "c": ("t5", "t4")}


class Scene:
    """A policy whose first epoch came into force at 0 s, and the mission it watches."""

    def __init__(
        self,
        *,
        expected_s: Mapping[str, float] = EXPECTED_S,
        margin: float = 0.005,
        fleet: Sequence[Uav] = FLEET,
    ) -> None:
        self.mission = RunningMission(mission(fleet, TASKS))
        self.policy = ReplanPolicy("guided", 7, INTERVAL_S, margin_frac=margin)
        self.policy.begin(self.mission.at(0.0), expected_s, 0.0)
        self.asked: list[Replan] = []

    def say(self, writer: str, body: Body) -> Scene:
        self.mission.say(writer, body)
        return self

    def lose(self, name: str) -> Scene:
        self.mission.lose(name)
        return self

    def wanted(self, now_s: float) -> bool:
        wanted = self.pursue(now_s)
        if isinstance(wanted, Replan):
            self.asked.append(wanted)
        return isinstance(wanted, Replan)

    def pursue(self, now_s: float) -> Replan | PlanEpoch | None:
        return self.policy.pursue(lambda: self.mission.at(now_s), self.epoch, now_s)

    def judge(
        self, now_s: float, new: Lists, old: Lists = GOING_ON, *, request: int | None = None
    ) -> PlanEpoch | None:
        plan = ReplanResult("guided", ("a", "b", "c"), prediction(new), prediction(old))
        number = len(self.asked) if request is None else request
        replanned = Replanned(number, plan)
        return self.policy.judge(replanned, self.mission.at(now_s), self.epoch, now_s)

    @property
    def epoch(self) -> PlanEpoch:
        epoch = self.mission.replica.epoch
        assert epoch is not None
        return epoch

    def situation(self, now_s: float) -> Situation:
        return self.mission.at(now_s)


def prediction(lists: Lists) -> Prediction:
    """As of the past: only its lists count any more."""
    times_s = {name: 1e3 for tasks in lists.values() for name in tasks}
    return Prediction(lists, times_s, objective=1e9)


POOR: Lists = {"a": ("t1", "t7", "t2", "t6"), "b": (), "c": ("t3", "t5", "t4")}
FAR_BETTER: Lists = {"a": ("t1", "t2", "t3"), "b": (), "c": ("t4", "t5", "t6", "t7")}


# -- reasons ----------------------------------------------------------------------------


def test_without_a_change_there_is_no_reason_to_plan_anew() -> None:
    scene = Scene()

    assert not scene.wanted(6.0)
    assert not scene.say("a", held("t1", 0.0, completion_s=10.0)).wanted(7.0)
    assert not scene.say("a", done("t1", 10.0)).say("a", IDLE).wanted(60.0)
    assert scene.policy.next_deadline_s() is None


POP_UP = entries_of(mission(FLEET, TASKS))[-1]
GONE = replace(entries_of(mission(FLEET, TASKS))[3], withdrawn=True)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda scene: scene.lose("b"), "b lost"),
        (lambda scene: scene.say("b", OUT), "b lost"),
        (lambda scene: scene.say("coordinator", POP_UP), "late appeared"),
        (lambda scene: scene.say("coordinator", GONE), "t4 withdrawn"),
        (lambda scene: scene.say("a", failed("t1", 3.0)), "an attempt failed"),
        (lambda scene: scene.say("a", held("t1", 0.0, completion_s=40.0)), "the fleet is late"),
        (lambda scene: scene.lose("c").say("coordinator", POP_UP), "c lost, late appeared"),
    ],
)
def test_reasons_to_plan_anew(change: Callable[[Scene], Scene], reason: str) -> None:
    scene = change(Scene(margin=-1e9))

    assert scene.wanted(6.0)
    epoch = scene.judge(6.5, GOING_ON)
    assert epoch is not None
    assert epoch.reason.startswith(f"{reason}: worth ")


def test_a_return_is_a_reason_when_the_epoch_counts_without_the_uav() -> None:
    scene = Scene()
    scene.mission.credible.discard("b")
    scene.policy.begin(scene.situation(0.0), EXPECTED_S, 0.0)

    scene.mission.credible.add("b")

    assert scene.wanted(6.0)


def test_a_uav_that_is_lost_and_back_during_the_interval_is_no_reason() -> None:
    scene = Scene()
    assert not scene.lose("b").wanted(3.0)

    scene.mission.credible.add("b")

    assert not scene.wanted(6.0)
    assert scene.policy.next_deadline_s() is None


def test_an_epoch_of_unknown_origin_is_a_reason() -> None:
    scene = Scene()
    scene.policy.begin(None, {}, 10.0)

    assert not scene.wanted(12.0)
    assert scene.wanted(15.0)


def test_a_little_lateness_is_no_reason() -> None:
    # 3 s late of 64 s that are left; one of three UAVs has nothing that was planned.
    scene = Scene().say("a", held("t1", 0.0, completion_s=13.0))

    assert not scene.wanted(6.0)
    assert scene.say("a", held("t1", 0.0, completion_s=14.0)).wanted(6.0)


def test_who_is_overdue_gets_later_and_later() -> None:
    scene = Scene().say("a", held("t1", 0.0, completion_s=10.0))

    assert not scene.wanted(10.5)
    assert scene.wanted(15.0)


def test_nothing_is_wanted_when_nothing_is_open_or_nobody_is_left() -> None:
    scene = Scene().lose("b")
    for n in range(1, 8):
        scene.say("a", done(f"t{n}", 1.0 * n))
    assert not scene.wanted(30.0)

    assert not Scene().lose("a").lose("b").lose("c").wanted(30.0)


# -- when -------------------------------------------------------------------------------


def test_a_reason_during_the_interval_is_dealt_with_when_it_has_passed() -> None:
    scene = Scene().lose("b")

    assert not scene.wanted(2.0)
    assert scene.policy.next_deadline_s() == INTERVAL_S
    assert scene.wanted(INTERVAL_S)
    assert scene.policy.next_deadline_s() is None


def test_while_nothing_happens_the_plan_under_way_is_awaited() -> None:
    scene = Scene().lose("b")
    assert scene.wanted(6.0)

    assert not scene.say("a", held("t1", 6.5, completion_s=16.5)).wanted(7.0)
    assert scene.policy.next_deadline_s() is None


def test_what_happens_meanwhile_supersedes_the_plan_under_way() -> None:
    scene = Scene().lose("b")
    assert scene.wanted(6.0)
    assert scene.say("coordinator", POP_UP).wanted(7.0)

    assert [request.reason for request in scene.asked] == ["b lost", "b lost, late appeared"]
    assert not scene.wanted(7.5)
    assert scene.judge(8.0, FAR_BETTER, POOR, request=1) is None
    assert scene.judge(8.5, FAR_BETTER, POOR) is not None


def test_lateness_supersedes_no_plan() -> None:
    scene = Scene().lose("b")
    assert scene.wanted(6.0)

    assert not scene.say("a", held("t1", 0.0, completion_s=60.0)).wanted(7.0)

    scene.policy.drop()
    assert scene.wanted(6.0 + INTERVAL_S)
    assert scene.asked[-1].reason == "b lost, the fleet is late"


def test_a_restless_fleet_gets_a_plan_all_the_same() -> None:
    scene = Scene(fleet=[uav(f"u{n}", east_m=10.0 * n) for n in range(20)])
    asked_s = [6.0 + 0.5 * n for n in range(18) if scene.lose(f"u{n}").wanted(6.0 + 0.5 * n)]

    # For an interval each loss begins the plan anew; the last one of these is awaited.
    assert asked_s == [6.0 + 0.5 * n for n in range(10)]
    scene.judge(15.0, GOING_ON)
    assert scene.wanted(15.5)


def test_a_plan_under_way_is_stopped_once_it_is_for_nothing() -> None:
    scene = Scene().lose("b")
    assert scene.policy.stop() == []
    assert scene.wanted(6.0)

    assert scene.policy.stop() == [StopPlanning()]
    assert scene.judge(7.0, FAR_BETTER, POOR) is None


def test_after_an_epoch_the_next_waits_for_the_interval() -> None:
    scene = Scene().lose("b")
    assert scene.wanted(6.0)
    assert scene.judge(7.5, FAR_BETTER, POOR) is not None
    scene.say("coordinator", POP_UP)

    assert not scene.wanted(8.0)
    assert scene.policy.next_deadline_s() == 7.5 + INTERVAL_S
    assert scene.wanted(12.5)


def test_a_reason_that_has_been_judged_is_no_reason_again() -> None:
    scene = Scene().lose("b")
    assert scene.wanted(6.0)
    assert scene.judge(7.0, GOING_ON) is None

    assert not scene.wanted(20.0)


def test_a_change_that_nobody_looked_at_during_planning_is_a_reason_for_the_next() -> None:
    scene = Scene().lose("b")
    assert scene.wanted(6.0)
    scene.lose("c")
    scene.judge(7.0, GOING_ON)

    assert scene.wanted(6.0 + INTERVAL_S)


def test_even_plans_that_come_to_nothing_are_wanted_at_intervals() -> None:
    scene = Scene().lose("b")
    assert scene.wanted(6.0)
    assert scene.judge(7.0, GOING_ON) is None
    scene.lose("c")

    assert not scene.wanted(8.0)
    assert scene.policy.next_deadline_s() == 6.0 + INTERVAL_S


def test_what_comes_at_a_bad_moment_is_wanted_again() -> None:
    scene = Scene().lose("b")
    assert scene.wanted(6.0)

    scene.policy.drop()

    assert scene.judge(7.0, FAR_BETTER, POOR) is None
    assert scene.wanted(6.0 + INTERVAL_S)


def test_each_plan_is_made_of_the_situation_and_epoch_of_then_with_a_seed_of_its_own() -> None:
    scene = Scene().lose("b")
    assert scene.wanted(6.0)
    scene.judge(7.0, GOING_ON)
    assert scene.lose("c").wanted(12.0)

    first, second = scene.asked
    assert [first.situation.now_s, second.situation.now_s] == [6.0, 12.0]
    assert (first.request, first.seed, second.request, second.seed) == (1, 8, 2, 9)
    assert first.course == EpochPolicy.of(scene.epoch)
    assert first.method == "guided"


# -- whether ----------------------------------------------------------------------------


def test_a_plan_that_is_better_by_less_than_the_margin_is_no_epoch() -> None:
    # c first flies 10 m one way or the other; what follows differs by a few value·s in 6 400.
    almost = {"a": ("t1", "t2", "t3"), "b": ("t7", "t6"), "c": ("t4", "t5")}
    for margin, adopted in ((0.0, False), (-0.01, True), (0.1, False)):
        scene = Scene(margin=margin).lose("b")
        assert scene.wanted(6.0)
        assert (scene.judge(6.0, GOING_ON, GOING_ON) is not None) == adopted

    for margin, adopted in ((0.0, True), (0.02, False)):
        scene = Scene(margin=margin).say("coordinator", POP_UP)
        assert scene.wanted(6.0)
        assert (scene.judge(6.0, GOING_ON, almost) is not None) == adopted


def test_plans_are_valued_from_the_situation_of_now() -> None:
    b_alone = {"a": ("t1", "t2"), "b": ("t7", "t6", "t5", "t4", "t3"), "c": ()}
    scene = Scene().say("coordinator", POP_UP)
    assert scene.wanted(6.0)
    assert scene.judge(6.0, GOING_ON, b_alone) is not None

    scene = Scene().say("coordinator", POP_UP)
    assert scene.wanted(6.0)
    # By now all that the new plan does better is done.
    for name in ("t3", "t4", "t5", "t6", "t7"):
        scene.say("c", done(name, 6.5))
    assert scene.judge(7.0, GOING_ON, b_alone) is None


def test_a_plan_for_one_who_has_been_lost_since_counts_without_it() -> None:
    only_a = {"a": ("t1", "t2", "t3", "t4", "t5", "t6", "t7"), "b": (), "c": ()}
    scene = Scene().say("coordinator", POP_UP)
    assert scene.wanted(6.0)
    scene.lose("b").lose("c")

    # What b and c would have done falls to a, put where it costs least.
    epoch = scene.judge(7.0, GOING_ON, only_a)

    assert epoch is None


def test_a_plan_nobody_asked_for_is_no_epoch() -> None:
    assert Scene().judge(6.0, FAR_BETTER, POOR) is None

    scene = Scene().lose("b")
    assert scene.wanted(6.0)
    assert scene.judge(6.5, FAR_BETTER, POOR, request=0) is None
    assert scene.judge(6.5, FAR_BETTER, POOR) is not None


def test_a_plan_made_for_another_epoch_is_no_epoch() -> None:
    scene = Scene().lose("b")
    assert scene.wanted(6.0)
    scene.policy.begin(None, {}, 7.0)

    assert scene.judge(8.0, FAR_BETTER, POOR) is None


def test_once_nothing_is_open_any_more_there_is_no_epoch() -> None:
    scene = Scene(margin=-1e9).lose("b")
    assert scene.wanted(6.0)
    for n in range(1, 8):
        scene.say("a", done(f"t{n}", 1.0 * n))

    assert scene.judge(7.0, FAR_BETTER, POOR) is None


# -- what the epoch says ----------------------------------------------------------------


def test_every_task_is_on_a_list_after_what_was_before_it() -> None:
    scene = Scene(margin=-1e9)
    scene.say("a", done("t2", 3.0)).say("b", done("t2", 4.0)).say("a", held("t1", 4.0))
    scene.say("coordinator", GONE).say("coordinator", POP_UP).lose("b")
    assert scene.wanted(6.0)

    epoch = scene.judge(6.0, {"a": ("t3",), "b": (), "c": ("t5", "late", "t7", "t6")})

    assert epoch is not None
    assert (epoch.rule, epoch.sequence) == ("guided", ("a", "b", "c"))
    assert (epoch.number, epoch.phase, epoch.mission_s) == (2, MissionPhase.RUNNING, 6.0)
    assert epoch.routes == {"a": ("t2", "t1", "t3", "t4"), "c": ("t5", "late", "t7", "t6")}


def test_what_has_opened_since_is_on_no_list_so_that_uavs_find_a_place_for_it() -> None:
    scene = Scene(margin=-1e9).say("c", held("t7", 0.0)).lose("b")
    assert scene.wanted(6.0)
    scene.lose("c").say("coordinator", POP_UP)

    epoch = scene.judge(7.0, {"a": ("t1", "t2"), "c": ("t3", "t4")})

    assert epoch is not None
    assert epoch.routes == {"a": ("t1", "t2"), "c": ("t3", "t4")}


def test_a_task_beyond_all_who_take_part_is_on_a_list_all_the_same() -> None:
    scene = Scene(margin=-1e9, fleet=(uav("a", t3=0.0), uav("b"), uav("c", t3=0.0)))
    assert scene.lose("b").wanted(6.0)

    epoch = scene.judge(6.0, {"a": ("t1", "t2"), "c": ("t4", "t5", "t6", "t7")})

    assert epoch is not None
    assert epoch.routes["b"] == ("t3",)


def test_a_task_claimed_since_is_the_claimants() -> None:
    scene = Scene(margin=-1e9).lose("b")
    assert scene.wanted(6.0)
    scene.say("c", held("t1", 6.5))

    epoch = scene.judge(7.0, FAR_BETTER)

    assert epoch is not None
    assert epoch.routes["c"][0] == "t1"
    assert "t1" not in epoch.routes["a"]


def test_going_on_well_is_left_alone() -> None:
    scene = Scene().lose("b")
    assert scene.wanted(6.0)
    good = EpochPolicy("guided", (), {"a": ("t1", "t2", "t3", "t4"), "c": ("t5", "t6", "t7")})

    plan = replan(scene.situation(6.0), good, "guided")

    judged = scene.policy.judge(Replanned(1, plan), scene.situation(6.0), scene.epoch, 6.0)
    assert judged is None


def test_a_reason_may_be_long_but_fits_the_message() -> None:
    many = [task(f"x{n}", 5.0, appears_s=9.0) for n in range(40)]
    scene = Scene(margin=-1e9)
    for number, posted in enumerate(entries_of(mission(FLEET, many))):
        scene.say("coordinator", replace(posted, number=100 + number, task="x" * 60 + str(number)))
    assert scene.lose("b").wanted(6.0)

    epoch = scene.judge(7.0, GOING_ON)

    assert epoch is not None
    assert len(epoch.reason) == 200
    assert epoch.reason.endswith("value·s")


def test_without_the_fields_constraints_nothing_is_said_to_be_left_out() -> None:
    """Releases that fly such missions, too, could not read the epoch."""
    fleet = uav("a", t3=0.0), uav("b"), uav("c", t3=0.0)
    scene = Scene(margin=-1e9, fleet=fleet)
    assert scene.lose("b").wanted(6.0)
    epoch = scene.judge(6.0, {"a": ("t1", "t2"), "c": ("t4", "t5", "t6", "t7")})
    assert epoch is not None
    assert epoch.left_out == {}

    for name in ("t1", "t2", "t4", "t5", "t6", "t7"):
        scene.say("a", done(name, 7.0))
    assert scene.pursue(20.0) is None
