"""What several agents of one process hear, read once for all of them.

Each hears the same statements, and reading one (fields, ranges, who may say so) takes longer than
to take it in. A statement that was read well is found again by its bytes. Only for a bus without
keys, since a process with keys is that of one UAV; for one thread.
"""

from __future__ import annotations

from typing import Final

from swarm.protocol.messages import Message
from swarm.protocol.uav_messages import News

_GENERATION: Final = 4096
"""Statements after which those go that nobody has heard again meanwhile."""


class SharedMessages:
    """Statements of one mission by their bytes: the newest, and what is still repeated."""

    def __init__(self) -> None:
        self._young: dict[bytes, Message] = {}
        self._old: dict[bytes, Message] = {}

    def find(self, said: bytes) -> Message | None:
        """What these bytes say, if it was kept."""
        message = self._young.get(said)
        if message is None and (message := self._old.get(said)) is not None:
            self.keep(said, message)
        return message

    def keep(self, said: bytes, message: Message) -> None:
        """These bytes say that; news, of which each is heard by few and never repeated, is not."""
        if isinstance(message.body, News):
            return
        if len(self._young) >= _GENERATION:
            self._old, self._young = self._young, {}
        self._young[said] = message
