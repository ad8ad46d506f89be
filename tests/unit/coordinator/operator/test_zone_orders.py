"""Zones that an operator draws and takes away, and words that a UAV may start again."""

from __future__ import annotations

from dataclasses import replace

import pytest

from coordinator.operator.commands import RequestResult
from coordinator.operator.readiness import ReadyRequest
from coordinator.operator.zone_edits import NewZone, UnsoundZoneError, ZoneRemoval
from swarm.model.frames import DEFAULT_ORIGIN, wgs84_from_enu
from swarm.model.ids import COORDINATOR, OPERATOR
from swarm.protocol.encoding import SMALL_LIMIT_BYTES, encode
from swarm.protocol.events import LinkChanged, PeerGone, PeerSeen, Tick
from swarm.protocol.field_messages import BaseSpec, UavReady, ZoneEdit, ZoneSpec
from swarm.protocol.messages import MissionPhase
from swarm.protocol.operator_commands import NOT_READY, zones_in_force
from swarm.protocol.uav_messages import BaseStage, Claim, ClaimPhase, Status, StatusPhase
from tests.support.builders import brief, epoch, held, message, uav
from tests.support.order_desk import FLEET, PATIENCE_S, TIMING, Desk, came

SQUARE = ((20.0, 20.0), (30.0, 20.0), (30.0, 30.0), (20.0, 30.0))
DRAWN = NewZone("z", SQUARE)
SPEC = ZoneSpec("z", SQUARE, (), None, None, False)


def test_a_zone_is_drawn_once_everybody_there_has_confirmed_it() -> None:
    desk = Desk()
    tracked = desk.give(replace(DRAWN, ceiling_m=90.0, reason="helicopter"))
    desk.wait(2.5 * TIMING.announce_s)
    said = ZoneEdit(replace(SPEC, ceiling_m=90.0), False, 1, "helicopter")
    assert {each.body for each in desk.said} == {said}
    assert len(desk.said) == 3, "repeated"
    assert tracked.verdict is None

    desk.confirm(tracked, "u0")
    assert tracked.verdict is None
    desk.confirm(tracked, "u1")
    assert came(tracked) == (RequestResult.OBEYED, "zone z is drawn")
    assert zones_in_force(desk.mission_state.replica) == (said.zone,)
    assert [zone.id for zone in desk.mission_state.mission.zones] == ["z"]


def test_it_is_told_what_lies_in_a_zone() -> None:
    desk = Desk()
    around = NewZone("z", ((-5.0, -5.0), (5.0, -5.0), (5.0, 5.0), (-5.0, 5.0)))
    tracked = desk.give(around)
    desk.confirm(tracked, "u0", "u1")

    text = "the start of u0, the start of u1, t0 and 1 more lie in it or nearer than the margin"
    assert came(tracked)[1] == f"zone z is drawn; {text}"


def test_who_has_not_confirmed_a_zone_in_time_is_named() -> None:
    desk = Desk()
    tracked = desk.give(DRAWN)
    desk.confirm(tracked, "u0")
    desk.wait(PATIENCE_S)
    assert came(tracked) == (
        RequestResult.NOT_OBEYED,
        "zone z is drawn; u1 has not confirmed it",
    )

    unheard = desk.give(NewZone("y", SQUARE))
    desk.wait(2.0 * PATIENCE_S)
    assert came(unheard)[0] is RequestResult.NOT_OBEYED


def test_who_has_not_shown_its_token_yet_is_waited_for() -> None:
    desk = Desk(seen=("u0",), looked_for_s=0.5)
    tracked = desk.give(DRAWN)
    desk.confirm(tracked, "u0", COORDINATOR)
    assert tracked.verdict is None, "u1 may be there"

    desk.happen(PeerSeen("u1"), 0.2)
    desk.confirm(tracked, "u0")
    assert tracked.verdict is None
    desk.confirm(tracked, "u1")
    assert came(tracked) == (RequestResult.OBEYED, "zone z is drawn")


def test_who_does_not_show_its_token_in_time_is_not_there() -> None:
    desk = Desk(seen=("u0",), looked_for_s=0.5)
    tracked = desk.give(DRAWN)
    desk.confirm(tracked, "u0")
    shown_s = TIMING.relink_grace_s - 0.5
    desk.wait(shown_s - 0.01)
    assert tracked.verdict is None

    desk.wait(shown_s)
    assert came(tracked) == (RequestResult.OBEYED, "zone z is drawn")


def test_after_the_own_link_was_down_everybody_may_have_to_be_seen_anew() -> None:
    desk = Desk(seen=("u0",))
    desk.happen(LinkChanged(up=False), 5.0)
    desk.happen(LinkChanged(up=True), 6.0)
    tracked = desk.give(DRAWN)
    desk.confirm(tracked, "u0")
    assert tracked.verdict is None
    desk.wait(6.0 + TIMING.relink_grace_s)
    assert came(tracked)[0] is RequestResult.OBEYED


def test_a_zone_is_taken_away_that_was_drawn_or_that_the_scenario_has() -> None:
    desk = Desk()
    desk.hear(COORDINATOR, replace(brief(*FLEET), zones=(SPEC,)))
    tracked = desk.give(ZoneRemoval("z", "over"))
    assert desk.said[-1].body == ZoneEdit(SPEC, True, 1, "over")
    desk.confirm(tracked, "u0", "u1")
    assert came(tracked) == (RequestResult.OBEYED, "zone z is taken away")
    assert zones_in_force(desk.mission_state.replica) == ()

    again = desk.give(ZoneRemoval("z"))
    assert came(again) == (RequestResult.UNKNOWN_ZONE, "the zones are none")


def test_a_zone_that_is_there_is_drawn_anew_only_when_asked_to() -> None:
    desk = Desk()
    desk.confirm(desk.give(DRAWN), "u0", "u1")
    assert came(desk.give(DRAWN))[0] is RequestResult.TAKEN_ID

    moved = tuple((east_m + 50.0, north_m) for east_m, north_m in SQUARE)
    desk.give(NewZone("z", moved, replaces=True))
    (zone,) = zones_in_force(desk.mission_state.replica)
    assert zone.polygon_enu_m == moved


def test_another_operators_later_word_about_the_zone_counts() -> None:
    desk = Desk()
    tracked = desk.give(DRAWN)
    desk.hear(OPERATOR, ZoneEdit(SPEC, True, 1, ""))
    assert tracked.verdict is None, "it was said below ours"

    later = replace(message(OPERATOR, ZoneEdit(SPEC, True, 1, ""), 9, incarnation=60))
    desk.mission_state.take_note(later, desk.now_s)
    desk.happen(Tick())
    assert came(tracked) == (
        RequestResult.NOT_OBEYED,
        "another operator has changed zone z meanwhile",
    )


def test_nothing_is_drawn_once_the_mission_has_ended() -> None:
    desk = Desk()
    desk.hear(COORDINATOR, epoch("u0", "u1", number=2, phase=MissionPhase.ENDED))

    assert came(desk.give(DRAWN))[0] is RequestResult.NOT_OBEYED
    assert not [said for said in desk.said if isinstance(said.body, ZoneEdit)]


def test_corners_in_degrees_lie_where_the_missions_origin_says() -> None:
    desk = Desk()
    origin = replace(DEFAULT_ORIGIN, lat_deg=47.0, lon_deg=8.0, alt_m=400.0)
    degrees = tuple(wgs84_from_enu(origin, (*corner, 0.0))[:2] for corner in SQUARE)
    desk.give(NewZone("z", degrees, in_degrees=True))

    edit = desk.said[-1].body
    assert isinstance(edit, ZoneEdit)
    for found, corner in zip(edit.zone.polygon_enu_m, SQUARE, strict=True):
        assert found == pytest.approx(corner, abs=1e-6)


@pytest.mark.parametrize(
    ("wrong", "problem", "remedy"),
    [
        ({"zone": "a/b"}, "'a/b' is no id", "give 1 to 64"),
        ({"polygon": SQUARE[:2]}, "at least three corners, not 2", "three corners"),
        ({"polygon": (*SQUARE[:2], SQUARE[3], (32.0, 28.0))}, "crosses", "simple polygon"),
        ({"polygon": ((0.0, 0.0), (1.0, 1.0), (2.0, 2.0))}, "encloses nothing", "simple"),
        ({"polygon": ((0.0, 0.0), (float("nan"), 1.0), (2.0, 2.0))}, "too far", "metres"),
        ({"floor_m": 50.0, "ceiling_m": 20.0}, "above its floor_m", "ceiling above"),
        ({"ceiling_m": 1e9}, "ceiling_m of zone z is 1e+09", "within"),
        ({"in_degrees": True, "polygon": ((95.0, 0.0), *SQUARE)}, "no latitude", "degrees"),
        ({"holes": (((90.0, 90.0), (91.0, 90.0), (91.0, 91.0)),)}, "hole lies outside", "simple"),
    ],
)
def test_what_is_no_zone_is_refused_in_one_line(
    wrong: dict[str, object], problem: str, remedy: str
) -> None:
    with pytest.raises(UnsoundZoneError, match=problem.replace("+", r"\+")) as caught:
        replace(DRAWN, **wrong)  # type: ignore[arg-type]  # each case names real fields
    assert remedy in caught.value.remedy
    assert "\n" not in str(caught.value)


def test_as_many_corners_as_it_says_have_room_in_a_message() -> None:
    corners = [(100.0 + i * 0.1, 0.001 * i * i) for i in range(400)]
    with pytest.raises(UnsoundZoneError, match="has 400 corners, and a message has room for") as no:
        NewZone("z", tuple(corners))
    room = int(str(no.value).rpartition(" ")[2])

    desk = Desk()
    desk.give(NewZone("z", tuple(corners[:room])))
    assert len(encode(desk.said[-1])) <= SMALL_LIMIT_BYTES
    with pytest.raises(UnsoundZoneError):
        NewZone("z", tuple(corners[: room + 1]))


# -- a UAV that may start again -------------------------------------------------------------


SWAPPING = Claim(
    ClaimPhase.HELD, None, 1.0, 0, 90.0, base="b0", stage=BaseStage.LANDED, arrives_s=20.0
)


def at_a_base() -> Desk:
    desk = Desk()
    base = BaseSpec("b0", (0.0, 0.0, 0.0), 60.0, 1)
    desk.hear(COORDINATOR, replace(brief(*FLEET), bases=(base,)))
    desk.hear("u0", SWAPPING)
    desk.wishes.clear()
    return desk


def standing(note: str) -> Status:
    return Status(StatusPhase.SERVING, None, (0.0, 0.0, 0.0), None, 0.9, 30.0, {}, note)


def test_a_uav_at_a_base_may_start_once_it_has_confirmed_so_and_its_battery_is_full() -> None:
    desk = at_a_base()
    tracked = desk.give(ReadyRequest("u0", "battery 7"))
    assert [said.body for said in desk.said] == [UavReady("u0", 1, "battery 7")]
    desk.confirm(tracked, "u1")
    assert tracked.verdict is None
    desk.confirm(tracked, "u0")
    assert tracked.verdict is None
    desk.hear("u0", replace(SWAPPING, phase=ClaimPhase.IDLE))
    assert came(tracked) == (RequestResult.OBEYED, "u0 may start again from b0")


def test_a_uav_whose_battery_is_not_full_refuses_with_the_reason() -> None:
    desk = at_a_base()
    why = "battery at 30%, below the 90% of a full one"
    desk.hear("u0", standing(f"{NOT_READY}an older reason"))
    tracked = desk.give(ReadyRequest("u0"))
    desk.confirm(tracked, "u0")
    assert tracked.verdict is None, "what it says of its vehicle may be older than the word"
    desk.hear("u0", standing(f"{NOT_READY}{why}"))
    assert came(tracked) == (RequestResult.NOT_OBEYED, f"u0 stays on the ground: {why}")


def test_what_a_uav_that_may_start_still_waits_for_is_told_in_the_end() -> None:
    desk = at_a_base()
    tracked = desk.give(ReadyRequest("u0"))
    desk.confirm(tracked, "u0")
    for _ in range(2):
        desk.hear("u0", standing("waiting to hear its charge"))
    assert tracked.verdict is None
    desk.wait(PATIENCE_S)
    text = "u0 may start again from b0, not yet: waiting to hear its charge"
    assert came(tracked) == (RequestResult.OBEYED, text)


@pytest.mark.parametrize(
    ("claim", "why"),
    [
        (
            replace(SWAPPING, stage=BaseStage.PARKED, sortie_end_s=20.0),
            "u0 waits for a slot of b0: say so once its battery is changed there",
        ),
        (replace(SWAPPING, sortie_end_s=50.0), "u0 has not touched down at b0 yet"),
    ],
    ids=["beside the slots", "coming down"],
)
def test_who_has_no_new_battery_yet_cannot_be_let_start(claim: Claim, why: str) -> None:
    desk = at_a_base()
    desk.hear("u0", claim)

    assert came(desk.give(ReadyRequest("u0"))) == (RequestResult.NOT_OBEYED, why)
    assert desk.said == []


def test_a_uav_that_has_gone_on_was_ready() -> None:
    desk = at_a_base()
    tracked = desk.give(ReadyRequest("u0"))
    desk.hear("u0", held("t1", 30.0))
    assert came(tracked) == (RequestResult.OBEYED, "u0 flies to t1")


def test_of_a_lost_uav_the_others_confirm_that_its_slot_is_free() -> None:
    desk = at_a_base()
    desk.happen(PeerGone("u0"))
    desk.mission_state.step(Tick(), desk.now_s + TIMING.loss_delay_s)
    assert desk.mission_state.present == {"u1"}
    tracked = desk.give(ReadyRequest("u0"))
    desk.confirm(tracked, "u1")
    assert came(tracked) == (
        RequestResult.OBEYED,
        "u0 is not there; its slot at b0 counts as free",
    )


def test_who_stands_at_no_base_is_not_waited_for() -> None:
    desk = at_a_base()
    assert came(desk.give(ReadyRequest("u9")))[0] is RequestResult.UNKNOWN_UAV
    result, text = came(desk.give(ReadyRequest("u1")))
    assert (result, text) == (
        RequestResult.NOT_OBEYED,
        "u1 does not stand at a base: it is in the air, or at home",
    )
    assert desk.said == []


def test_a_uav_that_does_not_confirm_is_named() -> None:
    desk = at_a_base()
    tracked = desk.give(ReadyRequest("u0"))
    desk.confirm(tracked, "u1")
    desk.wait(PATIENCE_S)
    assert came(tracked) == (
        RequestResult.NOT_OBEYED,
        f"u0 has not confirmed it within {PATIENCE_S:g} s",
    )


def test_each_word_is_said_above_the_last_so_that_it_counts_once_more() -> None:
    desk = at_a_base()
    first, second = desk.give(ReadyRequest("u0")), desk.give(ReadyRequest("u0"))
    assert first.said is not None
    assert second.said is not None
    assert second.said.stamp > first.said.stamp
    assert uav("u0").id in desk.mission_state.replica.readies
