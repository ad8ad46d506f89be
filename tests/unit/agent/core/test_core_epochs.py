"""Another epoch comes: it counts at the next decision and not before."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from agent.core.interface import GoTo
from swarm.model.ids import COORDINATOR
from swarm.protocol.events import MessageReceived
from swarm.protocol.messages import PlanEpoch
from tests.support.builders import entry, epoch, message, uav
from tests.support.lone_agent import LoneAgent, claims, orders

PLACES_M = {"t0": 10.0, "t1": 20.0, "t2": 30.0}
TASKS = [entry(name, east_m=at_m, number=n) for n, (name, at_m) in enumerate(PLACES_M.items())]


def lists(number: int, *, first: str) -> PlanEpoch:
    """All tasks are on the list of ``u0``, the nearest last but for ``first``."""
    order = [first, *(name for name in reversed(PLACES_M) if name != first)]
    routes: Mapping[str, tuple[str, ...]] = {"u0": tuple(order)}
    return replace(epoch("u0", number=number, rule="guided"), routes=routes)


def flying() -> LoneAgent:
    agent = LoneAgent(uav("u0"))
    agent.fly_to(*TASKS)
    agent.hear(COORDINATOR, lists(1, first="t0"), 0.0)
    assert agent.task == "t0"
    return agent


def test_who_flies_to_a_task_does_nothing_about_a_new_epoch() -> None:
    agent = flying()
    agent.run_until(2.0)

    actions = agent.hear(COORDINATOR, epoch("u0", number=2, rule="greedy"), 4.0)
    actions += agent.hear(COORDINATOR, lists(3, first="t2"), 5.0)

    assert orders(actions) == []
    assert claims(actions) == []
    assert agent.task == "t0"


def test_its_next_decision_is_by_the_new_epoch() -> None:
    agent = flying()
    agent.hear(COORDINATOR, epoch("u0", number=2, rule="newer"), 4.0)

    assert [order for order in orders(agent.arrive(10.0)) if isinstance(order, GoTo)] == []
    assert agent.task is None

    actions = agent.hear(COORDINATOR, epoch("u0", number=3, rule="greedy"), 12.0)
    assert [order.position_enu_m[0] for order in orders(actions) if isinstance(order, GoTo)] == [20]


def test_of_two_epochs_with_one_number_that_of_the_later_coordinator_counts() -> None:
    """Two coordinators that could not hear each other may have counted alike."""
    north, south = (
        entry(name, number=9, position_enu_m=(20.0, north_m, 0.0))
        for name, north_m in {"north": 10.0, "south": -10.0}.items()
    )
    agent = LoneAgent(uav("u0"))
    agent.fly_to(*TASKS[:2], north, south)
    earlier, later = (
        replace(epoch("u0", number=2, rule="guided"), routes={"u0": ("t0", "t1", first, second)})
        for first, second in (("north", "south"), ("south", "north"))
    )
    agent.hear(COORDINATOR, earlier, 0.0)
    agent.arrive(10.0)
    assert agent.task == "t1"

    agent.happen(MessageReceived(message(COORDINATOR, later, counter=1, incarnation=2)), 11.0)
    agent.arrive(20.0)

    assert agent.task == "south"
