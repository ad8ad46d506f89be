"""What an agent says of its choices, when, and that nothing else follows from it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from agent.core.interface import Action, GoTo, OrderVehicle, Refused
from swarm.protocol.events import LogLine, Publish, PublishLast
from swarm.protocol.messages import Stamp, TaskEntry
from swarm.protocol.uav_messages import Choice, Claim
from tests.support.builders import entry, epoch, held, uav
from tests.support.lone_agent import ZERO_S, LoneAgent, claims, notes, orders

NEAR, MID, FAR = (
    entry(name, east_m=east_m, number=number, value=value)
    for number, (name, east_m, value) in enumerate(
        [("near", 4.0, 1.0), ("mid", 10.0, 5.0), ("far", 30.0, 2.0)]
    )
)


class Silent(LoneAgent):
    """One whose shell drops what it would say of its choices."""

    def _do(self, actions: Sequence[Action]) -> list[Action]:
        return super()._do([each for each in actions if not isinstance(each, PublishLast)])


def airborne(*tasks: TaskEntry, rule: str = "greedy") -> LoneAgent:
    """``u0``, 1 m/s, the only one there, as the mission begins."""
    agent = LoneAgent(uav("u0"))
    agent.fly_to(*tasks)
    lists = {"u0": tuple(task.task for task in tasks)}
    agent.hear("coordinator", replace(epoch("u0", rule=rule), routes=lists), 0.0)
    return agent


def choice_of(agent: LoneAgent) -> Choice:
    """The newest one."""
    body = agent.choices[-1].body
    assert isinstance(body, Choice)
    return body


def labels(actions: list[Action]) -> dict[str, object]:
    """What each line in the log says of the choice it is about."""
    return {a.text: a.fields.get("decision") for a in actions if isinstance(a, LogLine)}


# -- when it is said ------------------------------------------------------------------


def test_order_and_claim_come_first_and_the_choice_last_of_all() -> None:
    actions = airborne(NEAR, MID).log
    kinds = [type(action) for action in actions]
    decided = max(at for at, action in enumerate(actions) if isinstance(action, OrderVehicle))
    told = kinds.index(PublishLast)

    assert kinds.count(PublishLast) == 1
    assert decided < told == len(kinds) - 1
    assert any(isinstance(a, Publish) and isinstance(a.message.body, Claim) for a in actions)


def test_every_task_taken_is_a_choice_and_nothing_else_is() -> None:
    agent = airborne(NEAR, MID)
    agent.arrive(10.0)
    agent.arrive(20.0)
    agent.run_until(30.0)

    bodies = [said.body for said in agent.choices]
    assert [b.number for b in bodies if isinstance(b, Choice)] == [1, 2]
    assert [b.task for b in bodies if isinstance(b, Choice)] == ["mid", "near"]


def test_a_choice_is_no_register() -> None:
    agent = airborne(NEAR)
    known = [message.body for message in agent.core.memory(agent.now_s).messages]

    assert agent.choices
    assert not any(isinstance(body, Choice) for body in known)


def test_nothing_follows_from_leaving_choices_unsaid() -> None:
    said, unsaid = LoneAgent(uav("u0")), Silent(uav("u0"))
    for agent in (said, unsaid):
        agent.fly_to(NEAR, MID, FAR)
        agent.start_mission()
        for time_s in (10.0, 20.0, 60.0):
            agent.arrive(time_s)

    assert (len(said.choices), len(unsaid.choices)) == (3, 0)
    assert claims(said.log) == claims(unsaid.log)
    assert orders(said.log) == orders(unsaid.log)


# -- what it says ---------------------------------------------------------------------


@settings(max_examples=40, deadline=None)
@given(
    st.lists(st.tuples(st.floats(-90.0, 90.0), st.floats(0.5, 9.0)), min_size=1, max_size=9),
    st.floats(0.1, 1.0),
)
def test_greedy_candidates_are_scored_as_by_hand(
    places: list[tuple[float, float]], success: float
) -> None:
    tasks = [
        entry(f"t{n}", east_m=east_m, number=n, value=value, service_s=float(n % 3))
        for n, (east_m, value) in enumerate(places)
    ]
    agent = LoneAgent(uav("u0", **{task.task: success for task in tasks}))
    agent.fly_to(*tasks)
    agent.start_mission()

    choice = choice_of(agent)
    horizon_s = agent.brief.horizon_s
    by_hand = {
        task.task: (horizon_s - (abs(task.position_enu_m[0]) / 1.0 + task.service_s))
        * (success * task.value)
        for task in tasks
    }
    best = sorted(by_hand, key=lambda task: (-by_hand[task], int(task[1:])))[:5]

    assert [(c.task, c.score) for c in choice.candidates] == [(t, by_hand[t]) for t in best]
    assert (choice.task, choice.score) == (best[0], by_hand[best[0]])
    assert choice.second_score == (by_hand[best[1]] if len(best) > 1 else None)


@pytest.mark.parametrize("rule", ["greedy", "lookahead", "guided"])
def test_the_first_candidate_is_what_it_took(rule: str) -> None:
    choice = choice_of(airborne(FAR, NEAR, MID, rule=rule))

    assert choice.candidates[0].task == choice.task
    assert choice.candidates[0].score == choice.score
    assert {candidate.task for candidate in choice.candidates} == {"near", "mid", "far"}
    assert choice.candidates[1].score == choice.second_score
    assert choice.rule == rule


def test_of_a_long_tour_only_what_was_taken_is_valued() -> None:
    tasks = [entry(f"t{n}", east_m=5.0 * n, number=n) for n in range(14)]
    choice = choice_of(airborne(*tasks, rule="lookahead"))

    assert [(c.task, c.score) for c in choice.candidates] == [(choice.task, choice.score)]
    assert choice.second_score is not None


def test_it_names_what_was_known_before_the_claim() -> None:
    agent = LoneAgent(uav("u0"), uav("u1"))
    agent.fly_to(NEAR, MID)
    agent.hear("u1", held("near", 0.0))
    idle = max(a.message.stamp for a in agent.log if isinstance(a, Publish))
    agent.start_mission("u1", "u0")

    basis = choice_of(agent).basis
    claimed = next(
        a.message for a in agent.log if isinstance(a, Publish) and a.message.body == agent.claim
    )
    assert Stamp(*basis.heads["u0"]) <= idle < claimed.stamp
    assert basis.heads["u1"] == (1, 2)
    assert basis.credible == ("u1",)
    assert basis.place_enu_m == (0.0, 0.0, 0.0)
    assert basis.decided_s == choice_of(agent).chosen_s == 0.0


def test_turning_aside_names_the_task_that_was_left() -> None:
    agent = airborne(FAR, rule="guided")
    agent.tick(5.0)
    agent.be_at((5.0, 0.0, 10.0))
    actions = agent.post(entry("new", east_m=6.0, number=5))

    choice = choice_of(agent)
    assert "turns aside" in notes(actions)
    assert (choice.left, choice.task, choice.number) == ("far", "new", 2)
    assert choice.basis.heads["u0"] < (5, 99)
    assert {candidate.task for candidate in choice.candidates} == {"new", "far"}


# -- the log --------------------------------------------------------------------------


def test_lines_about_a_task_name_the_choice_it_came_of() -> None:
    agent = airborne(NEAR, MID)
    assert labels(agent.log)["decided"] == "u0-1"

    served = agent.arrive(10.0)
    assert labels(served) == {"task done": "u0-1", "decided": "u0-2"}

    leg = GoTo(agent.leg, (0.0, 0.0, 0.0))
    refused = labels(agent.happen(Refused(leg, "outside the fence"), 12.0))
    assert refused["vehicle refused"] == refused["released"] == "u0-2"


def test_turning_aside_is_logged_with_the_new_choice() -> None:
    agent = airborne(FAR, rule="guided")
    agent.tick(5.0)
    agent.be_at((5.0, 0.0, 10.0))
    actions = agent.post(entry("new", east_m=6.0, number=5))

    assert labels(actions) == {"turns aside": "u0-2", "decided": "u0-2"}


def test_a_claim_of_an_earlier_life_came_of_no_choice_of_this_one() -> None:
    earlier = airborne(NEAR)
    agent = earlier.reborn()
    assert agent.now_s > ZERO_S
    agent.see("coordinator")
    resumed = agent.learn_what_was_known_to(earlier)

    assert "resumes" in notes(resumed)
    assert labels(resumed)["resumes"] is None
    assert not agent.choices
