"""What every core on the bus hears and what it wants done; shells translate both."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from swarm.protocol.key_space import KeySpace
from swarm.protocol.messages import Message, Snapshot


@dataclass(frozen=True, slots=True)
class MessageReceived:
    """A checked message arrived while it was new."""

    message: Message
    arrived_s: float | None = field(default=None, compare=False)
    """When it came into this process [s of ``now_s``], where it may have waited for others; None:
    now."""

    @property
    def messages(self) -> tuple[Message, ...]:
        """It alone."""
        return (self.message,)


@dataclass(frozen=True, slots=True)
class MessagesReceived:
    """Several that have waited for each other, in large fleets; cores that do not say so never
    hear of it.

    None but the last may tell what time it is."""

    messages: tuple[Message, ...]
    arrived_s: float | None = field(default=None, compare=False)
    """When the last of them came; see `MessageReceived`."""


@dataclass(frozen=True, slots=True)
class SnapshotsReceived:
    """All answers to an `Ask`, maybe none."""

    snapshots: tuple[Snapshot, ...]


@dataclass(frozen=True, slots=True)
class PeerSeen:
    """The liveliness token of ``writer`` is there."""

    writer: str


@dataclass(frozen=True, slots=True)
class PeerGone:
    """The liveliness token of ``writer`` disappeared."""

    writer: str


@dataclass(frozen=True, slots=True)
class KeysReplaced:
    """A roster came into force by which these names have other keys, or none any more."""

    names: frozenset[str]


@dataclass(frozen=True, slots=True)
class LinkChanged:
    """The own link to the bus came up or went down."""

    up: bool


@dataclass(frozen=True, slots=True)
class Stop:
    """Whoever runs this process wants it to end."""

    reason: str
    believed: bool = True
    """Whether anybody still believes what it says: not once its keys are revoked or replaced."""


@dataclass(frozen=True, slots=True)
class Tick:
    """A deadline has come."""


CommonEvent = (
    MessageReceived
    | SnapshotsReceived
    | PeerSeen
    | PeerGone
    | KeysReplaced
    | LinkChanged
    | Stop
    | Tick
)


@dataclass(frozen=True, slots=True)
class Publish:
    """Say this on its key."""

    message: Message
    to: tuple[str, ...] | None = None
    """Of a claim, who alone is to hear it now, maybe nobody; all others hear it with a later word.
    None: it is said to everybody."""

    @property
    def keys(self) -> tuple[str, ...]:
        """On which it is said."""
        if self.to is None:
            return (self.message.key,)
        keys, writer = KeySpace(self.message.mission), self.message.writer
        return tuple(keys.claim_to(writer, each) for each in self.to)


@dataclass(frozen=True, slots=True)
class PublishLast:
    """Say what ``make`` gives, once all else that a step wants is done: nobody waits for it.

    It is put together only then, and before the core's next step; nothing follows from leaving
    it out.
    """

    make: Callable[[], Message]


@dataclass(frozen=True, slots=True)
class Ask:
    """Ask for registers; ends in `SnapshotsReceived`."""

    of: tuple[str, ...] = ()
    """Writers that are asked for whatever they know. Without any everyone is asked, for what each
    answers for."""


Cell = tuple[int, int]
"""Of the sky over a mission: how far to the east and to the north, in cells."""


@dataclass(frozen=True, slots=True)
class TuneIn:
    """Hear what UAVs in these cells say to those near them, and in no others."""

    cells: frozenset[Cell]


@dataclass(frozen=True, slots=True)
class Save:
    """Keep the core's `memory` where a new life of this process finds it."""


@dataclass(frozen=True, slots=True)
class LogLine:
    """A line for the log."""

    text: str
    fields: dict[str, object] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Finish:
    """Everything is done; the process may end with this exit status."""

    status: int


CommonAction = Publish | PublishLast | Ask | TuneIn | Save | LogLine | Finish
