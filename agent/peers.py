"""What one agent makes of the others: whose claims count, and who may yet decide first.

Leaves out: what they said (swarm.state.registers) and what follows for the own task
(agent.tasking).
"""

from __future__ import annotations

from collections.abc import Collection

from swarm.config import Timing
from swarm.state.claims import winner
from swarm.state.membership import Membership
from swarm.state.registers import Replica
from swarm.wire.messages import Body, Claim, ClaimPhase, Epoch, Message, Outcome

__all__ = ["Peers"]


class Peers:
    """The others, as the agent of ``uav`` sees them."""

    def __init__(self, uav: str, timing: Timing) -> None:
        self.membership = Membership(timing)
        self._uav = uav
        self._patience_s = timing.patience_s
        self._idle_since_s: dict[str, float] = {}
        self._awake_since_s = 0.0
        self._lost: set[str] = set()

    @property
    def credible(self) -> Collection[str]:
        """Others whose claims count."""
        return self.membership.credible - {self._uav}

    def heard(self, message: Message, replica: Replica, now_s: float) -> bool:
        """Its writer itself has just said so; whether it is thereby there anew.

        One that says less than is known of it does not remember what an earlier life, or
        another process in its place, has said: it cannot answer for that yet.
        """
        anew = self.membership.heard(message.writer, now_s)
        if isinstance(message.body, Claim | Epoch):
            known = replica.known(message)
            if known is None or message.stamp >= known.stamp:
                self.membership.spoke(message.writer)
        return anew

    def back(self, writer: str) -> bool:
        """Whether ``writer`` was lost before; told once for each loss."""
        lost = writer in self._lost
        self._lost.discard(writer)
        return lost

    def lost(self, now_s: float) -> list[tuple[str, str]]:
        """Writers given up by now, each told once, and by what they were missed."""
        lost = self.membership.lost(now_s)
        if not lost:
            return []
        self._lost.update(lost)
        return [(w, "silent" if self.membership.mute(w) else "gone") for w in lost]

    def stated(self, writer: str, body: Body, now_s: float) -> None:
        """There is news of ``writer``: by an outcome or an idle claim it has become free."""
        idle = isinstance(body, Claim) and body.phase is ClaimPhase.IDLE
        if idle or isinstance(body, Outcome):
            self._idle_since_s[writer] = now_s

    def awake(self, now_s: float) -> None:
        """A task may have opened: from now on everyone who is free may decide anew."""
        self._awake_since_s = now_s

    def awaited(self, replica: Replica, now_s: float) -> set[str]:
        """Free others that may still be expected to decide in their turn."""
        credible = self.credible
        return {
            uav
            for uav, claim in replica.claims.items()
            if uav in credible
            and _is_free(uav, claim, replica)
            and now_s < self._patience_ends_s(uav)
        }

    def winner(self, replica: Replica, task: str) -> str | None:
        """Whose claim on ``task`` is the strongest that counts, the own among them."""
        claims = replica.claims.items()
        return winner(
            [
                (uav, claim)
                for uav, claim in claims
                if claim.task == task and (uav == self._uav or self.membership.is_credible(uav))
            ]
        )

    def patience_ends_s(self, replica: Replica, now_s: float) -> float | None:
        """When the first of those awaited will be awaited no longer; None if nobody is."""
        ends_s = [self._patience_ends_s(uav) for uav in self.awaited(replica, now_s)]
        return min(ends_s, default=None)

    def _patience_ends_s(self, uav: str) -> float:
        since_s = max(self._idle_since_s.get(uav, 0.0), self._awake_since_s)
        return since_s + self._patience_s


def _is_free(uav: str, claim: Claim, replica: Replica) -> bool:
    """Idle, or between the outcome of its task and the word of what it takes next."""
    if claim.task is None:
        return claim.phase is ClaimPhase.IDLE
    return (uav, claim.task) in replica.outcomes
