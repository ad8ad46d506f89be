"""Bytes <-> messages: MessagePack, checked field by field.

`decode` never raises on what came from the network: whatever is not a valid
message of this mission, on the key that belongs to its writer, is None and
counted under a reason. With a `Seal`, what its writer has not signed is dropped
before anything of it is parsed; see swarm.protocol.seal.

**Releases that differ.** Everything may grow at its end: a message or snapshot by parts,
a body by fields. An older release passes over what it does not know, and repeats it when it
repeats the message; a newer one puts the field's wire default in the place of what an older
one left out. A kind of message that a release does not know is dropped and counted. Only what
cannot be mixed so (a field that goes or changes its meaning, a new word in an enumeration)
makes `SCHEMA_VERSION` grow, and then neither release hears the other.

**What must not be passed over.** A statement that tells of what the field asks for, such as a
UAV's acceleration, says `FIELD_VERSION`: a release that does not heed it drops and counts that
statement alone, and so knows no mission, instead of flying it by other times of legs.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from typing import Final

import msgpack
from pydantic import TypeAdapter, ValidationError

from swarm.model.ids import AUTHORITY, COORDINATOR, OPERATOR, valid_id
from swarm.protocol.encoding import (
    FIELDS,
    KINDS,
    LARGE,
    LARGE_LIMIT_BYTES,
    NAMES,
    PLAIN_FIELDS,
    SMALL_LIMIT_BYTES,
    SNAPSHOT_LIMIT_BYTES,
    encode,
    fit,
    repacked,
    snapshot_bytes,
    unpacked,
)
from swarm.protocol.field_messages import UavReady, ZoneEdit
from swarm.protocol.fields import LATEST_S, MAX_COUNT
from swarm.protocol.key_space import KeySpace
from swarm.protocol.messages import (
    FIELD_VERSION,
    SCHEMA_VERSION,
    SEPARATION_VERSION,
    TERRAIN_VERSION,
    Body,
    Message,
    MissionConfig,
    OperatorCommand,
    PlanEpoch,
    SignedRoster,
    Snapshot,
    Stamp,
    StartWithout,
    TaskEdit,
    TaskEntry,
    as_heard,
    demoted,
)
from swarm.protocol.seal import (
    ANSWER,
    ENVELOPE_BYTES,
    NOT_SIGNED,
    NOT_THE_SIGNERS,
    WRONGLY_SIGNED,
    Seal,
    UnacceptableError,
    is_envelope,
    open_envelope,
)
from swarm.protocol.shared_messages import SharedMessages
from swarm.protocol.uav_messages import Calibration, Choice, Claim, Nearby, Outcome, Status

IN_SEALED_ANSWER: Final = 64
"""Arrays and maps of an answer in which all registers but the roster are envelopes."""
SIGNED_HERE: Final = "signed, but no keys here"
UNKNOWN_VERSION: Final = "unknown version"
_VERSIONS: Final = (SCHEMA_VERSION, FIELD_VERSION, TERRAIN_VERSION, SEPARATION_VERSION)

WIRE_DEFAULTS: Final[Mapping[str, Mapping[str, object]]] = {}
"""By kind, what a field means that an older release does not say; of fields that were added
to the end of a body under the `SCHEMA_VERSION` in force."""


_PLAIN: Final[Mapping[str, frozenset[str]]] = {
    kind: frozenset(PLAIN_FIELDS[body]) for kind, body in KINDS.items()
}
"""By kind, the fields that every statement of it has."""


@cache
def _bodies(kind: str) -> TypeAdapter[Body]:
    return TypeAdapter(KINDS[kind])


@cache
def _stamps() -> TypeAdapter[Stamp]:
    return TypeAdapter(Stamp)


class Codec:
    """Reads and writes what one mission's processes say, and counts what it drops.

    With a seal it believes only what is signed, and signs what is written. ``shared`` is what other
    codecs of the same mission in this process have read.
    """

    def __init__(
        self, mission: str, seal: Seal | None = None, shared: SharedMessages | None = None
    ) -> None:
        self._mission = mission
        self._shared = None if seal is not None else shared
        self._keys = KeySpace(mission)
        self._seal = seal
        self.dropped: Counter[str] = Counter()
        """Messages dropped so far, by reason."""
        self.newer: set[str] = set()
        """Kinds of messages that were heard with more in them than this release understands."""

    # -- for the bus ----------------------------------------------------------------

    def pack(self, message: Message) -> bytes | None:
        """``message`` as the bus carries it; None when nobody would believe it from here."""
        said = encode(message)
        seal = self._seal
        if seal is None or isinstance(message.body, SignedRoster):
            return said
        if (known := message.envelope) is not None and seal.is_genuine(known):
            return known
        if not seal.may_speak_for(seal.name, message.writer):
            return None
        envelope = seal.wrap(said)
        as_heard(message, said, envelope)
        return envelope

    def pack_answer(self, snapshot: Snapshot, bond: bytes) -> tuple[bytes, int]:
        """``snapshot`` as an answer to the question with that bond.

        Returns:
            Its bytes, and how many registers had no room in them.
        """
        seal = self._seal
        if seal is None:
            fitted = fit(snapshot)
            return encode(fitted), len(snapshot.messages) - len(fitted.messages)
        told = [message for message in snapshot.messages if self.pack(message) is not None]
        believed = replace(snapshot, messages=tuple(told))
        fitted = fit(believed, SNAPSHOT_LIMIT_BYTES - ENVELOPE_BYTES, self._register)
        said = snapshot_bytes(fitted, [self._register(message) for message in fitted.messages])
        return seal.wrap(said, ANSWER + bond), len(told) - len(fitted.messages)

    def _register(self, message: Message) -> bytes:
        """As it stands in an answer."""
        packed = self.pack(message) or b""
        if self._seal is None or isinstance(message.body, SignedRoster):
            return packed
        wrapped: bytes = msgpack.packb(packed)
        return wrapped

    # -- from the bus ---------------------------------------------------------------

    def decode(self, key: str, data: bytes, known: Message | None = None) -> Message | None:
        """The message in ``data``, heard on ``key``; None when it must be dropped.

        A claim may be heard on the key of its register or on one for somebody alone.

        It is ``known`` itself, of that key and believed before, where that is only repeated: most
        of what a large fleet says.
        """
        if known is not None and data == (known.said if self._seal is None else known.envelope):
            return known
        key = self._keys.register_of(key)
        heard = None if self._shared is None else self._shared.find(data)
        if heard is not None and heard.key == key:
            return heard
        try:
            sealed = is_envelope(data)
            limit_bytes = LARGE_LIMIT_BYTES + (ENVELOPE_BYTES if sealed else 0)
            _require(len(data) <= limit_bytes, "too large")
            message = self._believed(data) if sealed else self._unsigned(key, data)
            _require(message.key == key, "said on another's key")
        except UnacceptableError as fault:
            self.dropped[fault.reason] += 1
            return None
        return message

    def decode_snapshot(self, key: str, data: bytes, bond: bytes = b"") -> Snapshot | None:
        """The snapshot in ``data``, answered on ``key`` to the question of that ``bond``; bad
        registers in it are left out.
        """
        opened = self.open_answer(key, data, bond)
        if opened is None:
            return None
        snapshot, registers = opened
        read = [self.decode_register(register) for register in registers]
        return replace(snapshot, messages=tuple(said for said in read if said is not None))

    def open_answer(
        self, key: str, data: bytes, bond: bytes = b""
    ) -> tuple[Snapshot, tuple[object, ...]] | None:
        """As `decode_snapshot`, the registers apart and each yet for `decode_register`."""
        signer = None
        try:
            _require(len(data) <= SNAPSHOT_LIMIT_BYTES, "too large")
            if self._seal is not None:
                envelope = self._seal.unwrap(data, ANSWER + bond)
                signer, data = envelope.signer, envelope.said
            else:
                _require(not is_envelope(data), SIGNED_HERE)
            most = None if signer is None else IN_SEALED_ANSWER
            snapshot, registers = self._snapshot(key, data, most)
            _require(signer is None or self._may_speak(signer, snapshot.writer), NOT_THE_SIGNERS)
        except UnacceptableError as fault:
            self.dropped[fault.reason] += 1
            return None
        return snapshot, registers

    def decode_register(self, register: object) -> Message | None:
        """The message in one register of an answer; None when it must be left out."""
        try:
            return self._answered(register)
        except UnacceptableError as fault:
            self.dropped[fault.reason] += 1
            return None

    def by_present_keys(self, snapshot: Snapshot) -> Snapshot:
        """``snapshot``, believed by an older roster: what is no longer signed well `demoted`."""
        messages = (
            demoted(message)
            if message.envelope is not None and not self._is_genuine(message.envelope)
            else message
            for message in snapshot.messages
        )
        return replace(snapshot, messages=tuple(messages))

    def _is_genuine(self, envelope: bytes) -> bool:
        return self._seal is None or self._seal.is_genuine(envelope)

    def _may_speak(self, signer: str, writer: str) -> bool:
        return self._seal is not None and self._seal.may_speak_for(signer, writer)

    def _believed(self, envelope: bytes) -> Message:
        """The message in an envelope, if its signer may say so."""
        if self._seal is None:
            raise UnacceptableError(SIGNED_HERE)
        opened = self._seal.unwrap(envelope)
        message = self._read(opened.said)
        _require(not isinstance(message.body, SignedRoster), NOT_THE_SIGNERS)
        _require(self._seal.may_speak_for(opened.signer, message.writer), NOT_THE_SIGNERS)
        return as_heard(message, opened.said, envelope)

    def _unsigned(self, key: str, data: bytes) -> Message:
        """A message without an envelope; where the bus has keys, a roster."""
        if self._seal is None:
            return self._read(data)
        _require(key == self._keys.roster, NOT_SIGNED)
        return self._roster(self._read(data))

    def _roster(self, message: Message) -> Message:
        """``message``, if it is a roster of the authority's, stamped by its version."""
        if self._seal is None or not isinstance(message.body, SignedRoster):
            raise UnacceptableError(NOT_SIGNED)
        roster = self._seal.read_roster(message.body.signed)
        _require(message.stamp == Stamp(roster.version, 0), WRONGLY_SIGNED)
        return message

    def _answered(self, register: object) -> Message:
        """One register of an answer."""
        if isinstance(register, bytes):
            return self._believed(register)
        said = repacked(register)
        message = self._read_once(said, lambda: register)
        return message if self._seal is None else self._roster(message)

    def _read(self, said: bytes) -> Message:
        return self._read_once(said, lambda: unpacked(said))

    def _read_once(self, said: bytes, parts: Callable[[], object]) -> Message:
        """The message whose bytes are ``said``, with those ``parts``."""
        shared = self._shared
        if shared is not None and (known := shared.find(said)) is not None:
            return known
        message = as_heard(self._message(parts()), said)
        _require_size(message)
        if shared is not None:
            shared.keep(said, message)
        return message

    # -- from the own memory --------------------------------------------------------

    def decode_memory(self, key: str, data: bytes) -> Snapshot | None:
        """What `encode_memory` made in an earlier life.

        Where the bus has keys, what bears no good signature by now is remembered as `demoted`.
        A roster is left out: the keys' folder has the one that counts, and this may be that of
        an authority before it.
        """
        try:
            snapshot, registers = self._snapshot(key, data)
        except UnacceptableError as fault:
            self.dropped[fault.reason] += 1
            return None
        messages = []
        for register in registers:
            try:
                messages.append(self._recalled(register))
            except UnacceptableError as fault:
                self.dropped[fault.reason] += 1
        kept = (said for said in messages if not isinstance(said.body, SignedRoster))
        return replace(snapshot, messages=tuple(kept))

    def _recalled(self, register: object) -> Message:
        seal = self._seal
        if not isinstance(register, bytes):
            said = as_heard(self._message(register), repacked(register))
            own = seal is None or seal.may_speak_for(seal.name, said.writer)
            return said if own else demoted(said)
        envelope = open_envelope(register)
        if envelope is None:
            raise UnacceptableError("malformed")
        message = as_heard(self._message(unpacked(envelope.said)), envelope.said, register)
        return message if self._is_genuine(register) else demoted(message)

    # -- parts ----------------------------------------------------------------------

    def _snapshot(
        self, key: str, data: bytes, most: int | None = None
    ) -> tuple[Snapshot, tuple[object, ...]]:
        """A snapshot without its registers, and those; ``most`` as in `unpacked`."""
        parts = unpacked(data, most)
        if not isinstance(parts, tuple) or len(parts) < 6:
            raise UnacceptableError("malformed")
        version, mission, writer, incarnation, mission_s, registers = parts[:6]
        _require(version == SCHEMA_VERSION, UNKNOWN_VERSION)
        self._require_ours(mission, writer)
        _require(key == self._keys.state(writer), "said on another's key")
        _require(type(incarnation) is int and 0 <= incarnation <= MAX_COUNT, "malformed")
        known = isinstance(mission_s, float) and abs(mission_s) <= LATEST_S
        _require(known or mission_s is None, "malformed")
        _require(isinstance(registers, tuple), "malformed")
        begun = len(parts) > 6 and parts[6] is True
        return Snapshot(mission, writer, incarnation, mission_s, (), begun), registers

    def _message(self, parts: object) -> Message:
        if not isinstance(parts, tuple) or len(parts) < 7:
            raise UnacceptableError("malformed")
        version, mission, writer, incarnation, counter, kind, fields = parts[:7]
        if version not in _VERSIONS:
            raise UnacceptableError(UNKNOWN_VERSION)
        self._require_ours(mission, writer)
        if not isinstance(kind, str) or kind not in KINDS:
            raise UnacceptableError("unknown kind")
        if not isinstance(fields, dict):
            raise UnacceptableError("malformed")
        if fields.keys() != _PLAIN[kind] or len(parts) > 7:
            fields = self._understood(kind, fields)
        try:
            stamp = _stamps().validate_python({"incarnation": incarnation, "counter": counter})
            body = _bodies(kind).validate_python(fields)
        except (ValidationError, RecursionError):
            raise UnacceptableError("malformed") from None
        _require(_may_say(writer, body), "said on another's key")
        return Message(mission, writer, stamp, body)

    def _require_ours(self, mission: object, writer: object) -> None:
        _require(mission == self._mission, "another mission")
        _require(isinstance(writer, str) and valid_id(writer), "malformed")

    def _understood(self, kind: str, fields: Mapping[str, object]) -> dict[str, object]:
        """The fields of a body that another release has written, as this one has them.

        A Python default is for those who write messages: on the wire every field is needed
        but those in `WIRE_DEFAULTS` and, where they are as by default, in `SINCE_FIELD`.
        """
        told = {**WIRE_DEFAULTS.get(kind, {}), **fields}
        _require(told.keys() >= _PLAIN[kind], "malformed")
        known = FIELDS[KINDS[kind]]
        if not fields.keys() <= set(known):
            self.newer.add(kind)
        return {name: told[name] for name in known if name in told}


def _may_say(writer: str, body: Body) -> bool:
    """Whether statements of that kind are this writer's to make."""
    match body:
        case MissionConfig() | PlanEpoch() | TaskEntry():
            return writer == COORDINATOR
        case OperatorCommand() | TaskEdit() | StartWithout() | ZoneEdit() | UavReady():
            return writer == OPERATOR
        case SignedRoster():
            return writer == AUTHORITY
        case Claim() | Outcome() | Calibration() | Status() | Choice() | Nearby():
            return writer not in (AUTHORITY, COORDINATOR, OPERATOR)


def _require(condition: bool, reason: str) -> None:
    if not condition:
        raise UnacceptableError(reason)


def _require_size(message: Message) -> None:
    """What is in the envelope counts, so that keys leave the room for words as it is."""
    large = NAMES[type(message.body)] in LARGE
    limit_bytes = LARGE_LIMIT_BYTES if large else SMALL_LIMIT_BYTES
    _require(len(encode(message)) <= limit_bytes, "too large")
