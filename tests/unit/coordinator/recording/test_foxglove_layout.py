"""The layout for Foxglove names what recordings hold, in schemas that every viewer can read."""

from __future__ import annotations

import json
import re
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import IO, Any

import pytest
from mcap.reader import make_reader

from coordinator.recording.foxglove_topics import FRAME
from swarm import simulate
from swarm.protocol.uav_messages import StatusPhase
from tests.support.area_missions import paddock
from tests.support.observed_mission import shipped

ROOT = Path(__file__).parents[4]
LAYOUT: dict[str, Any] = json.loads((ROOT / "deploy/foxglove/peckorder.json").read_text())
PANELS: dict[str, dict[str, Any]] = LAYOUT["configById"]
FIX, LOG, SCENE = "foxglove.LocationFix", "foxglove.Log", "foxglove.SceneUpdate"


def panels(kind: str) -> list[dict[str, Any]]:
    return [panel for name, panel in PANELS.items() if name.partition("!")[0] == kind]


def paths(kind: str) -> list[str]:
    return [path["value"] for panel in panels(kind) for path in panel["paths"]]


class Recorded:
    """What two flown missions have left: one with zones, one with an area and a separation."""

    def __init__(self, folder: Path) -> None:
        self.schemas: dict[str, tuple[str, dict[str, Any]]] = {}
        self.messages: defaultdict[str, list[Any]] = defaultdict(list)
        apart = replace(paddock(), separation_m=8.0)
        for mission in (shipped("reservoir-inspection"), apart):
            file = folder / f"{mission.name}.mcap"
            simulate(mission, "greedy", record=file)
            with file.open("rb") as stream:
                self._read(stream)

    def _read(self, stream: IO[bytes]) -> None:
        for schema, channel, message in make_reader(stream).iter_messages():
            assert schema is not None
            assert (schema.encoding, channel.message_encoding) == ("jsonschema", "json")
            self.schemas[channel.topic] = schema.name, json.loads(schema.data)
            self.messages[channel.topic].append(json.loads(message.data))

    def at(self, path: str) -> tuple[dict[str, Any], list[Any]]:
        """Schema and values at a message path: a topic, then fields and places in lists."""
        topic, steps = split(path)
        _, schema = self.schemas[topic]
        values: list[Any] = self.messages[topic]
        for step in steps:
            if isinstance(step, int):
                assert schema["type"] == "array", path
                schema = schema["items"]
                values = [each[step] for each in values if step < len(each)]
            else:
                schema = schema["properties"][step]
                values = [each[step] for each in values if step in each]
        return schema, values


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Recorded:
    return Recorded(tmp_path_factory.mktemp("recorded"))


def split(path: str) -> tuple[str, list[int | str]]:
    topic, dot, rest = path.partition(".")
    steps = re.findall(r"(\w+)|\[(\d+)\]", rest) if dot else []
    assert "".join(f".{name}" if name else f"[{place}]" for name, place in steps) == dot + rest
    return topic, [name or int(place) for name, place in steps]


def leaves(node: str | dict[str, Any]) -> Iterator[str]:
    if isinstance(node, str):
        yield node
        return
    assert node["direction"] in ("row", "column")
    assert 0 < node["splitPercentage"] < 100
    for half in ("first", "second"):
        yield from leaves(node[half])


def read_as_viewers_do(schema: dict[str, Any]) -> None:
    """Refuses what the JSON Schema readers of Foxglove's open viewers refuse.

    They take one plain type a field, lists of one plain type, and enumerations by number; one
    field that is otherwise costs them the whole topic.
    """
    assert schema["type"] == "object"
    for field in schema["properties"].values():
        if "oneOf" in field:
            assert all(isinstance(each["const"], int) for each in field["oneOf"])
            continue
        kind = field["items"] if field["type"] == "array" else field
        assert kind["type"] in ("boolean", "string", "number", "integer", "object")
        if kind["type"] == "object":
            read_as_viewers_do(kind)


def test_each_panel_has_its_place() -> None:
    assert sorted(leaves(LAYOUT["layout"])) == sorted(PANELS)


def test_each_panel_has_its_name_in_both_families_of_viewers() -> None:
    names = [panel["foxglovePanelTitle"] for panel in PANELS.values()]

    assert [panel["lichtblickPanelTitle"] for panel in PANELS.values()] == names
    assert len(set(names)) == len(names)


def test_the_scene_panel_shows_every_scene_of_a_flown_mission_and_nothing_else(
    recorded: Recorded,
) -> None:
    (panel,) = panels("3D")
    told = {topic for topic, (schema, _) in recorded.schemas.items() if schema == SCENE}

    assert {topic for topic, look in panel["topics"].items() if look["visible"]} == told
    assert panel["followTf"] == FRAME
    for topic in told:
        entities = [each for said in recorded.messages[topic] for each in said["entities"]]
        assert {entity["frame_id"] for entity in entities} == {FRAME}


def test_the_map_shows_every_uav(recorded: Recorded) -> None:
    """It shows all topics of its schema but those that it is told to leave out."""
    (panel,) = panels("map")
    fixes = {topic for topic, (schema, _) in recorded.schemas.items() if schema == FIX}

    assert fixes == {f"/uav/uav{number}/fix" for number in (1, 2, 3)}
    assert panel["disabledTopics"] == []


@pytest.mark.parametrize("path", paths("Plot"))
def test_what_is_plotted_is_recorded_as_a_number(recorded: Recorded, path: str) -> None:
    schema, values = recorded.at(path)

    assert schema["type"] == "number"
    assert all(isinstance(value, float | int) for value in values)
    fleet = max(len(said["uavs"]) for said in recorded.messages["/fleet"])
    assert bool(values) == all(step < fleet for step in split(path)[1] if isinstance(step, int))


@pytest.mark.parametrize("path", paths("StateTransitions"))
def test_what_is_drawn_as_a_band_is_recorded_as_a_word(recorded: Recorded, path: str) -> None:
    schema, values = recorded.at(path)

    assert schema["type"] == "string"
    if path in ("/progress.phase", "/fleet.uavs[0].does"):
        assert len(set(values)) > 1
    if "does" in path:
        assert set(values) <= {*StatusPhase, "starting", "lost", "absent"}


def test_the_table_has_a_row_for_each_uav(recorded: Recorded) -> None:
    (panel,) = panels("Table")
    schema, values = recorded.at(panel["topicPath"])

    assert schema["type"] == "array"
    fleet = ["uav1", "uav2", "uav3"]
    *_, last = (table for table in values if [row["id"] for row in table] == fleet)
    assert all(0.0 < row["battery_frac"] < 1.0 and row["done"] > 0 for row in last)


def test_the_story_is_read_as_a_log(recorded: Recorded) -> None:
    (panel,) = panels("RosOut")

    assert recorded.schemas[panel["topicToRender"]][0] == LOG


def test_every_topic_of_the_layout_is_one_that_viewers_can_read(recorded: Recorded) -> None:
    named = {split(path)[0] for path in (*paths("Plot"), *paths("StateTransitions"))}
    drawn = [t for t, (name, _) in recorded.schemas.items() if name.startswith("foxglove.")]

    for topic in (*named, *drawn):
        read_as_viewers_do(recorded.schemas[topic][1])
