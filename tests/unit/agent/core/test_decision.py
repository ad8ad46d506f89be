"""Which task a UAV takes: the lower level, continued from what the registers say."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from agent.core.decision import DecisionTurn, decide, nothing_left
from swarm.allocation.lower_level import TeamState, decisions, rank_of
from swarm.allocation.problem import Problem
from swarm.allocation.rules import rule_by_name
from swarm.model import Mission, Uav
from swarm.model.ids import COORDINATOR
from swarm.protocol.board import TaskBoard, rule_of
from swarm.protocol.messages import Body, TaskEntry
from swarm.protocol.registers import Replica
from tests.support.builders import (
    IDLE,
    MISSION,
    brief,
    brief_of,
    done,
    entries_of,
    entry,
    epoch,
    failed,
    held,
    message,
    proposed,
    random_mission,
    uav,
)

FLEET = uav("u0"), uav("u1"), uav("u2")
NAMES = frozenset(u.id for u in FLEET)
WEST, MID, EAST = (
    entry(name, east_m=at, number=n)
    for n, (name, at) in enumerate({"west": -10.0, "mid": 4.0, "east": 20.0}.items())
)
TURN = DecisionTurn(
    uav="u0",
    now_s=0.0,
    decided_s=0.0,
    place_enu_m=(0.0, 0.0, 0.0),
    credible=NAMES - {"u0"},
    awaited=frozenset(),
    patience_s=0.5,
    excluded=frozenset(),
)


class Scene:
    """Registers as one UAV knows them when its turn comes."""

    def __init__(
        self,
        *tasks: TaskEntry,
        fleet: tuple[Uav, ...] = FLEET,
        sequence: tuple[str, ...] = ("u0", "u1", "u2"),
        rule: str = "greedy",
        of: Mission | None = None,
    ) -> None:
        self.replica = Replica()
        self.board = TaskBoard(self.replica, MISSION)
        self.counter = 0
        told: tuple[Body, ...] = (
            (brief(*fleet), *tasks) if of is None else (brief_of(of), *entries_of(of))
        )
        for body in (*told, epoch(*sequence, rule=rule)):
            self.say(COORDINATOR, body)

    def say(self, writer: str, body: Body) -> Scene:
        self.counter += 1
        self.replica.join(message(writer, body, self.counter))
        return self

    def choice(self, turn: DecisionTurn = TURN) -> str | None:
        """The task that the UAV whose turn it is takes."""
        problem, epoch_ = self.board.problem, self.replica.epoch
        assert problem is not None
        assert epoch_ is not None
        rule = rule_of(epoch_.rule, epoch_.routes)
        assert rule is not None
        decision = decide(problem, self.board, rule, turn)
        return None if decision is None else problem.task_ids[decision.task]


def test_alone_it_takes_its_best_open_task() -> None:
    assert Scene(WEST, MID, EAST).choice() == "mid"


def test_it_decides_from_its_place_and_the_time_of_now() -> None:
    turn = replace(TURN, place_enu_m=(18.0, 0.0, 0.0), now_s=7.0, decided_s=6.5)
    scene = Scene(WEST, MID, EAST)
    assert scene.choice(turn) == "east"

    problem = scene.board.problem
    assert problem is not None
    rule = rule_of("greedy", {})
    assert rule is not None
    decision = decide(problem, scene.board, rule, turn)
    assert decision is not None
    assert (decision.decided_s, decision.completion_s) == (7.0, 9.0)


@pytest.mark.parametrize("ended", ["done", "withdrawn", "excluded"])
def test_it_takes_no_task_that_is_not_open_to_it(ended: str) -> None:
    scene, turn = Scene(WEST, MID, EAST), TURN
    match ended:
        case "done":
            scene.say("u1", done("mid"))
        case "withdrawn":
            scene.say(COORDINATOR, replace(MID, withdrawn=True))
        case "excluded":
            turn = replace(turn, excluded={"mid"})

    assert scene.choice(turn) == "west"


def test_it_takes_no_task_it_is_incapable_of() -> None:
    assert Scene(WEST, MID, fleet=(uav("u0", mid=0.0), *FLEET[1:])).choice() == "west"
    assert Scene(MID, fleet=(uav("u0", mid=0.0), *FLEET[1:])).choice() is None


def test_there_is_nothing_to_take_where_nothing_is_open() -> None:
    assert Scene().choice() is None
    assert Scene(MID).say("u1", done("mid")).choice() is None


def test_stronger_claims_close_a_task_and_weaker_ones_do_not() -> None:
    turn = replace(TURN, now_s=3.0, decided_s=3.0)
    for claim, closed in (
        (held("mid", 99.0), True),
        (proposed("mid", 2.9, 9), True),
        (proposed("mid", 3.1), False),
        (proposed("mid", 3.0, 1), False),
    ):
        scene = Scene(WEST, MID, EAST).say("u1", claim)
        assert (scene.choice(turn) != "mid") is closed


@given(st.integers(0, 2**32 - 1))
def test_nothing_is_left_only_where_it_decides_for_nothing(seed: int) -> None:
    rng = np.random.default_rng(seed)
    scene = Scene(WEST, MID)
    for name in ("u0", "u1", "u2", "u1"):
        task, at_s = rng.choice(["west", "mid"]), float(rng.integers(2, 5))
        words = held(task, at_s + 9.0), proposed(task, at_s, int(rng.integers(3))), done(task)
        scene.say(name, words[rng.choice(3, p=[0.4, 0.4, 0.2])])
    excluded = {"mid"} if rng.random() < 0.2 else frozenset[str]()
    credible = NAMES - {"u0"} if rng.random() < 0.8 else {"u2"}
    turn = replace(TURN, now_s=5.0, decided_s=3.0, excluded=excluded, credible=credible)

    if nothing_left(scene.board, turn.decided_s, excluded, credible.__contains__):
        assert scene.choice(turn) is None


def test_nothing_is_left_where_each_open_task_is_kept_by_somebody_who_counts() -> None:
    scene = Scene(WEST, MID, EAST).say("u1", held("mid", 99.0)).say("u2", proposed("west", 2.9, 9))
    assert nothing_left(scene.board, 3.0, {"east"}, {"u1", "u2"}.__contains__)
    assert not nothing_left(scene.board, 3.0, set(), {"u1", "u2"}.__contains__)
    assert not nothing_left(scene.board, 3.0, {"east"}, {"u1"}.__contains__)
    assert not nothing_left(scene.board, 2.9, {"east"}, {"u1", "u2"}.__contains__)
    scene.say(COORDINATOR, brief(*FLEET, reattempt_failed=True)).say("u1", failed("mid"))
    assert not nothing_left(scene.board, 3.0, {"east"}, {"u1", "u2"}.__contains__)
    assert nothing_left(scene.say("u1", done("east")).board, 3.0, {"mid"}, {"u2"}.__contains__)


def test_rank_settles_proposals_of_one_instant() -> None:
    scene = Scene(WEST, MID, sequence=("u1", "u0")).say("u1", proposed("mid", 0.0, 0))

    assert scene.choice() == "west"


def test_claims_of_those_who_are_not_credible_close_nothing() -> None:
    scene = Scene(WEST, MID).say("u1", held("mid", 0.0))

    assert scene.choice(replace(TURN, credible={"u2"})) == "mid"


def test_the_own_earlier_claim_closes_nothing() -> None:
    assert Scene(WEST, MID).say("u0", held("mid", 0.0)).choice() == "mid"


def test_awaited_uavs_of_better_rank_choose_first_from_where_they_were_last() -> None:
    scene = Scene(WEST, MID, EAST, sequence=("u1", "u0")).say("u1", IDLE)
    turn = replace(TURN, awaited={"u1"})
    assert scene.choice(turn) == "west"

    scene.say(COORDINATOR, entry("far-east", east_m=21.0, number=9))
    scene.say("u1", done("far-east", 0.0))
    assert scene.choice(turn) == "mid"


def test_awaited_uavs_of_worse_rank_choose_later() -> None:
    scene = Scene(WEST, MID, sequence=("u0", "u1")).say("u1", IDLE)

    assert scene.choice(replace(TURN, awaited={"u1"})) == "mid"


def test_idle_uavs_that_are_awaited_no_longer_choose_nothing() -> None:
    assert Scene(WEST, MID, sequence=("u1", "u0")).say("u1", IDLE).choice() == "mid"


def test_one_that_will_be_free_at_the_same_instant_chooses_first_if_it_ranks_better() -> None:
    for sequence, choice in ((("u1", "u0"), "west"), (("u0", "u1"), "mid")):
        scene = Scene(WEST, MID, EAST, entry("now", east_m=1.0, number=3), sequence=sequence)
        scene.say("u1", held("now", 0.0, 0, completion_s=5.0))
        assert scene.choice(replace(TURN, now_s=5.0, decided_s=5.0)) == choice


def test_one_that_will_be_free_later_chooses_later_though_it_ranks_better() -> None:
    scene = Scene(WEST, MID, entry("now", number=3), sequence=("u1", "u0"))
    scene.say("u1", held("now", 0.0, 0, completion_s=5.1))

    assert scene.choice(replace(TURN, now_s=5.0, decided_s=5.0)) == "mid"


@pytest.mark.parametrize(("late_s", "choice"), [(0.4, "west"), (0.6, "mid")])
def test_one_that_is_late_is_awaited_as_long_as_patience_lasts(late_s: float, choice: str) -> None:
    """Whatever its rank: by the plan its turn has been."""
    scene = Scene(WEST, MID, EAST, entry("now", east_m=1.0, number=3), sequence=("u0", "u1"))
    scene.say("u1", held("now", 0.0, 0, completion_s=5.0 - late_s))

    assert scene.choice(replace(TURN, now_s=5.0, decided_s=5.0)) == choice


def test_someone_who_is_very_late_is_left_the_tasks_that_it_will_reach_first() -> None:
    """u1 stands at its task, beside its next one, which is nearer to u0 than u0's own."""
    at, beside, far = (
        entry(name, east_m=east_m, number=n)
        for n, (name, east_m) in enumerate({"at": 35.0, "beside": 40.0, "far": 75.0}.items())
    )
    routes = {"u0": ("far",), "u1": ("at", "beside")}
    scene = Scene(at, beside, far, fleet=FLEET[:2], sequence=("u1", "u0"))
    plan = replace(epoch("u1", "u0", rule="guided", number=2), routes=routes)
    scene.say(COORDINATOR, plan).say("u1", held("at", 0.0, 0, 35.0))
    turn = replace(TURN, place_enu_m=(50.0, 0.0, 0.0), now_s=50.0, decided_s=50.0)

    assert scene.choice(turn) == "far"
    assert scene.choice(replace(turn, credible=frozenset())) == "beside"


def test_nothing_odd_is_computed_about_someone_who_is_very_late() -> None:
    """Infinite times would meet a worth of 0 and make no number."""
    scene = Scene(
        entry("mid", value=0.0), entry("now", number=3), fleet=(uav("u0", mid=0.0), *FLEET[1:])
    )
    scene.say("u1", held("now", 0.0, 0, completion_s=1.0))

    assert scene.choice(replace(TURN, now_s=99.0, decided_s=99.0)) is None


# -- the plan, decision for decision ----------------------------------------------------


@given(st.integers(0, 10_000), st.sampled_from(["greedy", "lookahead"]))
def test_every_uav_finds_the_plans_next_decision_in_its_turn(seed: int, name: str) -> None:
    """Section III.C: a faultless run repeats the offline plan."""
    rng = np.random.default_rng(seed)
    mission = random_mission(rng, max_uavs=4, max_tasks=8)
    problem = Problem.from_mission(mission)
    order = rng.permutation(problem.n_uav)
    sequence = [problem.uav_ids[n] for n in order]
    scene = Scene(sequence=tuple(sequence), rule=name, of=mission)
    rule, rank = rule_by_name(name), rank_of(order.tolist())
    last: dict[int, tuple[int, float]] = {}
    for made in decisions(problem, TeamState.at_start(problem), rank, rule):
        place_enu_m = mission.uavs[made.uav].position_enu_m
        if made.uav in last:
            task, completed_s = last[made.uav]
            scene.say(problem.uav_ids[made.uav], done(problem.task_ids[task], completed_s))
            place_enu_m = mission.tasks[task].position_enu_m
        turn = DecisionTurn(
            uav=problem.uav_ids[made.uav],
            now_s=made.decided_s,
            decided_s=made.decided_s,
            place_enu_m=place_enu_m,
            credible=set(sequence) - {problem.uav_ids[made.uav]},
            awaited={u for n, u in enumerate(problem.uav_ids) if n not in last},
            patience_s=0.5,
            excluded=(),
        )
        task_id = problem.task_ids[made.task]
        assert scene.choice(turn) == task_id
        taken = held(task_id, made.decided_s, int(rank[made.uav]), made.completion_s)
        scene.say(turn.uav, taken)
        last[made.uav] = made.task, made.completion_s
