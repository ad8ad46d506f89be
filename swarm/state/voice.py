"""One process's own statements, stamped in order."""

from __future__ import annotations

from swarm.wire.messages import Body, Message, Stamp

__all__ = ["Voice"]


class Voice:
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
        """``body`` as this writer's newest statement."""
        self._stamp = Stamp(self._stamp.incarnation, self._stamp.counter + 1)
        return Message(self.mission, self.writer, self._stamp, body)

    def outdo(self, heard: Stamp) -> None:
        """Speak above ``heard``, which others remember of an earlier life of this writer."""
        if heard > self._stamp:
            self._stamp = Stamp(heard.incarnation + 1, 0)
