"""Facts as JSON of published schemas, and back to the very same."""

from __future__ import annotations

import json
from functools import cache
from typing import Any, get_args

import jsonschema
import pytest
from hypothesis import given
from hypothesis import strategies as st

from coordinator.core.publication import mission_config_of
from coordinator.planner.plan import make_plan
from coordinator.recording.records import (
    SCHEMAS,
    RecordingStarted,
    UnreadableError,
    body_name,
    decode,
    encode,
    schema_of,
)
from swarm.model.ids import COORDINATOR, OPERATOR
from swarm.model.layers import FlightLayers
from swarm.protocol.events import (
    CommonEvent,
    KeysReplaced,
    LinkChanged,
    MessageReceived,
    PeerGone,
    PeerSeen,
    SnapshotsReceived,
    Stop,
    Tick,
)
from swarm.protocol.messages import Body, Message, Snapshot, TaskEdit
from swarm.runtime.clock import SystemClock
from swarm.scenario import load_scenario, shipped_scenarios
from tests.support.builders import MISSION, done, held, message
from tests.support.message_strategies import (
    counts,
    ids,
    messages,
    not_negatives,
    notes,
    numbers,
    points,
    stamps,
    task_ids,
    uav_ids,
)

orders = st.builds(
    TaskEdit,
    task=task_ids,
    number=counts,
    position_enu_m=points,
    value=not_negatives,
    service_s=not_negatives,
    kind=st.none() | ids,
    withdrawn=st.booleans(),
    run=counts,
    reason=notes,
)
everything = st.one_of(
    messages(),
    st.builds(Message, st.just(MISSION), st.just(OPERATOR), stamps, orders),
)
snapshots = st.builds(
    Snapshot,
    st.just(MISSION),
    uav_ids,
    counts,
    st.none() | numbers,
    st.lists(everything, max_size=3).map(tuple),
)
facts: st.SearchStrategy[CommonEvent | RecordingStarted] = st.one_of(
    everything.map(MessageReceived),
    st.lists(snapshots, max_size=2).map(tuple).map(SnapshotsReceived),
    uav_ids.map(PeerSeen),
    uav_ids.map(PeerGone),
    st.frozensets(uav_ids, max_size=3).map(KeysReplaced),
    st.booleans().map(LinkChanged),
    st.just(Tick()),
    st.just(RecordingStarted()),
)


@cache
def validator(schema: str) -> Any:
    shape = json.loads(schema_of(schema))
    jsonschema.Draft202012Validator.check_schema(shape)
    return jsonschema.Draft202012Validator(shape)


@pytest.mark.parametrize("kind", get_args(Body))
def test_every_kind_of_message_has_a_schema(kind: type[Body]) -> None:
    assert f"peckorder.{body_name(object.__new__(kind))}" in SCHEMAS


@given(facts, st.floats(0.0, 1e9), st.none() | numbers)
def test_every_fact_comes_back_as_it_was_and_fits_its_schema(
    fact: CommonEvent | RecordingStarted, now_s: float, mission_s: float | None
) -> None:
    line = encode(fact, MISSION, now_s, mission_s)

    assert line is not None
    assert decode(line.schema, line.data) == (now_s, fact)
    validator(line.schema).validate(json.loads(line.data))


@pytest.mark.parametrize("scenario", sorted(shipped_scenarios()))
def test_plans_of_all_kinds_of_missions_come_back_too(scenario: str) -> None:
    mission = load_scenario(shipped_scenarios()[scenario])
    plan = make_plan(mission, "greedy", clock=SystemClock())

    line = encode(plan, MISSION, 0.0, None)

    assert line is not None
    assert decode(line.schema, line.data) == (0.0, plan)
    validator(line.schema).validate(json.loads(line.data))


@pytest.mark.parametrize("scenario", sorted(shipped_scenarios()))
def test_briefs_of_all_kinds_of_missions_come_back_too(scenario: str) -> None:
    mission = load_scenario(shipped_scenarios()[scenario])
    brief = mission_config_of(mission, FlightLayers(), run=1)
    fact = MessageReceived(message(str(COORDINATOR), brief))

    line = encode(fact, MISSION, 0.0, None)

    assert line is not None
    assert decode(line.schema, line.data) == (0.0, fact)
    validator(line.schema).validate(json.loads(line.data))


def test_all_schemas_are_objects_with_their_names() -> None:
    for name in SCHEMAS:
        shape = json.loads(schema_of(name))
        assert (shape["type"], shape["title"]) == ("object", name)


def test_topics_are_bus_keys_without_the_task() -> None:
    said = encode(MessageReceived(message("u1", held("t1", 0.0))), MISSION, 0.0, None)
    ended = encode(MessageReceived(message("u1", done("t1"))), MISSION, 0.0, None)

    assert said is not None
    assert ended is not None
    assert said.topic == "/swarm/test/uav/u1/claim"
    assert ended.topic == "/swarm/test/uav/u1/outcome"


def test_what_only_the_own_process_was_told_is_not_written() -> None:
    assert encode(Stop("enough"), MISSION, 0.0, None) is None


@pytest.mark.parametrize(
    "data",
    [b"", b"{}", b"[]", b"nonsense", b'{"now_s":1e999,"up":true}', b'{"now_s":1.0,"up":"no"}'],
)
def test_what_does_not_fit_is_refused(data: bytes) -> None:
    with pytest.raises(UnreadableError):
        decode("peckorder.Link", data)
