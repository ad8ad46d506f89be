"""What goes wrong and when, as lines a person can read, edit and play again.

One line is one fault: ``TIME KIND NAME… by AMOUNT for SECONDS with MEMORY``, such as ``12.5 crash
u1 for 3.2 with disk``; without ``for`` it stays. Times are virtual seconds since all processes
began.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Final, TypeVar

from sim.world.settings import RestartMemory
from swarm.runtime.errors import Fault, InputError

E = TypeVar("E", bound=StrEnum)


class DisturbanceKind(StrEnum):
    """What may go wrong."""

    LOSE = "lose"
    """A UAV disappears with all that is on it, or the coordinator for good."""
    CRASH = "crash"
    """A process dies; its vehicle flies on. With a duration it starts anew after that."""
    HANG = "hang"
    """A process is stopped: its token goes after the lease, and what arrives waits."""
    DEADLOCK = "deadlock"
    """A program hangs while its token lives."""
    CUT = "cut"
    """The named processes are parted from all others."""
    UNPLUG = "unplug"
    """A process loses its link, and knows it."""
    MUTE = "mute"
    """Nothing the first says reaches the second, though the tokens live."""
    ROUTERS = "routers"
    """All links go at once."""
    BLINK = "blink"
    """All tokens go and come back."""
    WEATHER = "weather"
    """Messages are lost, doubled, late and out of order; the amount says how badly."""
    SKEW = "skew"
    """A process's clock jumps forward."""
    SLOW = "slow"
    """A vehicle flies at that share of its speed from now on."""
    REFUSE = "refuse"
    """A vehicle will not fly to a task."""
    WITHDRAW = "withdraw"
    """The coordinator takes a task off the board."""
    ADD = "add"
    """The operator adds a task; the amount says where between the scenario's."""
    RETRACT = "retract"
    """The operator takes a task off the board, with or without a coordinator."""
    HOLD = "hold"
    """The operator stops a UAV, and lets it go on in the end."""
    RETURN = "return"
    """The operator sends a UAV home."""
    ABORT = "abort"
    """The operator aborts the mission."""
    ZONE = "zone"
    """In the field: the operator draws a zone over a UAV; the amount says how large. With a
    duration it is taken away after that."""
    DRAIN = "drain"
    """In the field: a battery drains faster from now on, by that share of its rate."""


FIELD_KINDS: Final = frozenset({DisturbanceKind.ZONE, DisturbanceKind.DRAIN})
"""What can go wrong only in the field."""
PLAIN_KINDS: Final = tuple(kind for kind in DisturbanceKind if kind not in FIELD_KINDS)


@dataclass(frozen=True, slots=True)
class DisturbanceShape:
    """What a kind of disturbance must be told.

    ``names`` says of what: "" of nothing, "process", "uav", "pair" (of processes), "group",
    "task", or "uav task".
    """

    names: str
    amount: bool = False
    lasts: bool = False
    """Whether it may last for a time; True also where it may be for good."""
    must_end: bool = False
    memory: bool = False


_SHAPES: Final = {
    DisturbanceKind.LOSE: DisturbanceShape("process"),
    DisturbanceKind.CRASH: DisturbanceShape("process", lasts=True, memory=True),
    DisturbanceKind.HANG: DisturbanceShape("process", lasts=True),
    DisturbanceKind.DEADLOCK: DisturbanceShape("process", lasts=True),
    DisturbanceKind.CUT: DisturbanceShape("group", lasts=True, must_end=True),
    DisturbanceKind.UNPLUG: DisturbanceShape("process", lasts=True, must_end=True),
    DisturbanceKind.MUTE: DisturbanceShape("pair", lasts=True, must_end=True),
    DisturbanceKind.ROUTERS: DisturbanceShape("", lasts=True, must_end=True),
    DisturbanceKind.BLINK: DisturbanceShape(""),
    DisturbanceKind.WEATHER: DisturbanceShape("", amount=True, lasts=True, must_end=True),
    DisturbanceKind.SKEW: DisturbanceShape("process", amount=True),
    DisturbanceKind.SLOW: DisturbanceShape("uav", amount=True),
    DisturbanceKind.REFUSE: DisturbanceShape("uav task", lasts=True),
    DisturbanceKind.WITHDRAW: DisturbanceShape("task"),
    DisturbanceKind.ADD: DisturbanceShape("", amount=True),
    DisturbanceKind.RETRACT: DisturbanceShape("task"),
    DisturbanceKind.HOLD: DisturbanceShape("uav", lasts=True, must_end=True),
    DisturbanceKind.RETURN: DisturbanceShape("uav"),
    DisturbanceKind.ABORT: DisturbanceShape(""),
    DisturbanceKind.ZONE: DisturbanceShape("uav", amount=True, lasts=True),
    DisturbanceKind.DRAIN: DisturbanceShape("uav", amount=True),
}
_COUNTS: Final = {"": 0, "process": 1, "uav": 1, "pair": 2, "task": 1, "uav task": 2}


def shape_of(kind: DisturbanceKind) -> DisturbanceShape:
    """What a disturbance of that kind must be told."""
    return _SHAPES[kind]


@dataclass(frozen=True, slots=True)
class Disturbance:
    """One thing that goes wrong.

    Raises:
        ValueError: something is missing, too much or out of bounds.
    """

    at_s: float
    """When it begins [s]."""
    kind: DisturbanceKind
    names: tuple[str, ...] = ()
    """Of processes or tasks, as the kind wants them."""
    lasts_s: float | None = None
    """How long [s]; None for good, or for an instant."""
    amount: float | None = None
    memory: RestartMemory | None = None
    """What a process that starts anew finds."""

    def __post_init__(self) -> None:
        shape = _SHAPES[self.kind]
        count = _COUNTS.get(shape.names)
        if not (math.isfinite(self.at_s) and self.at_s >= 0.0):
            raise ValueError("it must begin at a time >= 0")
        if len(self.names) != (count if count is not None else max(1, len(self.names))):
            wanted = "one or more names" if count is None else f"{count} name(s)"
            raise ValueError(f"{self.kind} takes {wanted}, not {len(self.names)}")
        if len(set(self.names)) != len(self.names):
            raise ValueError("a name stands there twice")
        if shape.amount != (self.amount is not None):
            raise ValueError(f"{self.kind} takes {'an' if shape.amount else 'no'} amount")
        if self.amount is not None and not 0.0 < self.amount <= 1.0:
            raise ValueError("the amount must be within 0..1 and above 0")
        if self.lasts_s is not None and not (shape.lasts and 0.0 < self.lasts_s < math.inf):
            raise ValueError(f"{self.kind} cannot last for {self.lasts_s} s")
        if self.lasts_s is None and shape.must_end:
            raise ValueError(f"{self.kind} must have an end")
        if (self.memory is not None) != (shape.memory and self.lasts_s is not None):
            raise ValueError("who starts anew, and nobody else, finds a memory")

    @property
    def ends_s(self) -> float:
        """When it is over [s]; when it begins, if it is for good or an instant."""
        return self.at_s + (self.lasts_s or 0.0)

    def __str__(self) -> str:
        words = [f"{self.at_s:g}", self.kind.value, *self.names]
        if self.amount is not None:
            words += ["by", f"{self.amount:g}"]
        if self.lasts_s is not None:
            words += ["for", f"{self.lasts_s:g}"]
        if self.memory is not None:
            words += ["with", self.memory.value]
        return " ".join(words)


def format_schedule(schedule: Iterable[Disturbance]) -> str:
    """One line for each, in order of time."""
    return "".join(f"{each}\n" for each in sorted(schedule, key=lambda each: each.at_s))


def parse_schedule(
    lines: Iterable[str], source: str, processes: Collection[str], tasks: Collection[str]
) -> tuple[Disturbance, ...]:
    """The schedule that `format_schedule` wrote, or a person; blank lines and ``#`` aside.

    ``source`` is named in error messages; ``processes`` and ``tasks`` are names that there may be.

    Raises:
        InputError: a line cannot be understood.
    """
    schedule = []
    for number, line in enumerate(lines, start=1):
        words = line.partition("#")[0].split()
        if not words:
            continue
        try:
            disturbance = _parse(words)
            _check_names(disturbance, processes, tasks)
        except ValueError as fault:
            remedy = "write TIME KIND NAME… by AMOUNT for SECONDS with MEMORY"
            raise InputError(Fault(source, f"line {number}", str(fault), remedy)) from None
        schedule.append(disturbance)
    return tuple(sorted(schedule, key=lambda each: each.at_s))


def _parse(words: Sequence[str]) -> Disturbance:
    if len(words) < 2:
        raise ValueError("a time and a kind are wanted")
    names, options = list[str](), dict[str, str]()
    rest = iter(words[2:])
    for word in rest:
        if word in ("by", "for", "with"):
            options[word] = next(rest, "")
        else:
            names.append(word)
    return Disturbance(
        at_s=_number(words[0]),
        kind=_one_of(DisturbanceKind, words[1]),
        names=tuple(names),
        lasts_s=_number(options["for"]) if "for" in options else None,
        amount=_number(options["by"]) if "by" in options else None,
        memory=_one_of(RestartMemory, options["with"]) if "with" in options else None,
    )


def _number(word: str) -> float:
    try:
        return float(word)
    except ValueError:
        raise ValueError(f"{word!r} is no number") from None


def _one_of(kinds: type[E], word: str) -> E:
    try:
        return kinds(word)
    except ValueError:
        raise ValueError(f"{word!r} is none of {', '.join(kinds)}") from None


def _check_names(
    disturbance: Disturbance, processes: Collection[str], tasks: Collection[str]
) -> None:
    names, shape = disturbance.names, _SHAPES[disturbance.kind]
    of_tasks = {"task": names, "uav task": names[1:]}.get(shape.names, ())
    for name in names:
        known = tasks if name in of_tasks else processes
        if name not in known:
            raise ValueError(f"{name} is none of {', '.join(sorted(known))}")
