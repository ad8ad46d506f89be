"""What one step comes to, as it is carried out."""

from __future__ import annotations

from agent.core.interface import Action, GiveWay, GoTo, Hold, OrderVehicle
from agent.core.step_actions import arranged
from swarm.protocol.events import LogLine, Publish, PublishLast
from tests.support.builders import IDLE, message

FIRST, SECOND = (OrderVehicle(GoTo(leg, (10.0 * leg, 0.0, 10.0))) for leg in (1, 2))
HOLD, ASIDE = OrderVehicle(Hold("wait")), OrderVehicle(GiveWay(stands=True))
NOTE = LogLine("released", {})
SAID, LAST = Publish(message("u0", IDLE)), PublishLast(lambda: message("u0", IDLE))


def test_the_vehicle_comes_first_and_last_words_last() -> None:
    assert arranged([SAID, LAST, NOTE, HOLD, SAID]) == [HOLD, SAID, NOTE, SAID, LAST]


def test_of_several_targets_only_the_last_is_flown_to() -> None:
    actions: list[Action] = [FIRST, NOTE, HOLD, SECOND, SAID, ASIDE, SECOND]

    assert arranged(actions) == [HOLD, ASIDE, SECOND, NOTE, SAID]


def test_who_is_told_one_target_is_told_it() -> None:
    assert arranged([FIRST]) == [FIRST]
    assert arranged([NOTE, FIRST, HOLD]) == [FIRST, HOLD, NOTE]
