"""What several agents of one process hear, read once for all of them.

Each hears the same statements, and reading one (fields, ranges, who may say so) takes longer than
to take it in. A statement that was read well is found again by its bytes. Only for a bus without
keys, since a process with keys is that of one UAV; for one thread.
"""

from __future__ import annotations

from typing import Final

from swarm.protocol.messages import Message
from swarm.protocol.uav_messages import Choice, Nearby, Status

_GENERATION: Final = 4096
"""Statements after which those go that nobody has heard again meanwhile."""
_NEAR_GENERATION: Final = 1024
"""The same of where UAVs are: never repeated, but heard by all near it within a second."""


class _Generations:
    """What was kept or found last, between one and two generations of it."""

    def __init__(self, size: int) -> None:
        self._size = size
        self._young: dict[bytes, Message] = {}
        self._old: dict[bytes, Message] = {}

    def find(self, said: bytes) -> Message | None:
        message = self._young.get(said)
        if message is None and (message := self._old.get(said)) is not None:
            self.keep(said, message)
        return message

    def keep(self, said: bytes, message: Message) -> None:
        if len(self._young) >= self._size:
            self._old, self._young = self._young, {}
        self._young[said] = message


class SharedMessages:
    """Statements of one mission by their bytes: the newest, and what is still repeated."""

    def __init__(self) -> None:
        self._repeated = _Generations(_GENERATION)
        self._near = _Generations(_NEAR_GENERATION)

    def find(self, said: bytes) -> Message | None:
        """What these bytes say, if it was kept."""
        return self._repeated.find(said) or self._near.find(said)

    def keep(self, said: bytes, message: Message) -> None:
        """These bytes say that; what is for onlookers, and never repeated, is not kept."""
        if isinstance(message.body, Nearby):
            self._near.keep(said, message)
        elif not isinstance(message.body, Status | Choice):
            self._repeated.keep(said, message)
