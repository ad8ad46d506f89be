"""What Foxglove is shown of a mission of the field: zones, bases, sorties, what is left out."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import pytest

from coordinator.recording.foxglove_topics import FoxgloveTopics
from swarm.model import Area, AreaId, Mission, Task, TaskId, Zone, ZoneId
from swarm.model.ids import COORDINATOR, OPERATOR
from swarm.protocol.field_messages import ZoneEdit, ZoneSpec
from swarm.protocol.uav_messages import BaseStage, Claim, ClaimPhase, StatusPhase
from tests.support import field_registers
from tests.support.builders import entries_of, epoch
from tests.support.observed_mission import Teller
from tests.unit.coordinator.terminal.test_field_picture import pasture

Scene = dict[str, dict[str, Any]]


class Viewer:
    """What a viewer has of each scene, who has seen all messages."""

    def __init__(self) -> None:
        self.scenes: dict[str, Scene] = {}
        self.progress: dict[str, Any] = {}
        self._topics = FoxgloveTopics()

    def look(self, teller: Teller) -> list[str]:
        """Take in what is new; gives its topics."""
        topics = []
        for said in self._topics.draw(teller.mission_state, 1.0, 10**9):
            told = json.loads(said.data)
            topics.append(said.topic)
            if said.topic.startswith("/scene/"):
                scene = self.scenes.setdefault(said.topic.removeprefix("/scene/"), {})
                scene |= {entity["id"]: entity for entity in told["entities"]}
            elif said.topic == "/progress":
                self.progress = told
        return topics


def facts(entity: dict[str, Any]) -> dict[str, str]:
    return {pair["key"]: pair["value"] for pair in entity["metadata"]}


@pytest.fixture
def teller() -> Teller:
    flown: Mission = pasture()
    told = Teller(flown)
    told.say(COORDINATOR, field_registers.brief_of(flown))
    for entry in entries_of(flown):
        told.say(COORDINATOR, entry)
    told.begin()
    for uav in flown.uavs:
        told.status(uav.id, StatusPhase.FLYING, 0.5)
    return told


def test_zones_are_drawn_and_one_that_is_taken_away_is_not_drawn_any_more(teller: Teller) -> None:
    viewer, brief = Viewer(), teller.mission_state.replica.brief
    assert brief is not None
    viewer.look(teller)
    (pond,) = viewer.scenes["zones"].values()
    assert [(p["x"], p["y"]) for p in pond["lines"][0]["points"]][:2] == [(40, 20), (60, 20)]
    assert "/scene/zones" not in viewer.look(teller), "nothing has changed"

    crowd = Zone(ZoneId("crowd"), ((70.0, 0.0), (90.0, 0.0), (80.0, 30.0)), ceiling_m=50.0)
    teller.say(OPERATOR, ZoneEdit(ZoneSpec.of(crowd), False, brief.run, ""))
    teller.say(OPERATOR, ZoneEdit(brief.zones[0], True, brief.run, ""))
    viewer.look(teller)

    assert viewer.scenes["zones"]["zone pond"]["lines"] == []
    assert len(viewer.scenes["zones"]["zone crowd"]["lines"]) == 2
    assert facts(viewer.scenes["zones"]["zone crowd"]) == {"ceiling": "50 m"}


def test_areas_are_drawn_with_their_holes_and_lines_by_how_they_stand() -> None:
    hole = ((50.0, 10.0), (70.0, 10.0), (70.0, 20.0))
    hay = Area(AreaId("hay"), ((0.0, 0.0), (90.0, 0.0), (90.0, 60.0)), 5.0, (hole,), 20.0, lines=1)
    path = ((10.0, 5.0, 0.0), (80.0, 5.0, 0.0))
    line = Task(TaskId("hay-1"), path[0], 5.0, path_enu_m=path)
    flown = replace(pasture(), tasks=(line,), areas=(hay,))
    told, viewer = Teller(flown), Viewer()
    told.say(COORDINATOR, field_registers.brief_of(flown))
    told.begin()
    told.say(COORDINATOR, replace(entries_of(flown)[0], path_enu_m=path))
    viewer.look(told)

    (drawn,) = viewer.scenes["areas"].values()
    assert [len(ring["points"]) for ring in drawn["lines"]] == [4, 4]
    assert facts(drawn) == {"lines": "1", "value": "5"}
    (way,) = viewer.scenes["tasks"]["open"]["lines"]
    assert [(point["x"], point["y"]) for point in way["points"]] == [(10, 5), (80, 5)]
    assert viewer.scenes["tasks"]["done"]["lines"] == []
    assert "/scene/areas" not in viewer.look(told), "nothing has changed"


def test_a_base_tells_who_is_there_and_a_uav_its_sortie(teller: Teller) -> None:
    viewer = Viewer()
    viewer.look(teller)
    assert facts(viewer.scenes["bases"]["base barn"]) == {"swap": "30 s", "uavs": "", "slots": "1"}

    visit = Claim(
        *(ClaimPhase.HELD, None, 5.0, 0, 40.0),
        base="barn",
        stage=BaseStage.WAITING,
        sortie_end_s=61.0,
    )
    teller.say("u0", visit)
    viewer.look(teller)

    assert facts(viewer.scenes["bases"]["base barn"])["uavs"] == "u0 waiting"
    u0 = facts(viewer.scenes["uavs"]["u0"])
    assert (u0["base"], u0["visit"]) == ("barn", "waiting")
    assert u0["sortie left"].endswith(" s")


def test_what_the_plan_leaves_out_is_told_with_the_reason(teller: Teller) -> None:
    viewer = Viewer()
    viewer.look(teller)
    assert facts(viewer.scenes["tasks"]["left out"]) == {}

    teller.say(COORDINATOR, epoch("u0", "u1", number=2, left_out={"energy": ("t1",)}))
    viewer.look(teller)

    assert facts(viewer.scenes["tasks"]["left out"]) == {"t1": "energy"}
    assert viewer.progress["left_out"] == 1
