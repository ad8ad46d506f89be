"""What an observer keeps of choices, and tells of them."""

from __future__ import annotations

from coordinator.mission_view.fleet_reports import CHOICES_KEPT
from swarm.protocol.events import MessageReceived
from swarm.protocol.messages import Message, Stamp
from tests.support.builders import choice, mission, task, uav
from tests.support.observed_mission import Teller

MISSION = mission([uav("u0"), uav("u1")], [task("t0", 1.0), task("t1", 2.0)])


def texts(teller: Teller) -> list[str]:
    return [happening.text for happening in teller.mission_state.story]


def test_choices_are_kept_in_order_of_arrival_and_each_once() -> None:
    teller = Teller(MISSION)
    first = Message(MISSION.name, "u0", Stamp(1, 4), choice("t0"))
    second = Message(MISSION.name, "u1", Stamp(1, 2), choice("t1"))
    for message in (first, second, first, second):
        teller.mission_state.step(MessageReceived(message), 1.0)

    kept = teller.mission_state.choices
    assert [(uav, stamp, body.task) for uav, stamp, body in kept] == [
        ("u0", Stamp(1, 4), "t0"),
        ("u1", Stamp(1, 2), "t1"),
    ]
    assert all(not body.basis.heads for *_, body in kept)


def test_the_oldest_go_when_there_are_too_many() -> None:
    teller = Teller(MISSION)
    for number in range(CHOICES_KEPT + 3):
        teller.say("u0", choice("t0", number=number))

    kept = teller.mission_state.choices
    assert len(kept) == CHOICES_KEPT
    assert [kept[0][2].number, kept[-1][2].number] == [3, CHOICES_KEPT + 2]


def test_turning_aside_is_told_once() -> None:
    teller = Teller(MISSION)
    teller.begin()
    turned = Message(MISSION.name, "u0", Stamp(1, 90), choice("t1", left="t0"))
    teller.say("u0", choice("t0"))
    teller.mission_state.step(MessageReceived(turned), 2.0)
    teller.mission_state.step(MessageReceived(turned), 3.0)

    assert [text for text in texts(teller) if "aside" in text] == ["u0 turns aside from t0 to t1"]


def test_a_choice_changes_nothing_of_the_state_of_affairs() -> None:
    teller = Teller(MISSION)
    teller.begin()
    before = teller.mission_state.result(), list(teller.mission_state.replica.messages())
    teller.say("u0", choice("t0"), 2.0)

    assert (teller.mission_state.result(), list(teller.mission_state.replica.messages())) == before
    assert teller.mission_state.holders == {}
