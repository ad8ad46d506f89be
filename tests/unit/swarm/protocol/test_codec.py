"""Bytes <-> messages: what is said comes through, and nothing else does."""

from __future__ import annotations

import math
import tracemalloc
from collections.abc import Callable
from dataclasses import asdict, replace
from typing import Any

import msgpack
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from swarm.bus.port import MAX_PAYLOAD_BYTES
from swarm.model.ids import COORDINATOR, OPERATOR, RESERVED
from swarm.protocol.codec import Codec
from swarm.protocol.encoding import (
    LARGE_LIMIT_BYTES,
    SMALL_LIMIT_BYTES,
    SNAPSHOT_LIMIT_BYTES,
    encode,
    encode_memory,
    fit,
)
from swarm.protocol.fields import MAX_COUNT
from swarm.protocol.key_space import KeySpace
from swarm.protocol.messages import (
    CommandKind,
    Message,
    MissionPhase,
    OperatorCommand,
    PlanEpoch,
    Snapshot,
)
from swarm.protocol.uav_messages import MAX_CANDIDATES
from tests.support.builders import (
    MISSION,
    brief,
    choice,
    done,
    entry,
    epoch,
    held,
    message,
    status,
    uav,
)
from tests.support.message_strategies import messages

BRIEF = message(COORDINATOR, brief(uav("u0"), uav("u1", t0=0.5)))
EPOCH = message(COORDINATOR, epoch("u1", "u0"))
BOARD = message(COORDINATOR, entry("t0"))
CLAIM = message("u0", held("t0", 1.0))
OUTCOME = message("u0", done("t0"))
STATUS = message("u0", status())
COMMAND = message(OPERATOR, OperatorCommand("u0", CommandKind.HOLD, 1, ""))
CHOICE = message("u0", choice("t0", left="t1"))
EVERY_KIND = [BRIEF, EPOCH, BOARD, CLAIM, OUTCOME, STATUS, COMMAND, CHOICE]
EVERY_KIND_IDS = [type(said.body).__name__ for said in EVERY_KIND]

Parts = list[Any]


def drop_reason(key: str, data: bytes) -> str:
    """Why ``data`` was dropped; fails when it was not, or was counted otherwise than once."""
    codec = Codec(MISSION)
    assert codec.decode(key, data) is None
    assert codec.dropped.total() == 1
    return next(iter(codec.dropped))


def parts_of(said: Message) -> Parts:
    parts: Parts = msgpack.unpackb(encode(said))
    return parts


def reason_with(said: Message, change: Callable[[Parts], object]) -> str:
    """Why ``said`` is dropped once ``change`` has been at its parts."""
    parts = parts_of(said)
    change(parts)
    return drop_reason(said.key, msgpack.packb(parts))


def reason_with_field(said: Message, **fields: object) -> str:
    return reason_with(said, lambda parts: parts[6].update(fields))


# -- what is said comes through -------------------------------------------------------


@given(messages())
def test_every_message_comes_back_as_it_was_said(said: Message) -> None:
    codec = Codec(MISSION)

    assert codec.decode(said.key, encode(said)) == said
    assert codec.dropped.total() == 0


@given(st.lists(messages(), max_size=5).map(tuple), st.none() | st.floats(-1e9, 1e9))
def test_every_snapshot_comes_back_as_it_was_said(
    said: tuple[Message, ...], mission_s: float | None
) -> None:
    codec, snapshot = Codec(MISSION), Snapshot(MISSION, "u0", 1, mission_s, said)

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


@given(st.sampled_from(EVERY_KIND), st.binary(max_size=200))
def test_random_bytes_are_dropped_and_counted(said: Message, data: bytes) -> None:
    assert drop_reason(said.key, data)


@given(st.sampled_from(EVERY_KIND), st.data())
def test_truncated_bytes_are_dropped_as_malformed(said: Message, data: st.DataObject) -> None:
    whole = encode(said)
    length = data.draw(st.integers(0, len(whole) - 1))

    assert drop_reason(said.key, whole[:length]) == "malformed"


@given(st.sampled_from(EVERY_KIND), st.binary(min_size=1, max_size=9))
def test_bytes_after_the_end_are_dropped_as_malformed(said: Message, tail: bytes) -> None:
    assert drop_reason(said.key, encode(said) + tail) == "malformed"


@settings(max_examples=500)
@given(st.sampled_from(EVERY_KIND), st.data())
def test_flipped_bits_never_raise_and_never_change_who_speaks(
    said: Message, data: st.DataObject
) -> None:
    flipped = bytearray(encode(said))
    for _ in range(data.draw(st.integers(1, 3))):
        flipped[data.draw(st.integers(0, len(flipped) - 1))] ^= 1 << data.draw(st.integers(0, 7))
    codec = Codec(MISSION)

    heard = codec.decode(said.key, bytes(flipped))

    assert (heard is None) == (codec.dropped.total() == 1)
    if heard is not None:
        assert (heard.mission, heard.key) == (MISSION, said.key)


plain = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(2**63), 2**64 - 1)
    | st.floats()
    | st.text(max_size=5)
    | st.binary(max_size=5)
    | st.just(msgpack.ExtType(5, b"")),
    lambda inner: (
        st.lists(inner, max_size=8)
        | st.dictionaries(st.text(max_size=5) | st.binary(max_size=3), inner, max_size=4)
    ),
    max_leaves=20,
)


@settings(max_examples=300)
@given(st.sampled_from(EVERY_KIND), st.integers(0, 6), plain)
def test_anything_in_the_place_of_a_part_never_raises(
    said: Message, place: int, instead: object
) -> None:
    parts = parts_of(said)
    parts[place] = instead
    codec = Codec(MISSION)

    heard = codec.decode(said.key, msgpack.packb(parts))

    assert (heard is None) == (codec.dropped.total() == 1)


@settings(max_examples=300)
@given(st.sampled_from(EVERY_KIND), plain, st.data())
def test_anything_in_the_place_of_a_field_never_raises(
    said: Message, instead: object, data: st.DataObject
) -> None:
    parts = parts_of(said)
    parts[6][data.draw(st.sampled_from(sorted(parts[6])))] = instead
    codec = Codec(MISSION)

    heard = codec.decode(said.key, msgpack.packb(parts))

    assert (heard is None) == (codec.dropped.total() == 1)


@given(plain)
def test_anything_that_is_messagepack_never_raises(thing: object) -> None:
    assert drop_reason(CLAIM.key, msgpack.packb(thing))


@pytest.mark.parametrize("said", EVERY_KIND, ids=EVERY_KIND_IDS)
def test_another_schema_version_is_dropped_under_its_own_reason(said: Message) -> None:
    def newer(parts: Parts) -> None:
        parts[0] = 2

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


# -- snapshots ------------------------------------------------------------------------

STATE_KEY = KeySpace(MISSION).state("u0")


def snapshot_parts(*said: Message) -> Parts:
    parts: Parts = msgpack.unpackb(encode(Snapshot(MISSION, "u0", 1, 1.0, said)))
    return parts


def snapshot_drop_reason(data: bytes, key: str = STATE_KEY) -> str:
    codec = Codec(MISSION)
    assert codec.decode_snapshot(key, data) is None
    assert codec.dropped.total() == 1
    return next(iter(codec.dropped))


@given(st.binary(max_size=200) | plain.map(msgpack.packb))
def test_what_is_no_snapshot_never_raises(data: bytes) -> None:
    assert snapshot_drop_reason(data)


@given(st.data())
def test_truncated_snapshots_are_malformed(data: st.DataObject) -> None:
    whole = encode(Snapshot(MISSION, "u0", 1, 1.0, (CLAIM, OUTCOME)))
    length = data.draw(st.integers(0, len(whole) - 1))

    assert snapshot_drop_reason(whole[:length]) == "malformed"


def test_the_largest_fleets_with_the_shortest_names_come_through_whole() -> None:
    """Though their messages have many small parts for their size."""
    names = [f"u{number}" for number in range(1000)]
    order = replace(epoch(*names), routes=dict.fromkeys(names, ()))
    said = [message(COORDINATOR, order), message(COORDINATOR, brief(*(uav(n) for n in names)))]
    said += [message(name, held("t", 0.0)) for name in names]
    said += [message(name, done(f"t{task}")) for name in names for task in range(5)]
    snapshot = Snapshot(MISSION, "u0", 1, 1.0, tuple(said))

    assert Codec(MISSION).decode_snapshot(STATE_KEY, encode(snapshot)) == snapshot


@pytest.mark.parametrize("part", [b"\x80", b"\x81\x00\x00", b"\x91\x00"])
def test_few_bytes_cannot_fill_the_memory(part: bytes) -> None:
    head = encode(Snapshot(MISSION, "u0", 1, 1.0, ()))
    assert head.endswith(b"\x90")
    count = (SNAPSHOT_LIMIT_BYTES - 100) // len(part)
    hostile = head[:-1] + b"\xdd" + count.to_bytes(4, "big") + part * count
    codec = Codec(MISSION)

    tracemalloc.start()
    try:
        assert codec.decode_snapshot(STATE_KEY, hostile) is None
        _, peak_bytes = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()

    assert codec.dropped == {"malformed": 1}
    assert peak_bytes < 40 * SNAPSHOT_LIMIT_BYTES


@settings(max_examples=300)
@given(st.data())
def test_snapshots_with_flipped_bits_never_raise(data: st.DataObject) -> None:
    flipped = bytearray(encode(Snapshot(MISSION, "u0", 1, 1.0, (CLAIM, OUTCOME, BRIEF))))
    flipped[data.draw(st.integers(0, len(flipped) - 1))] ^= 1 << data.draw(st.integers(0, 7))

    Codec(MISSION).decode_snapshot(STATE_KEY, bytes(flipped))


@pytest.mark.parametrize(
    ("place", "instead", "reason"),
    [
        (0, 2, "unknown version"),
        (1, "other", "another mission"),
        (2, "u1", "said on another's key"),
        (2, "a/b", "malformed"),
        (2, 5, "malformed"),
        (3, -1, "malformed"),
        (3, MAX_COUNT + 1, "malformed"),
        (3, True, "malformed"),
        (3, 1.0, "malformed"),
        (4, math.nan, "malformed"),
        (4, math.inf, "malformed"),
        (4, 1e200, "malformed"),
        (4, "1", "malformed"),
        (4, True, "malformed"),
        (5, "claims", "malformed"),
        (5, None, "malformed"),
        (5, {}, "malformed"),
    ],
)
def test_snapshots_with_a_wrong_part_are_dropped(place: int, instead: object, reason: str) -> None:
    parts = snapshot_parts(CLAIM)
    parts[place] = instead

    assert snapshot_drop_reason(msgpack.packb(parts)) == reason


def test_a_snapshot_answered_on_anothers_key_is_dropped() -> None:
    data = encode(Snapshot(MISSION, "u0", 1, 1.0, ()))

    assert snapshot_drop_reason(data, KeySpace(MISSION).state("u1")) == "said on another's key"
    assert snapshot_drop_reason(data, "state/u0") == "said on another's key"


def test_a_snapshot_may_be_as_large_as_the_bus_carries_and_no_larger() -> None:
    assert SNAPSHOT_LIMIT_BYTES <= MAX_PAYLOAD_BYTES
    data = encode(Snapshot(MISSION, "u0", 1, 1.0, (BRIEF,) * (SNAPSHOT_LIMIT_BYTES // 200)))
    assert len(data) > SNAPSHOT_LIMIT_BYTES

    assert snapshot_drop_reason(data) == "too large"


def test_a_snapshot_that_fits_is_answered_whole() -> None:
    snapshot = Snapshot(MISSION, "u0", 1, 1.0, (BRIEF, CLAIM))

    assert fit(snapshot) is snapshot
    assert fit(snapshot, len(encode(snapshot))) is snapshot


@given(st.lists(messages(), max_size=8).map(tuple), st.integers(100, 1500))
def test_of_a_snapshot_too_large_there_stays_what_fits_the_own_first(
    said: tuple[Message, ...], limit_bytes: int
) -> None:
    snapshot = Snapshot(MISSION, "u0", 1, 1.0, said)
    fitted = fit(snapshot, limit_bytes)

    assert len(encode(fitted)) <= limit_bytes
    assert all(m in said for m in fitted.messages)
    left_out = [m for m in said if m not in fitted.messages]
    for message_out in left_out:
        if message_out.writer == "u0":  # no stranger's register took its room
            own = sum(len(encode(m)) for m in fitted.messages if m.writer == "u0")
            assert own + len(encode(message_out)) > limit_bytes - 60


def test_bad_registers_in_a_snapshot_are_left_out_and_the_others_kept() -> None:
    parts = snapshot_parts(CLAIM, OUTCOME, BOARD)
    parts[5][0][0] = 2
    parts[5][1][6]["completed_s"] = math.nan
    parts[5] += ["nonsense", None, [], parts[5][2][:5]]
    codec = Codec(MISSION)

    heard = codec.decode_snapshot(STATE_KEY, msgpack.packb(parts))

    assert heard == Snapshot(MISSION, "u0", 1, 1.0, (BOARD,))
    assert codec.dropped == {"unknown version": 1, "malformed": 5}


def test_a_snapshot_may_hold_registers_of_others_but_not_swap_the_roles() -> None:
    theirs, forged = replace(CLAIM, writer="u1"), replace(BOARD, writer="u0")
    codec = Codec(MISSION)

    heard = codec.decode_snapshot(
        STATE_KEY, encode(Snapshot(MISSION, "u0", 1, 1.0, (theirs, forged)))
    )

    assert heard is not None
    assert heard.messages == (theirs,)
    assert codec.dropped == {"said on another's key": 1}
