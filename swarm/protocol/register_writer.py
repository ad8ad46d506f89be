"""One process's own statements, stamped in order."""

from __future__ import annotations

from swarm.protocol.encoding import encode
from swarm.protocol.fields import MAX_COUNT
from swarm.protocol.messages import Body, Message, Stamp, as_heard
from swarm.protocol.uav_messages import News


class RegisterWriter:
    """Stamps what one writer says, so that replicas can tell news from old."""

    def __init__(self, mission: str, writer: str, incarnation: int) -> None:
        self.mission = mission
        self.writer = writer
        self._stamp = Stamp(incarnation, 0)

    @property
    def incarnation(self) -> int:
        """Of this life of the writer."""
        return self._stamp.incarnation

    def say(self, body: Body) -> Message:
        """``body`` as this writer's newest statement; a register with its bytes.

        Those are wanted again and again: repeated, in answers, in digests, on the disk.
        """
        incarnation, counter = self._stamp.incarnation, self._stamp.counter
        if counter < MAX_COUNT:
            self._stamp = Stamp(incarnation, counter + 1)
        elif incarnation < MAX_COUNT:
            self._stamp = Stamp(incarnation + 1, 1)
        message = Message(self.mission, self.writer, self._stamp, body)
        return message if isinstance(body, News) else as_heard(message, encode(message))

    def observe(self, heard: Stamp) -> bool:
        """Speak above ``heard``, which others remember of an earlier life of this writer.

        The incarnation keeps its last three digits, so that two processes under one name
        which outdo the same stamp do not come out alike. The largest stamps there are cannot be
        outdone, or only to say nothing new ever after; it takes a forger, against whom access
        control helps, and other keys do away with them (`Replica.demote_revoked`).

        Returns:
            Whether what is said next will be above it.
        """
        if heard > self._stamp:
            own, least = self._stamp.incarnation, heard.incarnation + 1
            above = least + (own - least) % 1000
            if above <= MAX_COUNT:
                self._stamp = Stamp(above, 0)
            elif heard.counter <= MAX_COUNT // 2:
                self._stamp = heard
            else:
                return False
        return True
