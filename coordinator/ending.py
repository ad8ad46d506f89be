"""When a running mission is over, as the coordinator finds.

Leaves out: saying so (coordinator.core).
"""

from __future__ import annotations

from swarm.config import Timing
from swarm.state.board import TaskBoard, TaskState, doable
from swarm.state.membership import Membership
from swarm.wire.messages import ClaimPhase

__all__ = ["Ending"]

ALL_ENDED = "every task has ended"
NOBODY_LEFT = "nobody is left who could go on"
NOBODY_WILL = "nobody takes what is left"


class Ending:
    """The end of one mission.

    Args:
        board: its tasks.
        membership: who is there.
        timing: how long to wait for those who may come back, or change their minds.
    """

    def __init__(self, board: TaskBoard, membership: Membership, timing: Timing) -> None:
        self._board = board
        self._membership = membership
        self._timing = timing
        self._grace_until_s = 0.0
        self._ignorant_until_s = 0.0
        self._prospect: str | None = None
        self._over_at_s: float | None = None

    def wait_until(self, grace_until_s: float, *, was_away: bool = False) -> None:
        """Nobody is missed before then: they need the time to show themselves.

        Args:
            grace_until_s: when.
            was_away: whether the operator may have added tasks of which is not known here, and
                will not be before then.
        """
        if was_away:
            self._ignorant_until_s = max(self._ignorant_until_s, grace_until_s)
        self._grace_until_s = max(self._grace_until_s, grace_until_s)
        if self._over_at_s is not None:
            self._over_at_s = max(self._over_at_s, grace_until_s)

    def reason(self, now_s: float, *, more_to_come: bool) -> str | None:
        """Why the mission is over; None while it is not.

        Args:
            now_s: now.
            more_to_come: whether tasks will yet be posted.
        """
        prospect, patience_s = self._outlook(more_to_come=more_to_come)
        if prospect is None:
            self._prospect = self._over_at_s = None
            return None
        grace_s = self._ignorant_until_s if prospect == ALL_ENDED else self._grace_until_s
        at_s = max(now_s + patience_s, grace_s)
        if prospect != self._prospect or self._over_at_s is None:
            self._prospect, self._over_at_s = prospect, at_s
        self._over_at_s = min(self._over_at_s, at_s)
        return prospect if self._over_at_s <= now_s else None

    @property
    def somebody_knows_more(self) -> bool:
        """Whether a UAV of the fleet that is there claims a task that is not known here."""
        replica, present = self._board.replica, self._membership.present
        fleet = () if replica.brief is None else (uav.id for uav in replica.brief.uavs)
        claimed = (replica.claims[u].task for u in fleet if u in present and u in replica.claims)
        return any(task is not None and task not in replica.board for task in claimed)

    def settle(self) -> None:
        """The mission has ended: nothing more to find out."""
        self._over_at_s = None

    def next_deadline_s(self) -> float | None:
        """When `reason` may find that it has waited long enough."""
        return self._over_at_s

    def _outlook(self, *, more_to_come: bool) -> tuple[str | None, float]:
        """How the mission will end if nothing changes, and how long that may yet change [s]."""
        claims, problem = self._board.replica.claims, self._board.problem
        fleet = () if problem is None else problem.uav_ids
        taking_part = {u for u in fleet if u in claims and claims[u].phase is not ClaimPhase.OUT}
        here = taking_part & self._membership.present
        if doable(self._board, here) or (more_to_come and here):
            paused = {uav for uav in here if claims[uav].phase is ClaimPhase.PAUSED}
            if doable(self._board, paused) or (more_to_come and paused):
                return None, 0.0  # the operator has stopped whom it may take: it is for them to say
            idle = all(claims[uav].phase is ClaimPhase.IDLE for uav in here - paused)
            # Every UAV may refuse a task for reasons of its own, such as a geofence.
            return (NOBODY_WILL if idle and not more_to_come else None), self._timing.stalemate_s
        if self.somebody_knows_more:
            return None, 0.0
        if TaskState.OPEN not in self._board.states.values() and not more_to_come:
            return ALL_ENDED, 0.0
        # Who was lost and never said that it is out may have been cut off, and come back.
        may_return = doable(self._board, taking_part) or (more_to_come and taking_part)
        return NOBODY_LEFT, self._timing.abandon_s if may_return else 0.0
