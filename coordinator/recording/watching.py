"""`swarm record`: an onlooker that writes down a mission until it is over.

Leaves out: what is written (coordinator.recording.recorder), and joining (coordinator.joining).
"""

from __future__ import annotations

from coordinator.status.onlooker import Onlooker
from swarm.config import Timing
from swarm.deadline import earliest
from swarm.events import BusFact, Finish, Wish
from swarm.wire.messages import EpochPhase

__all__ = ["Witness"]


class Witness:
    """A core that looks on until everybody who took part has left.

    Args:
        mission: name of the mission.
        timing: timers, in the seconds of ``now_s``.
        linger_s: how long to wait for somebody to come back [s of ``now_s``].
        until_s: when to stop at the latest, from the start [s of ``now_s``]; None: never.
    """

    def __init__(
        self, mission: str, timing: Timing, *, linger_s: float, until_s: float | None
    ) -> None:
        self.onlooker = Onlooker(mission, timing, None)
        self._linger_s = linger_s
        self._until_s = until_s
        self._stop_at_s: float | None = None
        self._empty_at_s: float | None = None
        """Since when nobody has been there, after somebody had."""
        self._met = False

    def start(self, now_s: float) -> list[Wish]:
        """Ask what has happened so far."""
        if self._until_s is not None:
            self._stop_at_s = now_s + self._until_s
        return self.onlooker.start(now_s)

    def step(self, fact: BusFact, now_s: float) -> list[Wish]:
        """Take note of one fact."""
        wishes = self.onlooker.step(fact, now_s)
        observer = self.onlooker.observer
        brief = observer.replica.brief
        fleet = observer.present if brief is None else {uav.id for uav in brief.uavs}
        there = not fleet.isdisjoint(observer.present)
        self._met |= there
        if observer.cut_since_s is not None:
            # Who is there cannot be seen; after the end nobody need be waited for.
            there = brief is not None and observer.phase is not EpochPhase.ENDED
        if there or not self._met:
            self._empty_at_s = None
        elif self._empty_at_s is None:
            self._empty_at_s = now_s
        deadline_s = earliest(self._stop_at_s, self._over_at_s)
        if deadline_s is not None and deadline_s <= now_s:
            wishes.append(Finish(0))
        return wishes

    def next_deadline_s(self) -> float | None:
        """When `step` wants a tick."""
        return earliest(self.onlooker.next_deadline_s(), self._stop_at_s, self._over_at_s)

    @property
    def _over_at_s(self) -> float | None:
        return None if self._empty_at_s is None else self._empty_at_s + self._linger_s
