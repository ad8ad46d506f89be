"""Deciding again from what was heard: faultless flights give the same, and a change is noticed."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

import numpy as np
import pytest

from sim.world.redecision import RedecisionResult, redecide, redecided_as_json, redecided_lines
from sim.world.stochastic_world import StochasticWorld
from sim.world.uncertainty import Uncertainty
from sim.world.virtual_world import World
from swarm.model import Mission
from swarm.protocol.events import CommonEvent, MessageReceived
from swarm.protocol.messages import Body, Message, TaskEntry
from swarm.protocol.uav_messages import Choice, Outcome
from tests.support.builders import with_accelerations
from tests.support.fleet_builders import Ear, plan_for, random_mission


def hear(mission: Mission, method: str, seed: int) -> list[CommonEvent]:
    """What an observer hears of a flight in which nothing goes wrong."""
    world, ear = World(mission, plan_for, method=method, seed=seed), Ear()
    world.admit("ear", ear)
    assert world.run(limit_s=1e5)
    return ear.facts


def heard(method: str, seed: int, *, most: int = 15, popup_frac: float = 0.0) -> list[CommonEvent]:
    """The same of a random mission."""
    rng = np.random.default_rng([seed, most])
    n_uav, n_task = int(rng.integers(1, 6)), int(rng.integers(2, most + 1))
    mission = random_mission(rng, n_uav=n_uav, n_task=n_task, popup_frac=popup_frac)
    return hear(mission, method, seed)


@pytest.fixture(scope="module")
def facts() -> list[CommonEvent]:
    """Of three UAVs and twelve tasks."""
    return hear(random_mission(np.random.default_rng(2), n_uav=3, n_task=12), "greedy", 2)


def body_of(fact: CommonEvent) -> Body | None:
    return fact.message.body if isinstance(fact, MessageReceived) else None


def choices_in(facts: Iterable[CommonEvent]) -> list[Choice]:
    return [body for fact in facts if isinstance(body := body_of(fact), Choice)]


def altered(
    facts: Sequence[CommonEvent], number: int, change: Callable[[Choice], Choice]
) -> list[CommonEvent]:
    """``facts`` with the first choice of that number changed."""
    at, said = next(
        (at, fact.message)
        for at, fact in enumerate(facts)
        if isinstance(fact, MessageReceived)
        and isinstance(fact.message.body, Choice)
        and fact.message.body.number == number
    )
    assert isinstance(said.body, Choice)
    return [*facts[:at], MessageReceived(replace(said, body=change(said.body))), *facts[at + 1 :]]


@pytest.mark.parametrize("popup_frac", [0.0, 0.3])
@pytest.mark.parametrize(
    ("method", "most"), [("greedy", 20), ("lookahead", 10), ("lookahead", 18), ("guided", 20)]
)
def test_every_choice_of_a_faultless_flight_comes_out_the_same(
    method: str, most: int, popup_frac: float
) -> None:
    for seed in range(4):
        facts = heard(method, seed, most=most, popup_frac=popup_frac)

        assert redecide(facts) == RedecisionResult(len(choices_in(facts)), (), 0)


def test_choices_of_uavs_that_speed_up_slowly_come_out_the_same() -> None:
    rng = np.random.default_rng(7)
    mission = with_accelerations(random_mission(rng, n_uav=3, n_task=12, popup_frac=0.3), rng)
    for method in ("greedy", "lookahead", "guided"):
        facts = hear(mission, method, 1)

        assert redecide(facts) == RedecisionResult(len(choices_in(facts)), (), 0)


def test_turning_aside_comes_out_the_same_too() -> None:
    turned = 0
    for seed in range(4):
        facts = heard("guided", seed, popup_frac=0.5)
        turned += sum(choice.left is not None for choice in choices_in(facts))

        assert redecide(facts).ok
    assert turned > 0


@pytest.mark.parametrize("method", ["greedy", "guided"])
@pytest.mark.parametrize(
    "uncertainty",
    [
        Uncertainty(loss=0.5, popup=0.3),
        Uncertainty(message_loss=0.2),
        Uncertainty(partitions_per_min=3.0, partition_s=10.0),
    ],
    ids=["losses", "lost messages", "cuts"],
)
def test_whatever_goes_wrong_nothing_comes_out_otherwise(
    method: str, uncertainty: Uncertainty
) -> None:
    rng = np.random.default_rng(20)
    mission = random_mission(rng, n_uav=5, n_task=20)
    fate = uncertainty.draw(mission, 100.0, seed=1)
    flown, ear = StochasticWorld(fate, plan_for, method=method, seed=1), Ear()
    flown.world.admit("ear", ear)
    flown.run()

    found = redecide(ear.facts)

    assert found.ok
    assert found.choices == len(choices_in(ear.facts))


@pytest.mark.parametrize(
    "change",
    [
        lambda choice: replace(choice, task="t99"),
        lambda choice: replace(choice, score=float(np.nextafter(choice.score, np.inf))),
        lambda choice: replace(choice, completion_s=choice.completion_s + 1e-9),
        lambda choice: replace(choice, chosen_s=choice.chosen_s + 0.1),
        lambda choice: replace(choice, left="t00"),
        lambda choice: replace(choice, basis=replace(choice.basis, place_enu_m=(-500.0, 0.0, 0.0))),
        lambda choice: replace(choice, basis=replace(choice.basis, excluded=(choice.task,))),
    ],
    ids=["task", "score", "completion", "time", "left", "place", "excluded"],
)
def test_a_choice_that_was_altered_comes_out_otherwise(
    facts: list[CommonEvent], change: Callable[[Choice], Choice]
) -> None:
    found = redecide(altered(facts, 2, change))

    assert [each.choice.number for each in found.differing] == [2]
    assert (found.agreeing, found.without_inputs) == (11, 0)
    assert not found.ok


def test_statements_that_were_altered_leave_choices_without_inputs(
    facts: list[CommonEvent],
) -> None:
    def dearer(fact: CommonEvent) -> CommonEvent:
        match fact:
            case MessageReceived(Message(body=TaskEntry() as entry) as said):
                return MessageReceived(replace(said, body=replace(entry, value=9.5)))
            case _:
                return fact

    assert redecide(map(dearer, facts)) == RedecisionResult(0, (), 12)
    assert not redecide(map(dearer, facts)).ok


def test_choices_that_rest_on_what_is_missing_are_counted_and_the_others_checked(
    facts: list[CommonEvent],
) -> None:
    first = next(fact for fact in facts if isinstance(body_of(fact), Outcome))
    found = redecide(fact for fact in facts if fact != first)

    assert not found.differing
    assert (found.agreeing, found.without_inputs) == (3, 9)


def test_whatever_comes_twice_or_late_counts_once(facts: list[CommonEvent]) -> None:
    assert redecide(facts + facts[::-1]) == redecide(facts)


def test_no_choices_are_no_success() -> None:
    assert redecide([]) == RedecisionResult(0, (), 0)
    assert not redecide([]).ok


def test_differences_are_told_with_what_was_chosen_and_what_comes_out_now(
    facts: list[CommonEvent],
) -> None:
    found = redecide(altered(facts, 2, lambda choice: replace(choice, task="t99", score=1.25)))
    each = found.differing[0]
    line, total = redecided_lines("meadow", found)
    told = redecided_as_json("meadow", found)

    assert line.startswith(f"{each.uav}-2 at ")
    assert "took t99 (score 1.25, done at " in line
    assert f"decided again: {each.task} (score {each.score!r}" in line
    assert "11 come out the same" in total
    assert (told["choices"], told["agreeing"], told["without_inputs"]) == (12, 11, 0)
    assert told["differing"][0]["recorded"]["task"] == "t99"
    assert told["differing"][0]["again"]["task"] == each.task
