"""Keys, tokens and attachments by which rmw_zenoh finds and reads what is said.

What a ROS 2 graph sees of a node, of what it publishes and of its services is a set of liveliness
tokens; messages and requests go by keys that tell topic, type and type hash, with an attachment.
Source: docs/design.md of rmw_zenoh and its attachments as of 0.2.4 (Jazzy) and 0.6.0 (Kilted).
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum
from typing import Final

import xxhash

GID_BYTES: Final = 16
_TOKENS: Final = "@ros2_lv"
_RELIABLE, _VOLATILE, _KEEP_LAST = 1, 2, 1
_DEPTH: Final = 10
QOS: Final = f"{_RELIABLE}:{_VOLATILE}:{_KEEP_LAST},{_DEPTH}:,:,:,,"
"""Reliable, volatile, the last ten are kept; no deadline, no lifespan, automatic liveliness."""
_HEAD: Final = struct.Struct("<qqB")
_NAME: Final = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")


class EntityKind(StrEnum):
    """What a token stands for."""

    NODE = "NN"
    PUBLISHER = "MP"
    SERVICE = "SS"


@dataclass(frozen=True, slots=True)
class RosNode:
    """A node of the graph, in the empty namespace and enclave."""

    domain_id: int
    name: str
    session: str
    """Id of the Zenoh session that it lives in."""

    @property
    def token(self) -> str:
        """Says that it is there."""
        return f"{self._prefix(0, EntityKind.NODE)}"

    def _prefix(self, number: int, kind: EntityKind) -> str:
        """Of a token of the node's or of what it has: ``number`` tells them apart."""
        place = f"{_TOKENS}/{self.domain_id}/{self.session}"
        return f"{place}/0/{number}/{kind}/%/%/{self.name}"

    def endpoint(
        self, number: int, kind: EntityKind, name: str, typ: str, hashed: str
    ) -> RosEndpoint:
        """What it publishes or serves.

        Args:
            number: from 1; another one for each endpoint.
            kind: publisher or service.
            name: whole, such as ``/chatter``.
            typ: such as ``std_msgs/msg/String``.
            hashed: the type's hash.
        """
        package, folder, short = typ.split("/")
        dds = f"{package}::{folder}::dds_::{short}_"
        mangled = name.replace("/", "%")
        return RosEndpoint(
            key=f"{self.domain_id}/{name.strip('/')}/{dds}/{hashed}",
            token=f"{self._prefix(number, kind)}/{mangled}/{dds}/{hashed}/{QOS}",
        )


@dataclass(frozen=True, slots=True)
class RosEndpoint:
    """A topic that is published, or a service."""

    key: str
    """Of its messages, or of its requests and answers."""
    token: str
    """Says that it is there."""

    @property
    def gid(self) -> bytes:
        """What identifies it in attachments, as rmw_zenoh derives it from the token."""
        return xxhash.xxh3_128(self.token.encode()).intdigest().to_bytes(GID_BYTES, "little")


@dataclass(frozen=True, slots=True)
class Attachment:
    """What goes beside every message, request and answer."""

    sequence: int
    """Counts from 1; of an answer, that of its request."""
    stamp_ns: int
    """Wall time of its source [ns]."""
    gid: bytes
    """Of its publisher or client; of an answer, that of its request."""

    def encode(self) -> bytes:
        """As Zenoh's serializer writes two int64 and an array of 16 bytes."""
        return _HEAD.pack(self.sequence, self.stamp_ns, len(self.gid)) + self.gid

    @classmethod
    def decode(cls, payload: bytes) -> Attachment | None:
        """What it says; None if it is none."""
        if len(payload) != _HEAD.size + GID_BYTES:
            return None
        sequence, stamp_ns, count = _HEAD.unpack_from(payload)
        return cls(sequence, stamp_ns, payload[_HEAD.size :]) if count == GID_BYTES else None


def is_node_name(text: str) -> bool:
    """Whether a node may be called so, and topics may begin with it."""
    return _NAME.fullmatch(text) is not None and "__" not in text


def ros_names(ids: Iterable[str]) -> dict[str, str]:
    """By id, the name under which ROS 2 has it: no two alike.

    Names have letters, digits and single underscores, and begin with no digit. What does not is
    made so; of ids that would be called alike the later ones get a number.
    """
    names: dict[str, str] = {}
    taken: set[str] = set()
    for each in ids:
        plain = re.sub(r"[^A-Za-z0-9]+", "_", each).rstrip("_")
        plain = f"id_{plain}" if plain[0].isdigit() else plain
        name, number = plain, 2
        while name in taken:
            name, number = f"{plain}_{number}", number + 1
        taken.add(name)
        names[each] = name
    return names
