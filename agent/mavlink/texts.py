"""Joins the pieces of what an autopilot says in words.

A text longer than one STATUSTEXT comes in chunks of one id; the last one is shorter
than the field, or ends with it. A chunk that is lost leaves "..." in its place. Leaves
out: what a text means (agent.mavlink.state).

Message: https://mavlink.io/en/messages/common.html#STATUSTEXT
"""

from __future__ import annotations

from dataclasses import dataclass, field

from agent.mavlink.messages import Text

__all__ = ["TextJoiner"]

_CHUNK_CHARS = 50
_MOST_CHUNKS = 8
_GAP = "..."


@dataclass(slots=True)
class _Unfinished:
    """A text whose end has not come."""

    id: int
    severity: int
    pieces: list[str] = field(default_factory=list)
    next_seq: int = 0


class TextJoiner:
    """The texts of one autopilot."""

    def __init__(self) -> None:
        self._unfinished: _Unfinished | None = None

    def add(self, severity: int, text: str, text_id: int, seq: int) -> list[Text]:
        """Take in one STATUSTEXT; gives the texts that are complete by it.

        Args:
            severity: MAV_SEVERITY.
            text: what the message holds, up to the end of the field.
            text_id: which text it is a chunk of; 0 is a text of its own.
            seq: which chunk.
        """
        said: list[Text] = []
        before = self._unfinished
        if before is not None and (text_id != before.id or seq < before.next_seq):
            said.append(self._end(before, _GAP))
            before = None
        if text_id == 0:
            return [*said, Text(severity, _clean(text))]
        chunk = before or _Unfinished(text_id, severity)
        self._unfinished = chunk
        if seq > chunk.next_seq:
            chunk.pieces.append(_GAP)
        chunk.pieces.append(text)
        chunk.next_seq = seq + 1
        if len(text) < _CHUNK_CHARS:
            said.append(self._end(chunk))
        elif len(chunk.pieces) >= _MOST_CHUNKS:
            said.append(self._end(chunk, _GAP))
        return said

    def forget(self) -> None:
        """Give up an unfinished text, because the link is a new one."""
        self._unfinished = None

    def _end(self, chunk: _Unfinished, tail: str = "") -> Text:
        self._unfinished = None
        return Text(chunk.severity, _clean("".join((*chunk.pieces, tail))))


def _clean(text: str) -> str:
    """The text without the tab that PX4 ends it with, and without what cannot be printed."""
    return "".join(c if c.isprintable() else "?" for c in text.strip())
