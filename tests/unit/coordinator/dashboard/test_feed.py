"""What a page is told: whole at first, then what has changed, however slowly it reads."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st

from coordinator.dashboard.feed import Feed, PageSettings
from swarm.model import Area, AreaId
from swarm.model.ids import COORDINATOR
from swarm.protocol.events import MessageReceived
from swarm.protocol.field_messages import AreaSpec
from swarm.protocol.messages import Message, MissionPhase, Stamp
from swarm.protocol.uav_messages import (
    AttemptResult,
    Candidate,
    Choice,
    ChoiceBasis,
    Status,
    StatusPhase,
)
from tests.support.builders import MISSION, OUT, brief, epoch, uav
from tests.support.desk_play import DeskPlay, FakePlayer

KEYS = {"uavs": "id", "tasks": "id", "lists": "uav", "zones": "id", "commands": "n"}
LOGS = ("story", "choices", "objective_curve")


class Page:
    """What a page makes of the frames it is sent."""

    def __init__(self, feed: Feed) -> None:
        self.feed = feed
        self.seen: int | None = None
        self.picture: dict[str, Any] = {}

    def read(self) -> dict[str, Any]:
        frame = json.loads(self.feed.frame(self.seen))
        rows = {name: {row[key]: row for row in frame.pop(name)} for name, key in KEYS.items()}
        logs = {name: frame.pop(name) for name in LOGS}
        whole = frame.pop("whole")
        before = {name: {} if whole else self.picture[name] for name in KEYS}
        told = {name: [] if whole else self.picture[name] for name in LOGS}
        self.picture = frame
        for name in KEYS:
            changed = {key: before[name].get(key, {}) | row for key, row in rows[name].items()}
            self.picture[name] = before[name] | changed
        self.picture |= {name: told[name] + logs[name] for name in LOGS}
        self.seen = self.feed.seq
        return {"whole": whole, **self.picture}


def feed_of(play: DeskPlay) -> Feed:
    return Feed(play, PageSettings())


def without_silence(picture: dict[str, Any]) -> dict[str, Any]:
    for row in picture["uavs"].values():
        row["silent_s"] = None
    picture.pop("whole")
    return picture


def test_before_a_mission_is_known_the_frame_says_so() -> None:
    feed = feed_of(DeskPlay())
    feed.look()

    picture = Page(feed).read()

    assert feed.mission is None
    assert (picture["phase"], picture["uavs"], picture["tasks"]) == (None, {}, {})


def test_a_whole_frame_tells_everything() -> None:
    play = DeskPlay()
    play.begin()
    play.claim("u1", "t1")
    play.status("u1", StatusPhase.FLYING, east_m=3.0)
    play.time_s = 4.0
    play.end("u2", "t2")
    play.dropped = {"malformed": 1}
    feed = feed_of(play)
    feed.look()

    picture = Page(feed).read()

    assert picture["whole"]
    assert (picture["phase"], picture["epoch"], picture["rule"]) == ("running", 1, "greedy")
    assert (picture["coordinator"], picture["aborted"], picture["mission_s"]) == (True, False, 4.0)
    assert picture["counts"] == {
        "open": 1,
        "taken": 1,
        "left_out": 0,
        "done": 1,
        "failed": 0,
        "withdrawn": 0,
    }
    u1 = picture["uavs"]["u1"]
    assert (u1["does"], u1["task"], u1["claim"], u1["completion_s"]) == (
        "flying",
        "t1",
        "held",
        10.0,
    )
    assert (u1["position"], u1["battery"], u1["present"]) == ([3.0, 0.0, 0.0], 0.5, True)
    assert (u1["silent_s"], u1["dropped"]) == (4.0, {"stale": 2})
    t2 = picture["tasks"]["t2"]
    assert (t2["state"], t2["uav"], t2["completed_s"], t2["by"]) == ("done", "u2", 4.0, "scenario")
    assert picture["tasks"]["t1"]["taken"]
    assert picture["lists"]["u2"] == {"uav": "u2", "planned": [], "flown": ["t2"]}
    assert picture["lists"]["u1"]["planned"] == ["t1", "t2", "t3"]
    assert picture["objective"] == 996.0
    assert picture["objective_curve"] == [[4.0, 996.0]]
    assert (picture["dropped"], picture["dropped_here"]) == ({"stale": 2}, {"malformed": 1})
    assert picture["story"][-1]["text"] == "u2 ended t2: done"
    mission = json.loads(feed.mission or "")
    assert [uav["id"] for uav in mission["uavs"]] == ["u1", "u2"]


def test_a_task_that_the_plan_leaves_out_is_told_with_the_reason_until_somebody_takes_it() -> None:
    play = DeskPlay()
    play.begin()
    feed = feed_of(play)
    play.say(COORDINATOR, epoch("u1", "u2", number=2, left_out={"energy": ("t3",)}))
    feed.look()

    page = Page(feed)
    picture = page.read()
    row = picture["tasks"]["t3"]
    assert (row["state"], row["taken"], row["left_out"]) == ("open", False, "energy")
    assert row["why"] == "nobody has the energy for it beside the rest"
    assert (picture["counts"]["open"], picture["counts"]["left_out"]) == (2, 1)

    play.claim("u1", "t3")
    feed.look()
    picture = page.read()
    row = picture["tasks"]["t3"]
    assert (row["taken"], row["left_out"], row["why"]) == (True, None, None)
    assert (picture["counts"]["taken"], picture["counts"]["left_out"]) == (1, 0)


def test_areas_come_with_the_mission_as_outlines() -> None:
    ring, hole = ((0.0, 0.0), (9.0, 0.0), (9.0, 9.0)), ((4.0, 1.0), (8.0, 1.0), (8.0, 5.0))
    area = Area(AreaId("field"), ring, 1.0, (hole,), spacing_m=2.0, lines=5)
    play = DeskPlay()
    play.begin()
    play.say(COORDINATOR, replace(brief(uav("u1"), uav("u2")), areas=(AreaSpec.of(area),)))
    feed = feed_of(play)
    feed.look()

    told = json.loads(feed.mission or "")["areas"]

    assert told == [{"id": "field", "rings": [list(map(list, each)) for each in (ring, hole)]}]


def test_what_has_not_changed_is_not_told_again() -> None:
    play = DeskPlay()
    play.begin()
    feed = feed_of(play)
    feed.look()
    since = feed.seq
    play.status("u1", east_m=1.0)
    feed.look()

    frame = json.loads(feed.frame(since))

    assert not frame["whole"]
    assert [row["id"] for row in frame["uavs"]] == ["u1"]
    assert (frame["tasks"], frame["lists"], frame["story"]) == ([], [], [])


def test_a_growing_silence_is_told_now_and_then() -> None:
    play = DeskPlay()
    play.begin()
    play.status("u1")
    feed, told = feed_of(play), []
    for _ in range(12):
        feed.look()
        play.time_s += 0.5
        frame = json.loads(feed.frame(feed.seq - 1))
        told += [row["silent_s"] for row in frame["uavs"] if row["id"] == "u1"]

    assert told == [0.0, 2.5, 5.0]


def test_of_a_row_only_what_has_changed_is_told() -> None:
    play = DeskPlay()
    play.begin()
    play.status("u1", StatusPhase.FLYING, east_m=3.0)
    feed = feed_of(play)
    feed.look()
    before = feed.seq
    play.status("u1", StatusPhase.FLYING, east_m=4.0)
    feed.look()
    between = feed.seq
    play.claim("u1", "t1")
    feed.look()

    (since_claim,) = json.loads(feed.frame(between))["uavs"]
    (since_before,) = json.loads(feed.frame(before))["uavs"]

    claimed = {"does": "flying", "task": "t1", "claim": "held", "completion_s": 10.0}
    assert since_claim == {"id": "u1"} | claimed
    assert since_before == since_claim | {"position": [4.0, 0.0, 0.0]}


def test_who_would_come_too_near_is_told() -> None:
    play = DeskPlay()
    play.begin()
    apart = replace(brief(uav("u1"), uav("u2")), separation_m=10.0)
    play.say(COORDINATOR, apart)
    for who, east_m, speed_m_s in (("u1", 0.0, 1.0), ("u2", 15.0, -1.0)):
        place, velocity = (east_m, 0.0, 30.0), (speed_m_s, 0.0, 0.0)
        play.say(who, Status(StatusPhase.FLYING, None, place, velocity, None, 0.0, {}, ""))
    feed = feed_of(play)
    feed.look()

    (conflict,) = json.loads(feed.frame(None))["conflicts"]

    assert feed.mission is not None
    assert json.loads(feed.mission)["separation_m"] == 10.0
    assert json.loads(feed.mission)["layers_m"] == [10.0, 22.0]
    assert conflict["uavs"] == ["u1", "u2"]
    assert conflict["distance_m"] < 10.0


def test_clients_in_step_share_one_text() -> None:
    play = DeskPlay()
    play.begin()
    feed = feed_of(play)
    feed.look()
    feed.look()

    assert feed.frame(1) is feed.frame(1)
    assert feed.frame(None) is feed.frame(None)


def test_the_plan_is_worth_what_its_first_lists_are() -> None:
    play = DeskPlay()
    play.begin(["t1", "t2", "t3"])  # 0, 10 and 20 m from a UAV with 1 m/s
    feed = feed_of(play)
    feed.look()
    play.post("popup", 7)
    play.epoch(MissionPhase.RUNNING, {"u1": ("popup",)}, number=2)
    feed.look()

    plan = json.loads(feed.frame(None))["plan"]

    assert plan == {"objective": 1000.0 + 990.0 + 980.0, "bound": None}
    assert feed.measure is not None
    assert feed.measure.work_out(lambda _: False) >= plan["objective"]


def test_who_comes_late_knows_no_plan() -> None:
    play = DeskPlay()
    play.begin()
    play.epoch(MissionPhase.RUNNING, {"u1": ("t1",)}, number=2)
    feed = feed_of(play)
    feed.look()

    assert json.loads(feed.frame(None))["plan"] == {"objective": None, "bound": None}


def test_a_mission_flown_anew_is_told_whole() -> None:
    play = DeskPlay()
    play.begin()
    play.end("u1", "t1")
    feed = feed_of(play)
    feed.look()
    page = Page(feed)
    page.read()
    seq = feed.mission_seq
    play.begin(["t8"], run=2)
    feed.look()

    picture = page.read()

    assert feed.mission_seq > seq
    assert picture["whole"]
    assert list(picture["tasks"]) == ["t8"]
    assert (picture["counts"]["done"], picture["objective_curve"]) == (0, [])


def test_news_of_what_was_done_early_mends_the_curve() -> None:
    play = DeskPlay()
    play.begin()
    feed, page = feed_of(play), None
    play.time_s = 20.0
    play.end("u1", "t1")
    feed.look()
    page = Page(feed)
    page.read()
    play.time_s = 10.0
    play.end("u2", "t2")
    feed.look()

    assert page.read()["objective_curve"] == [[10.0, 990.0], [20.0, 1970.0]]


def test_a_uav_that_left_in_order_is_still_home_and_a_lost_one_lost() -> None:
    play = DeskPlay()
    play.begin()
    play.claim("u1", "t1")
    play.claim("u2", "t2")
    play.lose("u1")
    play.status("u2", StatusPhase.HOME)
    play.say("u2", OUT)
    play.lose("u2")
    feed = feed_of(play)
    feed.look()

    uavs = Page(feed).read()["uavs"]

    assert (uavs["u1"]["does"], uavs["u1"]["lost"], uavs["u1"]["task"]) == ("lost", True, None)
    assert (uavs["u2"]["does"], uavs["u2"]["lost"], uavs["u2"]["present"]) == ("home", False, False)


def test_a_choice_is_told_with_its_candidates() -> None:
    play = DeskPlay()
    play.begin()
    basis = ChoiceBasis(0.0, (0.0, 0.0, 0.0), 1.0, (), (), (), {}, 7)
    candidates = (Candidate("t1", 9.0), Candidate("t2", 8.0))
    choice = Choice(4, "t1", None, 1.0, 1, "greedy", 0, 9.0, 8.0, True, 2.0, candidates, basis)
    message = Message(MISSION, "u1", Stamp(3, 9), choice)
    play.take(MessageReceived(message))
    play.take(MessageReceived(message))
    feed = feed_of(play)
    feed.look()
    feed.look()

    (row,) = Page(feed).read()["choices"]

    assert (row["n"], row["id"], row["task"], row["certificate"]) == (1, "u1-4", "t1", True)
    assert row["candidates"] == [{"task": "t1", "score": 9.0}, {"task": "t2", "score": 8.0}]
    assert (row["base"], row["why"]) == (None, None)


def test_a_choice_of_a_base_is_told_with_its_reason() -> None:
    play = DeskPlay()
    play.begin()
    basis = ChoiceBasis(0.0, (0.0, 0.0, 0.0), 1.0, (), (), (), {}, 7)
    choice = Choice(4, None, None, 1.0, 1, "guided", 0, 9.0, None, False, 2.0, (), basis, "b0")
    play.take(MessageReceived(Message(MISSION, "u1", Stamp(3, 9), choice)))
    feed = feed_of(play)
    feed.look()

    (row,) = Page(feed).read()["choices"]

    assert (row["task"], row["base"], row["candidates"]) == (None, "b0", [])
    assert row["why"] == "the best list that it found begins with a full battery"


def test_a_recording_says_how_far_it_is() -> None:
    play = DeskPlay()
    play.player = FakePlayer()
    feed = feed_of(play)
    feed.look()

    hello, frame = json.loads(feed.hello()), json.loads(feed.frame(None))

    assert (hello["kind"], hello["commands"], hello["duration_s"]) == ("replay", False, 60.0)
    assert frame["recording"] == {"t_s": 0.0, "playing": True, "speed": 1.0}


who = st.sampled_from(["u1", "u2", "u3"])
which = st.sampled_from(["t1", "t2", "t3", "t4"])
happenings = st.one_of(
    st.tuples(st.just("claim"), who, which),
    st.tuples(st.just("end"), who, which, st.sampled_from(AttemptResult)),
    st.tuples(st.just("status"), who, st.sampled_from(StatusPhase), st.integers(0, 3)),
    st.tuples(st.just("post"), which, st.integers(0, 3)),
    st.tuples(st.just("lose"), who | st.just(COORDINATOR)),
    st.tuples(st.just("wait"), st.floats(0.1, 3.0)),
    st.tuples(st.just("begin"), st.just(("t1", "t2")), st.integers(2, 4)),
    st.tuples(st.just("epoch"), st.sampled_from(MissionPhase)),
    st.tuples(st.just("look"), st.booleans(), st.booleans()),
)


@settings(max_examples=150, deadline=None)
@given(st.lists(happenings, max_size=40))
def test_changes_add_up_to_the_whole_for_whoever_reads_however_slowly(
    happened: list[tuple[Any, ...]],
) -> None:
    play = DeskPlay(("u1", "u2", "u3"))
    play.begin()
    feed = feed_of(play)
    feed.look()
    pages = [Page(feed), Page(feed)]
    for name, *arguments in [*happened, ("look", True, True)]:
        if name != "look":
            getattr(play, name)(*arguments)
            continue
        feed.look()
        for page, reads in zip(pages, arguments, strict=True):
            if reads:
                told = without_silence(page.read())
                assert told == without_silence(Page(feed).read())
