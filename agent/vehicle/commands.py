"""Commands with acknowledgement, retry and patience: a pure machine.

An acknowledgement names only the command's number, so one command of a number is in
flight at a time and others of that number wait in line. Acknowledgements still owed
for earlier transmissions are counted and not mistaken for the newest one's, as long as
they come in order. Where a firmware acknowledges twice, two are owed: if one is lost,
the next command's own answers are taken for the old one's, and it is sent again. Leaves
out: what a command is for, and whether its effect is *seen* (agent.vehicle.bridge).

Protocol: https://mavlink.io/en/services/command.html
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import Enum, IntEnum

from agent.vehicle.messages import CommandAck, CommandInt, CommandLong

VehicleCommand = CommandLong | CommandInt

_OWED_TIMEOUTS = 2.0
"""An acknowledgement later than that many timeouts is no longer expected."""


class _Result(IntEnum):
    """MAV_RESULT."""

    ACCEPTED = 0
    TEMPORARILY_REJECTED = 1
    DENIED = 2
    UNSUPPORTED = 3
    FAILED = 4
    IN_PROGRESS = 5
    CANCELLED = 6
    COMMAND_LONG_ONLY = 7
    COMMAND_INT_ONLY = 8
    UNSUPPORTED_FRAME = 9


def result_text(result: int | None) -> str:
    """MAV_RESULT in words; None is no answer at all."""
    if result is None:
        return "no answer"
    try:
        return _Result(result).name.lower().replace("_", " ")
    except ValueError:
        return f"result {result}"


class CommandOutcome(Enum):
    """How a command ended."""

    ACCEPTED = "accepted"
    REFUSED = "refused"
    UNANSWERED = "unanswered"


@dataclass(frozen=True, slots=True)
class CommandEnded:
    """A command needs no more care; superseded and cancelled ones end silently."""

    tag: str
    ending: CommandOutcome
    result: int | None
    """MAV_RESULT of the last acknowledgement; None without one."""


@dataclass(frozen=True, slots=True)
class CommandPolicy:
    """Patience with one command; durations are vehicle seconds.

    Raises:
        ValueError: a number is not positive.
    """

    ack_timeout_s: float = 1.0
    """Wait for an acknowledgement before sending again."""
    tries: int = 5
    """Transmissions without any answer before giving up."""
    busy_delay_s: float = 0.5
    """Pause after "temporarily rejected"."""
    busy_tries: int = 20
    """Answers "temporarily rejected" before giving up."""
    progress_timeout_s: float = 10.0
    """Wait for the final answer after "in progress"."""

    def __post_init__(self) -> None:
        for name in ("ack_timeout_s", "tries", "busy_delay_s", "busy_tries", "progress_timeout_s"):
            if not getattr(self, name) > 0:
                raise ValueError(f"{name} must be > 0, not {getattr(self, name)}")


@dataclass(slots=True)
class _Pending:
    """A command in flight or in line."""

    tag: str
    serial: int
    message: VehicleCommand
    renewed: Callable[[], VehicleCommand | None] | None = None
    """Makes what is sent in its place when it is sent again; None: it stays as it is."""
    sent: bool = False
    silent_tries: int = 0
    """Transmissions since the last answer."""
    busy_answers: int = 0
    deadline_s: float = 0.0


@dataclass(slots=True)
class _Owed:
    """A transmission that has not been answered."""

    serial: int
    expires_s: float


class CommandQueue:
    """All commands to one autopilot."""

    def __init__(self, policy: CommandPolicy) -> None:
        self._policy = policy
        self._lines: dict[int, deque[_Pending]] = {}
        self._owed: dict[int, deque[_Owed]] = {}
        self._serial = 0
        self.acknowledged_twice: frozenset[int] = frozenset()
        """Numbers of the commands that the firmware acknowledges twice."""
        self.stray_acks = 0
        """Acknowledgements that belonged to nothing in flight."""

    def send(
        self,
        tag: str,
        message: VehicleCommand,
        now_s: float,
        renewed: Callable[[], VehicleCommand | None] | None = None,
    ) -> list[VehicleCommand]:
        """Take care of ``message``; a pending one of the same tag is superseded.

        When it is to be sent again ``renewed`` makes what is sent in its place, of the same
        number; without that, or where that gives None, it stays as it is.

        Returns:
            What to transmit now; empty if another command of the number is in flight.
        """
        self._serial += 1
        pending = _Pending(tag, self._serial, message, renewed)
        line = self._lines.setdefault(message.command, deque())
        for place, other in enumerate(line):
            if other.tag == tag:
                line[place] = pending
                return self._transmit(pending, now_s) if place == 0 else []
        line.append(pending)
        return self._transmit(pending, now_s) if len(line) == 1 else []

    def pending(self, tag: str) -> bool:
        """Whether a command of that tag is in flight or in line."""
        return any(entry.tag == tag for line in self._lines.values() for entry in line)

    def cancel(self, tag: str, now_s: float) -> list[VehicleCommand]:
        """Forget the command of that tag; gives what to transmit, if one waited for it."""
        for line in self._lines.values():
            for place, entry in enumerate(line):
                if entry.tag == tag:
                    del line[place]
                    return self._transmit(line[0], now_s) if place == 0 and line else []
        return []

    def cancel_all(self) -> None:
        """Forget everything in flight and in line; acknowledgements to come are stray."""
        self._lines.clear()

    def on_ack(
        self, ack: CommandAck, now_s: float
    ) -> tuple[list[VehicleCommand], list[CommandEnded]]:
        """What to transmit, and which command ended, by this acknowledgement."""
        serial = self._settle(ack, now_s)
        line = self._lines.get(ack.command)
        if not line or line[0].serial != serial:
            self.stray_acks += 1
            return [], []
        head = line[0]
        head.silent_tries = 0
        match ack.result:
            case _Result.IN_PROGRESS:
                head.deadline_s = now_s + self._policy.progress_timeout_s
                return [], []
            case _Result.TEMPORARILY_REJECTED:
                head.busy_answers += 1
                if head.busy_answers < self._policy.busy_tries:
                    head.deadline_s = now_s + self._policy.busy_delay_s
                    return [], []
                return self._end(line, CommandOutcome.REFUSED, ack.result, now_s)
            case _Result.ACCEPTED:
                return self._end(line, CommandOutcome.ACCEPTED, ack.result, now_s)
            case _:
                return self._end(line, CommandOutcome.REFUSED, ack.result, now_s)

    def on_time(self, now_s: float) -> tuple[list[VehicleCommand], list[CommandEnded]]:
        """Send again, or give up, whatever has been waited for long enough."""
        out: list[VehicleCommand] = []
        ended: list[CommandEnded] = []
        for line in list(self._lines.values()):
            if not line or now_s < line[0].deadline_s:
                continue
            if line[0].silent_tries >= self._policy.tries:
                more, over = self._end(line, CommandOutcome.UNANSWERED, None, now_s)
                out += more
                ended += over
            else:
                out += self._transmit(line[0], now_s)
        return out, ended

    def next_deadline_s(self) -> float | None:
        """When `on_time` has something to do; None if nothing is pending."""
        return min((line[0].deadline_s for line in self._lines.values() if line), default=None)

    def _transmit(self, pending: _Pending, now_s: float) -> list[VehicleCommand]:
        if pending.sent and pending.renewed is not None:
            pending.message = pending.renewed() or pending.message
        pending.sent = True
        message = pending.message
        if isinstance(message, CommandLong) and pending.silent_tries:
            message = replace(message, confirmation=min(pending.silent_tries, 255))
        pending.silent_tries += 1
        pending.deadline_s = now_s + self._policy.ack_timeout_s
        owed = self._owed.setdefault(message.command, deque(maxlen=64))
        expires_s = now_s + _OWED_TIMEOUTS * self._policy.ack_timeout_s
        for _ in range(2 if message.command in self.acknowledged_twice else 1):
            owed.append(_Owed(pending.serial, expires_s))
        return [message]

    def _settle(self, ack: CommandAck, now_s: float) -> int | None:
        """Serial of the transmission that ``ack`` answers; None if none is owed."""
        owed = self._owed.get(ack.command)
        while owed and owed[0].expires_s < now_s:
            owed.popleft()
        if not owed:
            return None
        if ack.result == _Result.IN_PROGRESS:
            owed[0].expires_s = now_s + self._policy.progress_timeout_s
            return owed[0].serial
        return owed.popleft().serial

    def _end(
        self, line: deque[_Pending], ending: CommandOutcome, result: int | None, now_s: float
    ) -> tuple[list[VehicleCommand], list[CommandEnded]]:
        over = CommandEnded(line.popleft().tag, ending, result)
        return (self._transmit(line[0], now_s) if line else []), [over]


class RepeatedCommand:
    """What a vehicle is told until the effect is seen, but not for ever.

    Args:
        tag: its commands'.
        effect_timeout_s: wait for the effect of an accepted command to be seen.
        retry_delay_s: pause after any other outcome.
    """

    def __init__(
        self,
        tag: str,
        commands: CommandQueue,
        tries: int,
        effect_timeout_s: float,
        retry_delay_s: float,
    ) -> None:
        self._tag = tag
        self._commands = commands
        self._tries = tries
        self._effect_timeout_s = effect_timeout_s
        self._retry_delay_s = retry_delay_s
        self._next_s = -math.inf
        self.given = 0
        """How often it was given."""
        self.refused = False
        """The last was not accepted."""
        self.accepted = False
        """The last was accepted."""
        self.result: int | None = None
        """MAV_RESULT of the last; None without an acknowledgement."""

    def on_ended(self, ended: CommandEnded, now_s: float) -> bool:
        """Take the outcome of a command; whether it is an acceptance of this one."""
        if ended.tag != self._tag or not self.given:
            return False
        self.accepted, self.result = ended.ending is CommandOutcome.ACCEPTED, ended.result
        self.refused = not self.accepted
        self.wait(now_s)
        return not self.refused

    def wait(self, now_s: float) -> None:
        """Give the vehicle its time."""
        self._next_s = now_s + (self._retry_delay_s if self.refused else self._effect_timeout_s)

    def give(self, message: VehicleCommand, now_s: float) -> list[VehicleCommand] | None:
        """What to transmit now; None if it was given often enough."""
        return self.give_made(lambda: message, now_s)

    def give_made(
        self, make: Callable[[], VehicleCommand | None], now_s: float
    ) -> list[VehicleCommand] | None:
        """The same of what ``make`` gives, each time that it is sent; nothing while that is None.

        All that it gives is of one number.
        """
        if self._commands.pending(self._tag) or now_s < self._next_s:
            return []
        if self.given >= self._tries:
            return None
        message = make()
        if message is None:
            return []
        self.given += 1
        self.accepted = False
        return self._commands.send(self._tag, message, now_s, make)

    def cancel(self, now_s: float) -> list[VehicleCommand]:
        """Its effect is seen."""
        return self._commands.cancel(self._tag, now_s)
