"""Keys, tokens and attachments: as the documents of rmw_zenoh have them, and as others do."""

from __future__ import annotations

import string

import pytest
from hypothesis import given
from hypothesis import strategies as st
from zenoh_ros2_sdk.attachment import Attachment as SdkAttachment
from zenoh_ros2_sdk.discovery import _parse_liveliness_keyexpr
from zenoh_ros2_sdk.qos import DEFAULT_QOS_PROFILE, QosProfile

from coordinator.ros2.wire import (
    Attachment,
    EntityKind,
    RosEndpoint,
    RosNode,
    is_node_name,
    ros_names,
)
from swarm.model.ids import valid_id

STRING = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"
# The talker of the demonstrations, in the documents of rmw_zenoh.
NODE = RosNode(2, "talker", "aac3178e146ba6f1fc6e6a4085e77f21")


def test_keys_and_tokens_are_those_of_the_documents() -> None:
    chatter = NODE.endpoint(10, EntityKind.PUBLISHER, "/chatter", "std_msgs/msg/String", STRING)

    assert NODE.token == "@ros2_lv/2/aac3178e146ba6f1fc6e6a4085e77f21/0/0/NN/%/%/talker"
    assert chatter.key == f"2/chatter/std_msgs::msg::dds_::String_/{STRING}"
    assert chatter.token.rpartition("/")[0] == (
        "@ros2_lv/2/aac3178e146ba6f1fc6e6a4085e77f21/0/10/MP/%/%/talker/%chatter/"
        f"std_msgs::msg::dds_::String_/{STRING}"
    )


def test_another_implementation_reads_the_token_of_a_service() -> None:
    typ = "peckorder_msgs/srv/AddTask"
    served = NODE.endpoint(3, EntityKind.SERVICE, "/peckorder/add_task", typ, STRING)

    read = _parse_liveliness_keyexpr(served.token)

    assert read is not None
    assert (read["kind"], read["qualified_name"]) == ("SS", "/peckorder/add_task")
    assert read["dds_type"] == "peckorder_msgs::srv::dds_::AddTask_"
    assert (read["type_hash"], read["node_name"]) == (STRING, "talker")
    assert QosProfile.decode(read["qos"]) == DEFAULT_QOS_PROFILE


def test_an_endpoint_is_identified_by_the_hash_of_its_token() -> None:
    one, other = (
        NODE.endpoint(n, EntityKind.PUBLISHER, "/a", "std_msgs/msg/String", STRING) for n in (1, 2)
    )
    # XXH3 of nothing is 99aa06d3014798d8 (high) and 6001c324468d497f (low); rmw_zenoh copies low,
    # then high, as little-endian machines have them.
    nothing = RosEndpoint("", "")

    assert nothing.gid.hex() == "7f498d4624c30160d8984701d306aa99"
    assert len({one.gid, other.gid}) == 2


@given(st.integers(1, 2**62), st.integers(0, 2**62), st.binary(min_size=16, max_size=16))
def test_another_implementation_reads_attachments(sequence: int, stamp_ns: int, gid: bytes) -> None:
    payload = Attachment(sequence, stamp_ns, gid).encode()

    assert len(payload) == 33
    assert SdkAttachment.from_bytes(payload) == SdkAttachment(sequence, stamp_ns, gid)
    assert Attachment.decode(SdkAttachment(sequence, stamp_ns, gid).to_bytes()) == Attachment(
        sequence, stamp_ns, gid
    )


@pytest.mark.parametrize("payload", [b"", b"x" * 32, b"x" * 33, b"x" * 34])
def test_what_is_no_attachment_is_none(payload: bytes) -> None:
    assert Attachment.decode(payload) is None


def test_ids_get_names_that_ros_2_takes_and_that_differ() -> None:
    assert ros_names(["uav1", "uav-2", "uav.2", "3", "a__b", "c-"]) == {
        "uav1": "uav1",
        "uav-2": "uav_2",
        "uav.2": "uav_2_2",
        "3": "id_3",
        "a__b": "a_b",
        "c-": "c",
    }


@given(st.lists(st.text(string.ascii_letters + string.digits + "_.-", min_size=1), unique=True))
def test_every_fleet_gets_good_names(texts: list[str]) -> None:
    ids = [text for text in texts if valid_id(text)]

    names = ros_names(ids)

    assert list(names) == ids
    assert len(set(names.values())) == len(ids)
    assert all(is_node_name(name) for name in names.values())
