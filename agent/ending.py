"""When the mission is over for one UAV: by the operator's or coordinator's word, or without one.

An agent that the coordinator left flies on while there is anything to do, then goes
home by itself. Leaves out: how it goes home (agent.core).
"""

from __future__ import annotations

from agent.peers import Peers
from agent.picture import Picture
from swarm.config import Timing
from swarm.model.ids import COORDINATOR
from swarm.state.commands import aborted, words
from swarm.state.registers import Replica
from swarm.wire.messages import EpochPhase, StatusPhase

__all__ = ["Ending"]


class Ending:
    """The end of the mission, as one agent finds it has come.

    Args:
        replica: the shared registers.
        picture: the mission.
        peers: the others.
        timing: how long to stay without a coordinator.
    """

    def __init__(self, replica: Replica, picture: Picture, peers: Peers, timing: Timing) -> None:
        self._replica = replica
        self._picture = picture
        self._peers = peers
        self._timing = timing
        self._forsaken_at_s: float | None = None

    def reason(
        self, phase: StatusPhase, now_s: float, *, undecided: bool, refused: bool
    ) -> str | None:
        """Why to go home; None to go on.

        Args:
            phase: what the UAV is doing.
            now_s: now.
            undecided: whether, being idle, it may yet find a task.
            refused: whether it leaves an open task alone only because its vehicle refused that.
        """
        if (abort := aborted(self._replica)) is not None:
            return words(abort)
        epoch = self._replica.epoch
        if epoch is not None and epoch.phase is EpochPhase.ENDED:
            return epoch.reason
        if self._forsaken(phase, now_s, undecided=undecided, refused=refused):
            return "no coordinator and nothing left to do"
        return None

    def settle(self) -> None:
        """The UAV goes home: nothing more to find out."""
        self._forsaken_at_s = None

    def next_deadline_s(self) -> float | None:
        """When `reason` may find that it has waited long enough."""
        return self._forsaken_at_s

    def _forsaken(
        self, phase: StatusPhase, now_s: float, *, undecided: bool, refused: bool
    ) -> bool:
        """Whether there has been neither a coordinator nor anything to do for long enough."""
        if COORDINATOR in self._peers.membership.present:
            self._forsaken_at_s = None
            return False
        running = self._picture.running
        waiting = phase is StatusPhase.IDLE and not running
        if not (waiting or (running and self._nothing_to_do(phase, undecided=undecided))):
            self._forsaken_at_s = None
            return False
        at_s = now_s + self._patience_s(waiting=waiting, refused=refused)
        self._forsaken_at_s = (
            at_s if self._forsaken_at_s is None else min(self._forsaken_at_s, at_s)
        )
        return self._forsaken_at_s <= now_s

    def _patience_s(self, *, waiting: bool, refused: bool) -> float:
        """A coordinator would wait as long for a UAV to consider a refused task again."""
        if waiting:
            return self._timing.abandon_s
        return self._timing.stalemate_s if refused else self._timing.linger_s

    def _nothing_to_do(self, phase: StatusPhase, *, undecided: bool) -> bool:
        """Tasks may be open still: those that nobody who is there can or will take."""
        if not self._picture.unfinished:
            return True
        if phase is StatusPhase.IDLE:
            return not (undecided or self._peers_at_work())
        return phase is StatusPhase.OUT and not self._peers_at_work()

    def _peers_at_work(self) -> bool:
        credible = self._peers.credible
        return any(
            uav in credible and self._picture.is_open(claim.task)
            for uav, claim in self._replica.claims.items()
        )
