"""Hashes and bytes of ROS 2 messages: against published hashes, and others' hashes and bytes."""

from __future__ import annotations

from typing import Any

import pytest
from mcap.records import Schema
from mcap_ros2.decoder import DecoderFactory
from zenoh_ros2_sdk.utils import compute_service_type_hash, get_type_hash

from coordinator.ros2.message_types import MalformedError, MessageTypes, definitions

ADD_TWO_INTS = "example_interfaces/srv/AddTwoInts"
TYPES = MessageTypes({ADD_TWO_INTS: "int64 a\nint64 b\n---\nint64 sum\n"})
# As ROS 2 has them since Iron: in the documents of rmw_zenoh, and by `ros2 topic info -v`.
PUBLISHED = {
    "std_msgs/msg/String": "df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18",
    "service_msgs/msg/ServiceEventInfo": (
        "41bcbbe07a75c9b52bc96bfd5c24d7f0fc0a08c0cb7921b3373c5732345a6f45"
    ),
    ADD_TWO_INTS: "e118de6bf5eeb66a2491b5bda11202e7b68f198d6f67922cf30364858239c81a",
    "nav_msgs/msg/Odometry": "3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0",
}
SAID = (
    *definitions("msg"),
    "diagnostic_msgs/msg/DiagnosticArray",
    "geographic_msgs/msg/GeoPointStamped",
    "nav_msgs/msg/Odometry",
    "nav_msgs/msg/Path",
    "visualization_msgs/msg/MarkerArray",
)


def parts_of(name: str) -> tuple[str, dict[str, str]]:
    """The text of a message, and of all that it refers to."""
    text, *others = TYPES.definition(name).split(f"{'=' * 80}\n")
    found = {}
    for other in others:
        head, _, body = other.partition("\n")
        package, short = head.removeprefix("MSG: ").replace("/msg/", "/").split("/")
        found[f"{package}/msg/{short}"] = body
    return text, found


@pytest.mark.parametrize(("name", "digest"), PUBLISHED.items())
def test_hashes_are_those_that_ros_2_has(name: str, digest: str) -> None:
    assert TYPES.hash_of(name) == f"RIHS01_{digest}"


@pytest.mark.parametrize("name", SAID)
def test_another_implementation_finds_the_same_hash_of_what_is_said(name: str) -> None:
    text, others = parts_of(name)

    assert TYPES.hash_of(name) == get_type_hash(name, text, others)


@pytest.mark.parametrize("name", definitions("srv"))
def test_another_implementation_finds_the_same_hash_of_a_service(name: str) -> None:
    asked, told = definitions("srv")[name].split("\n---\n")
    points = {each: parts_of(each)[0] for each in (POINT, GEO_POINT)}

    assert TYPES.hash_of(name) == compute_service_type_hash(name, asked, told, points)


POINT, GEO_POINT = "geometry_msgs/msg/Point", "geographic_msgs/msg/GeoPoint"


@pytest.mark.parametrize("name", SAID)
def test_another_implementation_reads_the_same_from_the_bytes(name: str) -> None:
    message = filled(name)
    schema = Schema(id=1, name=name, encoding="ros2msg", data=TYPES.definition(name).encode())
    decode = DecoderFactory().decoder_for("cdr", schema)
    assert decode is not None

    payload = TYPES.encode(name, message)

    assert_same(decode(payload), message)
    assert_same(TYPES.decode(name, payload), message)


def filled(name: str) -> dict[str, Any]:
    """A message with something else in each of its fields."""
    return _value((2, name), [0])  # type: ignore[no-any-return]


def _value(desc: Any, count: list[int]) -> Any:
    kind, what = desc
    if kind == 2:
        fields = TYPES._store.fielddefs[what][1]
        return {field: _value(each, count) for field, each in fields}
    if kind == 1:
        count[0] += 1
        if what[0] == "string":
            return "wörter"[: 1 + count[0] % 6]
        if what[0] == "bool":
            return count[0] % 2 == 0
        return count[0] % 100 + (0.5 if what[0].startswith("float") else 0)
    each, length = what
    return [_value(each, count) for _ in range(length if kind == 3 else 2)]


def assert_same(read: Any, message: Any) -> None:
    if isinstance(message, dict):
        for field, value in message.items():
            assert_same(read[field] if isinstance(read, dict) else getattr(read, field), value)
    elif isinstance(message, list):
        assert len(read) == len(message)
        for mine, value in zip(read, message, strict=True):
            assert_same(mine, value)
    else:
        assert read == message


def test_what_is_left_out_is_zero() -> None:
    payload = TYPES.encode("nav_msgs/msg/Odometry", {"child_frame_id": "u0"})

    read = TYPES.decode("nav_msgs/msg/Odometry", payload)

    assert read["child_frame_id"] == "u0"
    assert read["pose"]["covariance"] == [0.0] * 36
    assert read["header"] == {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""}


def test_a_field_that_there_is_not_is_an_error() -> None:
    with pytest.raises(ValueError, match=r"peckorder_msgs/msg/Task has no field colour"):
        TYPES.encode("peckorder_msgs/msg/TaskArray", {"tasks": [{"colour": "red"}]})


@pytest.mark.parametrize(
    "payload", [b"", b"\x00\x01\x00\x00", b"\x00\x01\x00\x00\xff\xff\xff\x7fab", b"\x00\x09" * 8]
)
def test_bytes_that_are_no_message_are_refused(payload: bytes) -> None:
    with pytest.raises(MalformedError):
        TYPES.decode("peckorder_msgs/srv/CommandUav_Request", payload)
