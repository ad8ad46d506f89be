"""Timers of the runtime, validated.

Leaves out: what belongs to one transport (swarm.bus) or one autopilot
(agent.mavlink).
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

__all__ = ["Timing"]


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
    """Without a coordinator: how long airborne agents wait for a mission to start."""
    ask_gap_s: float = 0.2
    """Shortest interval between two questions to everyone."""
    takeover_s: float = 1.0
    """How long a coordinator that stands by waits before it takes a lost one's place."""
    replan_interval_s: float = 5.0
    """Shortest interval between two epochs of a running mission."""
    recall_s: float = 60.0
    """An agent that starts anew and finds nobody trusts its own memory up to this age."""
    reconsider_s: float = 30.0
    """A task that the vehicle refused is considered again after this time."""
    stalemate_s: float = 30.0
    """How long a fleet may leave open tasks to themselves before the mission ends."""

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
