"""Bytes <-> MAVLink 2 messages, on one channel.

Anything malformed is dropped and counted, and with a signing key so is what is not signed with it;
every channel remembers for itself what it has heard. Signatures are pymavlink's own, so that the
bridge's are checked by another implementation.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from pymavlink.dialects.v20 import ardupilotmega as mavlink

_EPOCH_UNIX_S = 1_420_070_400
"""2015-01-01 GMT, from where MAVLink's signatures count."""
_STAMPS_PER_S = 100_000


@dataclass(frozen=True, slots=True)
class ChannelSigning:
    """What a channel signs with, and judges by."""

    secret: bytes = field(repr=False)
    """32 bytes."""
    unix_s: float
    """Wall time when the channel opens; its timestamps count on from there, and from the
    newest heard, as those of an autopilot without a clock."""


class ChannelCodec:
    """One end of a MAVLink conversation, that of a system id and a component id.

    In ``datagrams`` no frame reaches from one piece of input into the next. With ``signing`` the
    conversation is signed.
    """

    def __init__(
        self,
        system_id: int,
        component_id: int,
        *,
        datagrams: bool,
        signing: ChannelSigning | None = None,
    ) -> None:
        self.garbage = 0
        """Pieces of input that were no message: noise, broken frames, unknown ids."""
        self._datagrams = datagrams
        self._mav = mavlink.MAVLink(None, srcSystem=system_id, srcComponent=component_id)
        self._mav.robust_parsing = True
        if signing is not None:
            self._mav.signing.secret_key = signing.secret
            self._mav.signing.timestamp = int((signing.unix_s - _EPOCH_UNIX_S) * _STAMPS_PER_S)
            self._mav.signing.sign_outgoing = True

    def decode(self, data: bytes) -> list[mavlink.MAVLink_message]:
        """Messages completed by ``data``."""
        messages = []
        for message in self._mav.parse_buffer(data) or ():
            if message.get_msgId() < 0 or isinstance(message, mavlink.MAVLink_unknown):
                self.garbage += 1
            else:
                messages.append(message)
        if self._datagrams and self._mav.buf_len() > 0:
            # Half a frame at the end of a datagram would swallow the next datagram.
            self.garbage += 1
            self._forget_rest()
        return messages

    def encode(self, message: mavlink.MAVLink_message, system_id: int | None = None) -> bytes:
        """The frame of ``message``, numbered next, as from ``system_id`` if not from this end."""
        own_id = self._mav.srcSystem
        if system_id is not None:
            self._mav.srcSystem = system_id
        frame: bytes = message.pack(self._mav)
        self._mav.srcSystem = own_id
        self._mav.seq = (self._mav.seq + 1) % 256
        return frame

    def _forget_rest(self) -> None:
        old = self._mav
        self._mav = mavlink.MAVLink(None, srcSystem=old.srcSystem, srcComponent=old.srcComponent)
        self._mav.robust_parsing = True
        self._mav.seq = old.seq
        self._mav.signing = old.signing
