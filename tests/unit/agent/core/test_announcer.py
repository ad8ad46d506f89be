"""When one agent says its status again, and what it says to some alone."""

from __future__ import annotations

import pytest

from agent.core.announcer import Announcer
from swarm.protocol.events import Publish
from swarm.protocol.register_writer import RegisterWriter
from swarm.protocol.registers import Replica
from swarm.protocol.timing import Timing
from swarm.protocol.uav_messages import Status, StatusPhase
from tests.support.builders import held

STATUS = Status(StatusPhase.IDLE, None, None, None, None, None, {}, "")


def statuses_s(stretch: float, *steps_s: float) -> list[float]:
    """At which of these steps it says its status."""
    announcer = Announcer(RegisterWriter("m", "u0", 1), Replica(), Timing(status_s=0.2))
    announcer.stretch(stretch)
    return [
        now_s for now_s in steps_s if announcer.repeat(lambda: STATUS, now_s, learned=False) != []
    ]


@pytest.mark.parametrize("early_s", [0.01, 0.09])
def test_one_of_many_says_its_status_with_a_step_that_it_takes_soon_before(early_s: float) -> None:
    assert statuses_s(5.0, 0.0, 0.5, 1.0 - early_s, 1.0) == [0.0, 1.0 - early_s]


def test_one_of_many_does_not_say_it_with_each_step() -> None:
    assert statuses_s(5.0, 0.0, 0.3, 0.6, 0.89, 1.0) == [0.0, 1.0]


def test_one_of_few_says_it_when_it_is_due() -> None:
    assert statuses_s(1.0, 0.0, 0.19, 0.2) == [0.0, 0.2]


def test_what_is_said_to_some_is_new_to_all_others_until_it_is_said_again() -> None:
    """To those again it is no new statement, as nothing about it is."""
    replica = Replica()
    announcer = Announcer(RegisterWriter("m", "u0", 1), replica, Timing(announce_s=2.0))
    before, now = held("t0", 1.0), held("t0", 2.0)
    announcer.say(before)

    first = announcer.say_to(now, ["u1", "u2"])
    again = announcer.say_to(now, ["u1"])

    assert first.message.body == now
    assert (first.to, again.to) == (("u1", "u2"), ("u1",))
    assert again.message is first.message
    assert announcer.claimed is first.message
    assert announcer.announce(5.0) == [Publish(first.message)]
