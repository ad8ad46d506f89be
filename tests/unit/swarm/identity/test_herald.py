"""The herald goes on until everyone who is there has the new roster, or says who lacks it."""

from __future__ import annotations

from swarm.identity.announcer import AGAIN_S, FIRST_S, SETTLE_S, RosterAnnouncer
from swarm.protocol.events import (
    Ask,
    Finish,
    LinkChanged,
    MessageReceived,
    PeerGone,
    PeerSeen,
    Publish,
    SnapshotsReceived,
    Tick,
)
from swarm.protocol.messages import Message, Snapshot, roster_message

MISSION = "table-1"
OLD = roster_message(MISSION, 3, "old")
NEW = roster_message(MISSION, 4, "new")
NEWER = roster_message(MISSION, 5, "newer")
FORK = roster_message(MISSION, 4, "another")
PATIENCE_S = 10.0


def answer(writer: str, *messages: Message) -> Snapshot:
    return Snapshot(MISSION, writer, 1, None, messages)


def herald_with(*writers: str) -> RosterAnnouncer:
    announcer = RosterAnnouncer(NEW, {"uav1", "uav2", "coordinator"}, PATIENCE_S)
    assert announcer.start(0.0) == []
    for writer in writers:
        announcer.step(PeerSeen(writer), 0.1)
    assert announcer.step(Tick(), FIRST_S) == [Publish(NEW), Ask()]
    return announcer


def test_it_ends_when_all_leave_the_roster_out_of_their_answers() -> None:
    announcer = herald_with("uav1", "coordinator")

    answers = SnapshotsReceived((answer("uav1"), answer("coordinator")))

    assert announcer.step(answers, SETTLE_S) == [Finish(0)]
    assert announcer.has == {"uav1", "coordinator"}
    assert announcer.lacking == []


def test_it_says_the_roster_again_to_who_answers_with_an_older_one() -> None:
    announcer = herald_with("uav1", "uav2")

    assert announcer.step(SnapshotsReceived((answer("uav1"), answer("uav2", OLD))), SETTLE_S) == []

    assert announcer.lacking == ["uav2"]
    assert announcer.next_deadline_s() == SETTLE_S + AGAIN_S
    assert announcer.step(Tick(), SETTLE_S + AGAIN_S) == [Publish(NEW), Ask()]
    assert announcer.step(SnapshotsReceived((answer("uav2"),)), SETTLE_S + AGAIN_S + 0.1) == [
        Finish(0)
    ]


def test_answers_from_before_a_router_began_anew_do_not_end_it() -> None:
    announcer = herald_with("uav1")

    assert announcer.step(SnapshotsReceived((answer("uav1"),)), FIRST_S + 0.01) == []
    announcer.step(LinkChanged(False), 0.5)
    announcer.step(PeerGone("uav1"), 0.5)
    announcer.step(LinkChanged(True), SETTLE_S)
    assert announcer.step(SnapshotsReceived((answer("uav1"),)), SETTLE_S + 0.1) == []
    assert announcer.step(SnapshotsReceived((answer("uav1"),)), SETTLE_S + AGAIN_S) == [Finish(0)]


def test_who_went_without_a_word_is_told_of() -> None:
    announcer = herald_with("uav1", "uav2")
    announcer.step(PeerGone("uav2"), 0.3)
    now_s = SETTLE_S
    while now_s < PATIENCE_S - AGAIN_S:
        assert announcer.step(SnapshotsReceived((answer("uav1"),)), now_s) == []
        now_s += AGAIN_S
        assert announcer.step(Tick(), now_s) == [Publish(NEW), Ask()]

    assert announcer.step(Tick(), PATIENCE_S) == [Finish(0)]
    assert announcer.lacking == ["uav2"]


def test_where_nobody_is_it_ends_once_routers_have_begun_anew() -> None:
    announcer = herald_with()

    assert announcer.step(SnapshotsReceived(()), SETTLE_S - 0.1) == []
    assert announcer.step(SnapshotsReceived(()), SETTLE_S) == [Finish(0)]
    assert announcer.has == set()


def test_a_fleet_that_is_further_on_ends_it() -> None:
    for roster in (NEWER, FORK):
        announcer = herald_with("uav1")

        assert announcer.step(SnapshotsReceived((answer("uav1", roster),)), 0.3) == [Finish(0)]
        assert announcer.other_version == roster.stamp.incarnation


def test_it_waits_for_no_one_who_is_out() -> None:
    announcer = herald_with("uav1", "uav3")

    assert announcer.step(SnapshotsReceived((answer("uav1"),)), SETTLE_S) == [Finish(0)]
    assert announcer.seen == {"uav1"}


def test_its_own_word_confirms_nothing() -> None:
    announcer = herald_with("uav1")

    assert announcer.step(MessageReceived(NEW), SETTLE_S) == []
    assert announcer.lacking == ["uav1"]


def test_it_asks_for_no_more_than_it_has_not_heard() -> None:
    announcer = herald_with("uav1")
    before = dict(announcer.known())

    announcer.step(SnapshotsReceived((answer("uav1", OLD),)), 0.5)

    assert dict(announcer.known()) == before
    assert set(before) == {"authority"}
