"""Bytes <-> MAVLink 2 messages, on one channel.

Anything malformed is dropped and counted. Leaves out: signing; sockets.
"""

from __future__ import annotations

from pymavlink.dialects.v20 import ardupilotmega as mavlink

__all__ = ["ChannelCodec"]


class ChannelCodec:
    """One end of a MAVLink conversation.

    Args:
        system_id: whom our messages come from.
        component_id: whom our messages come from.
        datagrams: frames never reach from one piece of input into the next.
    """

    def __init__(self, system_id: int, component_id: int, *, datagrams: bool) -> None:
        self.garbage = 0
        """Pieces of input that were no message: noise, broken frames, unknown ids."""
        self._datagrams = datagrams
        self._mav = mavlink.MAVLink(None, srcSystem=system_id, srcComponent=component_id)
        self._mav.robust_parsing = True

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
        """The frame of ``message``, with this channel's next sequence number.

        Args:
            message: what is said.
            system_id: whom it is said to come from, where that is not this end.
        """
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
