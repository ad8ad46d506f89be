"""Whether a mission is over and nobody is there any more: there is nothing left to look on at.

Leaves out: what an onlooker does then (coordinator.status, coordinator.dashboard and
coordinator.view).
"""

from __future__ import annotations

from coordinator.observer import Observer
from swarm.state.commands import aborted
from swarm.wire.messages import EpochPhase, StatusPhase

__all__ = ["deserted"]

_ENDS = (StatusPhase.HOME, StatusPhase.OUT)
"""Where an agent's part ends."""


def deserted(observer: Observer) -> bool:
    """Whether the mission is over and nobody is there any more, as far as is known.

    A mission without a coordinator is over when no task is left, or it was aborted. While the
    own link is down nobody is seen leaving: who was home then needs no watching, as when the
    bus ends with the mission.
    """
    if observer.replica.brief is None:
        return False
    done = observer.phase is EpochPhase.RUNNING and not observer.board.unfinished
    if not (done or observer.phase is EpochPhase.ENDED or aborted(observer.replica) is not None):
        return False
    there = observer.present
    if observer.cut_since_s is not None:
        there = {
            uav
            for uav, status in observer.statuses.items()
            if uav in there and status.phase not in _ENDS
        }
    return not there
