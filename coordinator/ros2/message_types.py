"""Types of ROS 2 messages and services: their fields, hashes and bytes.

Standard types come with rosbags; those of geographic_msgs and our own (`definitions/`) are added.
Elsewhere a message is a mapping of its fields, nested as it is, with zeros left out. Nothing here
knows of topics or of the network.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib.resources import files
from typing import Any, Final

import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.interfaces.typing import Fielddefs, FieldDesc, Typesdict
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

PACKAGE: Final = "peckorder_msgs"
Fields = Mapping[str, Any]
"""Of a message or a request, by name; nested messages likewise, numbers 0 where left out."""

# rosbags knows no geographic_msgs, and takes ``char`` for another type than rosidl, which makes
# uint8 of it: its own ServiceEventInfo, part of every service's hash, has a wrong one.
_ADDED: Final = {
    "geographic_msgs/msg/GeoPoint": "float64 latitude\nfloat64 longitude\nfloat64 altitude\n",
    "geographic_msgs/msg/GeoPointStamped": "std_msgs/Header header\nGeoPoint position\n",
}
_EVENT_INFO: Final = "service_msgs/msg/ServiceEventInfo"
_EVENT_INFO_TEXT: Final = (
    "uint8 REQUEST_SENT=0\nuint8 REQUEST_RECEIVED=1\nuint8 RESPONSE_SENT=2\n"
    "uint8 RESPONSE_RECEIVED=3\nuint8 event_type\nbuiltin_interfaces/Time stamp\n"
    "uint8[16] client_gid\nint64 sequence_number\n"
)
_SEPARATOR: Final = "\n---\n"


class MalformedError(ValueError):
    """Bytes that are no message of the type they ought to be."""


class MessageTypes:
    """All types that are spoken here.

    Args:
        services: further ones by type, such as ``example_interfaces/srv/AddTwoInts``: the text of
            their definition.
    """

    def __init__(self, services: Mapping[str, str] | None = None) -> None:
        self._store = get_typestore(Stores.ROS2_JAZZY)
        self._store.fielddefs.pop(_EVENT_INFO)
        self._store.types.pop(_EVENT_INFO)
        self._add(_ADDED | {_EVENT_INFO: _EVENT_INFO_TEXT})
        self._add(definitions("msg"))
        for name, text in (definitions("srv") | dict(services or {})).items():
            self._add_service(name, text)

    def hash_of(self, name: str) -> str:
        """The type hash of a message or service, RIHS01 of REP-2016."""
        return self._store.hash_rihs01(name)

    def encode(self, name: str, message: Fields) -> bytes:
        """CDR, little endian, with its header of four bytes.

        Raises:
            ValueError: the type has no such field.
        """
        made = self._made(name, message)
        return bytes(self._store.serialize_cdr(made, name, little_endian=True))

    def decode(self, name: str, payload: bytes) -> dict[str, Any]:
        """The fields of a message, all of them.

        Raises:
            MalformedError: these bytes are none.
        """
        try:
            return self._read(name, self._store.deserialize_cdr(payload, name))
        except SerdeError as fault:
            raise MalformedError(str(fault)) from None

    def definition(self, name: str) -> str:
        """The text of a message's definition, with those that it refers to, as in recordings."""
        return self._store.generate_msgdef(name, ros_version=2)[0]

    # -- types --------------------------------------------------------------------------

    def _add(self, texts: Mapping[str, str]) -> None:
        types: Typesdict = {}
        for name, text in texts.items():
            (parsed,) = get_types_from_msg(text, name).values()
            types[name] = parsed  # rosbags puts those of services elsewhere
        self._store.register(types)

    def _add_service(self, name: str, text: str) -> None:
        """Add request and response, and what hashes need: the event, and the service itself."""
        request, response = f"{name}_Request", f"{name}_Response"
        asked, _, told = text.partition(_SEPARATOR)
        self._add({request: asked, response: told})

        def nested(of: str) -> FieldDesc:
            return Nodetype.NAME, of

        def one_of(of: str) -> FieldDesc:
            return Nodetype.SEQUENCE, ((Nodetype.NAME, of), 1)

        event: Fielddefs = [
            ("info", nested(_EVENT_INFO)),
            ("request", one_of(request)),
            ("response", one_of(response)),
        ]
        whole: Fielddefs = [
            ("request_message", nested(request)),
            ("response_message", nested(response)),
            ("event_message", nested(f"{name}_Event")),
        ]
        self._store.register({f"{name}_Event": ([], event), name: ([], whole)})

    # -- values -------------------------------------------------------------------------

    def _made(self, name: str, message: Fields) -> object:
        fields = self._store.fielddefs[name][1]
        if unknown := message.keys() - {field for field, _ in fields}:
            raise ValueError(f"{name} has no field {', '.join(sorted(unknown))}")
        values = [self._value(desc, message.get(field)) for field, desc in fields]
        return self._store.types[name](*values)

    def _value(self, desc: FieldDesc, value: Any) -> Any:
        match desc:
            case (Nodetype.NAME, str() as nested):
                return self._made(nested, value or {})
            case (Nodetype.BASE, (kind, _)):
                return _ZEROS.get(kind, 0) if value is None else value
            case (shape, ((Nodetype.BASE, (kind, _)), count)) if kind != "string":
                zeros = [0] * count if shape == Nodetype.ARRAY else []
                return np.array(zeros if value is None else value, dtype=_dtype(kind))
            case (_, (each, _)):
                items: Sequence[Any] = value or ()
                return [self._value(each, item) for item in items]

    def _read(self, name: str, made: object) -> dict[str, Any]:
        fields = self._store.fielddefs[name][1]
        return {field: self._plain(desc, getattr(made, field)) for field, desc in fields}

    def _plain(self, desc: FieldDesc, value: Any) -> Any:
        match desc:
            case (Nodetype.NAME, str() as nested):
                return self._read(nested, value)
            case (Nodetype.BASE, _):
                return value
            case (_, (each, _)):
                return [self._plain(each, item) for item in value]


_ZEROS: Final = {"string": "", "bool": False, "float32": 0.0, "float64": 0.0}


def _dtype(kind: str) -> np.dtype[Any]:
    return np.dtype({"byte": "uint8", "char": "uint8"}.get(kind, kind))


def definitions(kind: str) -> dict[str, str]:
    """Our own definitions of a kind, ``msg`` or ``srv``: their texts by type."""
    folder = files("coordinator.ros2").joinpath("definitions", kind)
    suffix = f".{kind}"
    return {
        f"{PACKAGE}/{kind}/{each.name.removesuffix(suffix)}": each.read_text(encoding="utf-8")
        for each in sorted(folder.iterdir(), key=lambda each: each.name)
        if each.name.endswith(suffix)
    }
