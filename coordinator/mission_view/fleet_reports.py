"""What the agents of a fleet have reported: newest statuses, what was dropped, and choices.

Whatever is claimed without keys, no more is kept of writers that are not in the fleet than
`MOST_STRANGE`.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Collection
from dataclasses import replace

from swarm.protocol.messages import REVOKED_INCARNATION, Stamp
from swarm.protocol.registers import MOST_STRANGE, Replica
from swarm.protocol.uav_messages import Choice, Status

CHOICES_KEPT = 2000
"""What an observer remembers of why tasks were taken."""


class FleetReports:
    """The reports of one fleet."""

    def __init__(self, replica: Replica) -> None:
        self.statuses: dict[str, Status] = {}
        """Newest status by UAV id, whatever order they arrived in."""
        self.heard_s: dict[str, float] = {}
        """When each writer last said something itself [s of the observer's clock]."""
        self.choices: deque[tuple[str, Stamp, Choice]] = deque(maxlen=CHOICES_KEPT)
        """Why UAVs took tasks, in order of arrival; without `ChoiceBasis.heads`, which no
        observer needs."""
        self._chosen: set[tuple[str, Stamp]] = set()
        """Which those are."""
        self._stamps: dict[str, Stamp] = {}
        self._dropped_before: dict[str, Counter[str]] = {}
        """By UAV: what earlier lives of its agent have dropped."""
        self._replica = replica

    @property
    def dropped(self) -> dict[str, Counter[str]]:
        """What each UAV's agents have dropped in all their lives, by reason."""
        return {
            uav: self._dropped_before.get(uav, Counter()) + Counter(status.dropped)
            for uav, status in self.statuses.items()
        }

    def hear_from(self, writer: str, now_s: float) -> None:
        """It has said something itself."""
        if writer in self.heard_s or self._has_room(writer, len(self.heard_s)):
            self.heard_s[writer] = now_s

    def take_status(self, uav: str, stamp: Stamp, status: Status) -> bool | None:
        """Take in what a UAV says of itself.

        Returns:
            Whether another life of its agent says so; None where it is no news.
        """
        known = self._stamps.get(uav)
        if known is None and not self._has_room(uav, len(self._stamps)):
            return None
        if known is not None and stamp <= known:
            return None
        reborn = known is not None and stamp.incarnation > known.incarnation
        if reborn:
            # A new process counts from nought.
            before = self._dropped_before.setdefault(uav, Counter())
            before.update(self.statuses[uav].dropped)
        self._stamps[uav], self.statuses[uav] = stamp, status
        return reborn

    def take_choice(self, uav: str, stamp: Stamp, choice: Choice) -> bool:
        """Take in why a UAV has taken a task; whether that is news."""
        if (uav, stamp) in self._chosen:
            return False
        if len(self.choices) == CHOICES_KEPT:
            self._chosen.discard(self.choices[0][:2])
        self._chosen.add((uav, stamp))
        slim = replace(choice, basis=replace(choice.basis, heads={}))
        self.choices.append((uav, stamp, slim))
        return True

    def demote_revoked(self, names: Collection[str]) -> None:
        """What was heard under those names is no measure of what is said from now on."""
        for uav in self._stamps.keys() & names:
            self._stamps[uav] = Stamp(REVOKED_INCARNATION, 0)

    def _has_room(self, writer: str, known: int) -> bool:
        brief = self._replica.brief
        if known < MOST_STRANGE:
            return True
        return brief is not None and any(uav.id == writer for uav in brief.uavs)
