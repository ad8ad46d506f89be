"""How long processes wait for each other, and when one of them was itself held up.

Timers of the runtime, validated; which of them suit which kind of link; the earliest of
several deadlines; and a detector for a process that was stopped, starved or asleep: it has
not heard the others meanwhile, so their silence proves nothing.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from types import MappingProxyType
from typing import Final


@dataclass(frozen=True, slots=True)
class Timing:
    """How long processes wait for each other [s].

    The defaults are wall seconds. Cores live in mission seconds, so shells pass
    them `scaled` by the speed-up.

    Raises:
        ValueError: a duration is not positive and finite, or `silence_s` is less than
            twice `announce_s`, so that one lost announcement would pass for a loss.
    """

    objection_window_s: float = 0.3
    """A proposed claim that nobody has beaten for this long is held."""
    loss_delay_s: float = 0.2
    """A process whose token has been gone for this long is lost; bridges the moment in
    which a router's end makes all tokens blink."""
    silence_s: float = 5.0
    """A process that has said nothing for this long is lost, even while its token lives: it
    hangs. Must be well above `announce_s`, at which the living repeat themselves."""
    pause_s: float = 1.0
    """A process whose own deadline has passed this long ago has itself been held up: what it
    believes of others is old, and it learns before it decides."""
    relink_grace_s: float = 2.0
    """After the own link is back, others get this long to show their tokens again."""
    patience_s: float = 0.5
    """How long a free UAV of better rank is expected to decide first."""
    announce_s: float = 2.0
    """Interval at which each process repeats its own registers."""
    status_s: float = 0.2
    """Interval of status messages."""
    ask_s: float = 1.0
    """Interval at which a process that lacks the brief asks for it again."""
    linger_s: float = 2.0
    """Without a coordinator: how long after the last task agents wait before going home."""
    abandon_s: float = 60.0
    """Without a coordinator: how long airborne agents wait for a mission to start. Without
    the UAVs that could go on: how long a coordinator waits for them to come back."""
    ask_gap_s: float = 0.2
    """Shortest interval between two questions to everyone."""
    restart_s: float = 10.0
    """Before the start: an agent that was lost gets this long to be started anew, while other
    vehicles wait in the air."""
    hover_s: float = 60.0
    """Before the start: how long a vehicle waits in the air for others that do not get ready;
    5 % of a battery that lasts 20 minutes."""
    takeover_s: float = 1.0
    """How long a coordinator that stands by waits before it takes a lost one's place."""
    replan_interval_s: float = 5.0
    """Shortest interval between two epochs of a running mission."""
    recall_s: float = 60.0
    """A process that starts anew and finds nobody trusts its own memory up to this age."""
    reconsider_s: float = 30.0
    """A task that the vehicle refused is considered again after this time."""
    stalemate_s: float = 45.0
    """How long a fleet may leave open tasks to themselves before the mission ends; longer than
    `reconsider_s`, or no task that was refused would be considered again."""
    clear_s: float = 600.0
    """How long a vehicle stands beside slots that lost ones block before it leaves the mission:
    a person may come and clear one."""

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            if not (math.isfinite(value) and value > 0.0):
                raise ValueError(f"{field.name} must be > 0 s, not {value}")
        if self.silence_s < 2.0 * self.announce_s:
            raise ValueError(
                f"silence_s must be >= 2 announce_s = {2.0 * self.announce_s}, not {self.silence_s}"
            )

    def scaled(self, speedup: float) -> Timing:
        """The same wall durations in seconds of a clock that runs ``speedup`` times as fast."""
        return Timing(*(value * speedup for value in dataclasses.astuple(self)))


UNSTRETCHED_UAVS: Final = 25
"""Largest fleet in which everybody repeats itself as often as its link asks for."""


def stretch_of(n_uav: int) -> float:
    """By what `announce_s` and `silence_s` of UAVs grow in a fleet of that size.

    Everybody hears everybody's repetitions, so these come the more seldom the more there are:
    what one process hears of them in a second does not grow beyond `UNSTRETCHED_UAVS`.
    """
    return max(1.0, n_uav / UNSTRETCHED_UAVS)


MOST_STATUS_STRETCH: Final = 5.0
"""Statuses are for onlookers, who would hear more of them with every UAV; but the program of each
must show that it lives several times in every `Timing.silence_s`."""


class LinkKind(StrEnum):
    """What kind of network the processes of a fleet reach each other by."""

    CLEAN = "clean"
    """One machine or a wired network: nothing is lost."""
    NORMAL = "normal"
    """Good radio: up to 5 % loss and 30 ms each way."""
    BAD = "bad"
    """Poor radio: up to 20 % loss and 100 ms each way."""


@dataclass(frozen=True, slots=True)
class LinkPreset:
    """Settings that belong together on one kind of link; all in wall seconds.

    Raises:
        ValueError: a duration is not positive and finite.
    """

    lease_s: float
    """Silence of a transport after which the other side takes it for broken."""
    answer_s: float
    """How long a question to everyone waits for the slowest answer."""
    timing: Timing

    def __post_init__(self) -> None:
        for name, value in (("lease_s", self.lease_s), ("answer_s", self.answer_s)):
            if not (math.isfinite(value) and value > 0.0):
                raise ValueError(f"{name} must be > 0 s, not {value}")


PRESETS: Final[Mapping[LinkKind, LinkPreset]] = MappingProxyType(
    {
        LinkKind.CLEAN: LinkPreset(
            lease_s=1.0,
            answer_s=1.0,
            timing=Timing(objection_window_s=0.2, silence_s=3.0, announce_s=1.0),
        ),
        LinkKind.NORMAL: LinkPreset(lease_s=1.5, answer_s=1.0, timing=Timing()),
        LinkKind.BAD: LinkPreset(
            lease_s=8.0,
            answer_s=5.0,
            timing=Timing(
                objection_window_s=2.0,
                loss_delay_s=3.0,
                silence_s=20.0,
                relink_grace_s=8.0,
                patience_s=2.5,
                announce_s=4.0,
                status_s=0.5,
                ask_s=5.0,
                linger_s=8.0,
                ask_gap_s=1.0,
                takeover_s=4.0,
                replan_interval_s=10.0,
            ),
        ),
    }
)


def preset(link: LinkKind, lease_s: float | None = None) -> LinkPreset:
    """Settings for that kind of link; a lease given by hand takes the place of the preset's."""
    chosen = PRESETS[link]
    return chosen if lease_s is None else dataclasses.replace(chosen, lease_s=lease_s)


def earliest(*times_s: float | None) -> float | None:
    """The first of ``times_s``; None if there is none."""
    first_s: float | None = None
    for time_s in times_s:
        if time_s is not None and (first_s is None or time_s < first_s):
            first_s = time_s
    return first_s


class StallDetector:
    """Compares when a step comes with when it was to come at the latest.

    A deadline missed by more than ``limit_s`` is no mere delay [s].
    """

    def __init__(self, limit_s: float) -> None:
        self._limit_s = limit_s
        self._deadline_s: float | None = None
        self.runs_since_s = math.inf
        """Since when this process is known to have run without a stop; infinite: it is not known.
        What has been missed since then has only waited for others in it."""

    def expect_by(self, deadline_s: float | None) -> None:
        """After a step: the next one comes by then; None if there is no need for one."""
        self._deadline_s = deadline_s

    def late(self, now_s: float) -> bool:
        """At the start of a step: whether the promised deadline is long past."""
        stood_until_s = min(now_s, self.runs_since_s)
        return self._deadline_s is not None and stood_until_s - self._deadline_s > self._limit_s
