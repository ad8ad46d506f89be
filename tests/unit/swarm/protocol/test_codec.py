"""Bytes <-> messages: what is said comes through, and nothing else does."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import asdict, replace

import msgpack
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarm.model.ids import COORDINATOR, RESERVED
from swarm.protocol.codec import Codec
from swarm.protocol.encoding import LARGE_LIMIT_BYTES, SMALL_LIMIT_BYTES, encode, encode_memory
from swarm.protocol.fields import MAX_COUNT
from swarm.protocol.key_space import KeySpace
from swarm.protocol.messages import SEPARATION_VERSION, Message, MissionPhase, PlanEpoch, Snapshot
from swarm.protocol.uav_messages import MAX_CANDIDATES
from tests.support.builders import MISSION, brief, choice, entry, epoch, message, uav
from tests.support.message_strategies import messages
from tests.support.spoilt_messages import (
    BOARD,
    BRIEF,
    CHOICE,
    CLAIM,
    COMMAND,
    EPOCH,
    EVERY_KIND,
    EVERY_KIND_IDS,
    OUTCOME,
    STATUS,
    Parts,
    drop_reason,
    parts_of,
    reason_with,
    reason_with_field,
)

# -- what is said comes through -------------------------------------------------------


@given(messages())
def test_every_message_comes_back_as_it_was_said(said: Message) -> None:
    codec = Codec(MISSION)

    assert codec.decode(said.key, encode(said)) == said
    assert codec.dropped.total() == 0


@given(st.lists(messages(), max_size=5).map(tuple), st.none() | st.floats(-1e9, 1e9), st.booleans())
def test_every_snapshot_comes_back_as_it_was_said(
    said: tuple[Message, ...], mission_s: float | None, begun: bool
) -> None:
    codec, snapshot = Codec(MISSION), Snapshot(MISSION, "u0", 1, mission_s, said, begun)

    assert codec.decode_snapshot(KeySpace(MISSION).state("u0"), encode(snapshot)) == snapshot
    assert codec.dropped.total() == 0


@given(messages())
def test_encoding_writes_nothing_into_what_it_encodes(said: Message) -> None:
    """The thread that writes the state file encodes what another one may be sealing."""
    encode(Snapshot(MISSION, "u0", 1, None, (said,)))
    encode_memory(Snapshot(MISSION, "u0", 1, None, (said,)))

    assert (encode(said), said.said, said.envelope) == (encode(said), None, None)


def test_whole_numbers_are_taken_for_measures() -> None:
    said = message(COORDINATOR, entry("t0", value=3, service_s=0))

    assert Codec(MISSION).decode(said.key, encode(said)) == said


def test_a_fleet_of_a_thousand_fits_into_brief_epoch_and_choice() -> None:
    names = [f"uav-{n}" for n in range(1000)]
    basis = replace(choice("t0").basis, credible=tuple(names), heads=dict.fromkeys(names, (9, 9)))
    for said in (
        message("uav-0", replace(choice("t0"), basis=basis)),
        message(COORDINATOR, brief(*(uav(name, t0=0.5, t1=0.5) for name in names))),
        message(COORDINATOR, epoch(*names)),
    ):
        assert Codec(MISSION).decode(said.key, encode(said)) == said


# -- nothing else does ----------------------------------------------------------------


@pytest.mark.parametrize("said", EVERY_KIND, ids=EVERY_KIND_IDS)
def test_another_schema_version_is_dropped_under_its_own_reason(said: Message) -> None:
    def newer(parts: Parts) -> None:
        parts[0] = SEPARATION_VERSION + 1

    assert reason_with(said, newer) == "unknown version"


@pytest.mark.parametrize("said", EVERY_KIND, ids=EVERY_KIND_IDS)
def test_another_mission_is_dropped_under_its_own_reason(said: Message) -> None:
    def elsewhere(parts: Parts) -> None:
        parts[1] = "other"

    assert reason_with(said, elsewhere) == "another mission"


@pytest.mark.parametrize("kind", ["order", "", 7, None, ["claim"], {"claim": 1}])
def test_unknown_kinds_are_dropped_under_their_own_reason(kind: object) -> None:
    def unknown(parts: Parts) -> None:
        parts[5] = kind

    assert reason_with(CLAIM, unknown) == "unknown kind"


@pytest.mark.parametrize("writer", ["", "../x", "a/b", "u0\n", "*", "x" * 65, 5, None, b"u0"])
def test_writers_without_a_valid_id_are_malformed(writer: object) -> None:
    def bad(parts: Parts) -> None:
        parts[2] = writer

    assert reason_with(CLAIM, bad) == "malformed"


@pytest.mark.parametrize("place", [3, 4])
@pytest.mark.parametrize("count", [-1, MAX_COUNT + 1, 2**63, 1.0, "1", True, None])
def test_stamps_that_are_no_counts_are_malformed(place: int, count: object) -> None:
    def bad(parts: Parts) -> None:
        parts[place] = count

    assert reason_with(CLAIM, bad) == "malformed"


@pytest.mark.parametrize("number", [math.nan, math.inf, -math.inf, "1", True, None, [1.0]])
@pytest.mark.parametrize(
    ("said", "field"),
    [
        (BRIEF, "horizon_s"),
        (EPOCH, "mission_s"),
        (BOARD, "value"),
        (CLAIM, "decided_s"),
        (CLAIM, "completion_s"),
        (OUTCOME, "completed_s"),
    ],
)
def test_numbers_that_are_none_are_malformed(said: Message, field: str, number: object) -> None:
    assert reason_with_field(said, **{field: number}) == "malformed"


@pytest.mark.parametrize(
    "point", [[0.0, 0.0], [0.0] * 4, [0.0, 0.0, math.nan], ["0", 0.0, 0.0], "000", None, 0.0]
)
def test_points_that_are_none_are_malformed(point: object) -> None:
    assert reason_with_field(BOARD, position_enu_m=point) == "malformed"


@pytest.mark.parametrize("text", ["", "*", "a/b", "a b", "x" * 65, 5, b"t0", None])
@pytest.mark.parametrize("said", [BOARD, OUTCOME], ids=["Board", "Outcome"])
def test_task_ids_that_are_none_are_malformed(said: Message, text: object) -> None:
    assert reason_with_field(said, task=text) == "malformed"


@pytest.mark.parametrize(
    ("said", "field", "value"),
    [
        (BRIEF, "horizon_s", 0.0),
        (BRIEF, "horizon_s", 1e10),
        (BRIEF, "success_default", 1.1),
        (BRIEF, "survival_default", -0.1),
        (BRIEF, "reattempt_failed", 1),
        (BRIEF, "origin", [90.0, 0.0, 0.0]),
        (BRIEF, "uavs", "u0"),
        (EPOCH, "number", -1),
        (EPOCH, "phase", "paused"),
        (EPOCH, "rule", "no such rule"),
        (EPOCH, "sequence", ["u0", 1]),
        (EPOCH, "reason", "x" * 201),
        (BOARD, "value", -1.0),
        (BOARD, "value", 1e13),
        (BOARD, "service_s", -1.0),
        (BOARD, "service_s", 1e10),
        (BOARD, "position_enu_m", [0.0, 1e9, 0.0]),
        (CLAIM, "decided_s", -1e200),
        (CLAIM, "completion_s", 1e200),
        (OUTCOME, "completed_s", 1e16),
        (EPOCH, "mission_s", 1e300),
        (STATUS, "mission_s", 1e200),
        (STATUS, "velocity_enu_m_s", [1e200, 0.0, 0.0]),
        (BOARD, "withdrawn", "no"),
        (CLAIM, "phase", "wanted"),
        (CLAIM, "phase", "idle"),
        (CLAIM, "task", None),
        (OUTCOME, "result", "maybe"),
        (OUTCOME, "attempt", 0),
        (OUTCOME, "attempt", 2**64 - 1),
        (OUTCOME, "attempt", MAX_COUNT + 1),
        (CHOICE, "number", -1),
        (CHOICE, "task", None),
        (CHOICE, "left", ""),
        (CHOICE, "score", 1e31),
        (CHOICE, "second_score", math.nan),
        (CHOICE, "certificate", 1),
        (CHOICE, "candidates", [{"task": "t0", "score": 1.0}] * (MAX_CANDIDATES + 1)),
        (CHOICE, "basis", {}),
        (CHOICE, "basis", {**asdict(choice("t0").basis), "heads": {"u0": [1]}}),
        (CHOICE, "basis", {**asdict(choice("t0").basis), "digest": MAX_COUNT + 1}),
        (CHOICE, "basis", {**asdict(choice("t0").basis), "credible": ["no id"]}),
        (STATUS, "battery_frac", 1.5),
        (STATUS, "note", "x" * 201),
        (STATUS, "dropped", 1),
        (STATUS, "dropped", {"malformed": -1}),
        (STATUS, "dropped", {"": 1}),
        (STATUS, "dropped", {"x" * 41: 1}),
        (STATUS, "dropped", {f"reason {n}": 1 for n in range(21)}),
    ],
)
def test_values_out_of_bounds_are_malformed(said: Message, field: str, value: object) -> None:
    assert reason_with_field(said, **{field: value}) == "malformed"


@pytest.mark.parametrize("said", EVERY_KIND, ids=EVERY_KIND_IDS)
def test_every_field_is_needed(said: Message) -> None:
    for field in parts_of(said)[6]:
        parts = parts_of(said)
        del parts[6][field]
        assert drop_reason(said.key, msgpack.packb(parts)) == "malformed"


@pytest.mark.parametrize(("field", "value"), [("speed_m_s", 1e-300), ("layer_m", 1e200)])
def test_a_brief_with_a_uav_out_of_bounds_is_malformed(field: str, value: float) -> None:
    assert reason_with(BRIEF, lambda p: p[6]["uavs"][0].update({field: value})) == "malformed"


def test_a_brief_that_describes_one_uav_twice_is_malformed() -> None:
    assert reason_with(BRIEF, _name_uavs("u0", "u0")) == "malformed"


@pytest.mark.parametrize("name", RESERVED)
def test_a_brief_that_calls_a_uav_by_a_reserved_name_is_malformed(name: str) -> None:
    """A replica could make no mission of it."""
    assert reason_with(BRIEF, _name_uavs("u0", name)) == "malformed"


def _name_uavs(*names: str) -> Callable[[Parts], object]:
    def rename(parts: Parts) -> None:
        for described, name in zip(parts[6]["uavs"], names, strict=True):
            described["id"] = name

    return rename


@pytest.mark.parametrize("said", EVERY_KIND, ids=EVERY_KIND_IDS)
def test_what_is_said_on_anothers_key_is_dropped(said: Message) -> None:
    keys = KeySpace(MISSION)
    others = [keys.brief, keys.plan, keys.board("t0"), keys.board("t9"), keys.claim("u0")]
    others += [keys.claim("u1"), keys.outcome("u0", "t0"), keys.outcome("u0", "t1")]
    others += [keys.operator("u0"), keys.operator("u1"), keys.operator("fleet")]
    others += [keys.outcome("u1", "t0"), keys.status("u0"), keys.status("u1"), keys.state("u0")]
    for key in set(others) - {said.key}:
        assert drop_reason(key, encode(said)) == "said on another's key"


@pytest.mark.parametrize("said", [BRIEF, EPOCH, BOARD], ids=["Brief", "Epoch", "Board"])
def test_what_only_the_coordinator_may_say_is_dropped_from_a_uav(said: Message) -> None:
    by_uav = replace(said, writer="u0")

    assert drop_reason(said.key, encode(by_uav)) == "said on another's key"


@pytest.mark.parametrize("said", [CLAIM, OUTCOME, STATUS], ids=["Claim", "Outcome", "Status"])
def test_what_only_a_uav_may_say_is_dropped_from_the_coordinator(said: Message) -> None:
    by_coordinator = replace(said, writer=COORDINATOR)

    assert drop_reason(by_coordinator.key, encode(by_coordinator)) == "said on another's key"


@pytest.mark.parametrize("writer", [COORDINATOR, "u0"])
def test_what_only_the_operator_may_say_is_dropped_from_others(writer: str) -> None:
    by_another = replace(COMMAND, writer=writer)

    assert drop_reason(COMMAND.key, encode(by_another)) == "said on another's key"


@pytest.mark.parametrize(
    ("target", "kind"), [("u0", "abort"), ("fleet", "hold"), ("fleet", "return"), ("u0", "land")]
)
def test_commands_that_there_are_not_are_malformed(target: str, kind: str) -> None:
    def change(parts: Parts) -> None:
        parts[6].update(target=target, kind=kind)

    assert reason_with(COMMAND, change) == "malformed"


def test_small_kinds_end_at_the_small_limit() -> None:
    key = BOARD.key
    padding = b"\x00" * SMALL_LIMIT_BYTES

    assert drop_reason(key, encode(BOARD) + padding) == "malformed"
    long_number = reason_with(BOARD, lambda parts: parts[6].update(kind="x" * SMALL_LIMIT_BYTES))
    assert long_number == "malformed"


def test_large_kinds_end_at_the_large_limit() -> None:
    names = [f"{n:064d}" for n in range(LARGE_LIMIT_BYTES // 60)]
    said = message(
        COORDINATOR, PlanEpoch(1, MissionPhase.RUNNING, "greedy", tuple(names), 0.0, "", {})
    )

    assert drop_reason(said.key, encode(said)) == "too large"


def test_deep_nesting_is_malformed() -> None:
    for depth in (100, 1000, 100_000):
        assert drop_reason(CLAIM.key, b"\x91" * depth + b"\xc0") == "malformed"
        nested = encode(CLAIM)[:-1] + b"\x91" * depth + b"\xc0"
        assert drop_reason(CLAIM.key, nested) == "malformed"


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"\xdd\xff\xff\xff\xff",  # an array of four thousand million
        b"\xdf\xff\xff\xff\xff",  # a map of as many
        b"\xdb\xff\xff\xff\xff",  # a string
        b"\xc9\xff\xff\xff\xff\x05",  # an extension
        b"\xd6\xff\x00\x00\x00\x00",  # a timestamp
        b"\xc7\x00\xff",  # a timestamp of no bytes
        b"\xc1",  # never used
        b"\x81\x90\x01",  # a map with an array as key
        b"\xa1\xff",  # a string that is not UTF-8
    ],
)
def test_hostile_messagepack_is_malformed(data: bytes) -> None:
    assert drop_reason(CLAIM.key, data) == "malformed"
