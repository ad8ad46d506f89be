"""When one agent says its status again."""

from __future__ import annotations

import pytest

from agent.core.announcer import Announcer
from swarm.protocol.register_writer import RegisterWriter
from swarm.protocol.registers import Replica
from swarm.protocol.timing import Timing
from swarm.protocol.uav_messages import Status, StatusPhase

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
