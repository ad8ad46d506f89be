"""What takes a UAV away from its tasks: the operator, the mission's end, a lost bus.

Each of the operator's commands is obeyed once. An agent that the coordinator left flies on while
there is anything to do, then goes home by itself. Of the bus only the own link counts.
"""

from __future__ import annotations

from agent.core.context import AgentContext, AgentPart
from swarm.model.ids import COORDINATOR
from swarm.protocol.messages import CommandKind, MissionPhase, OperatorCommand
from swarm.protocol.operator_commands import (
    abort_command,
    describe_command,
    in_force,
    newest_command,
)
from swarm.protocol.registers import Replica
from swarm.protocol.uav_messages import Claim, ClaimPhase, StatusPhase


class EndCondition(AgentPart):
    """The end of the mission, as one agent finds it has come."""

    def __init__(self, context: AgentContext) -> None:
        super().__init__(context)
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
        if (abort := abort_command(self._replica)) is not None:
            return describe_command(abort)
        epoch = self._replica.epoch
        if epoch is not None and epoch.phase is MissionPhase.ENDED:
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
        running = self._mission_view.running
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
        if not self._mission_view.unfinished:
            return True
        if phase is StatusPhase.IDLE:
            return not (undecided or self._peers_at_work())
        return phase is StatusPhase.OUT and not self._peers_at_work()

    def _peers_at_work(self) -> bool:
        credible = self._peers.credible
        return any(
            uav in credible and (self._mission_view.is_open(claim.task) or _visits_base(claim))
            for uav, claim in self._replica.claims.items()
        )


def _visits_base(claim: Claim) -> bool:
    """Whether who claims so gets itself a full battery: it may do something with it."""
    return claim.base is not None and claim.phase in (ClaimPhase.PROPOSED, ClaimPhase.HELD)


class BusLossTimer:
    """The own link to the bus, as far as its loss is a reason to go home.

    Args:
        patience_s: how long it may be down; None for as long as it likes.
    """

    def __init__(self, patience_s: float | None) -> None:
        self.patience_s = patience_s
        self._too_long_at_s: float | None = None

    def link(self, up: bool, now_s: float) -> None:
        """The own link came up or went down."""
        if up or self.patience_s is None:
            self._too_long_at_s = None
        elif self._too_long_at_s is None:
            self._too_long_at_s = now_s + self.patience_s

    def too_long(self, now_s: float) -> bool:
        """Whether it has been down for that long; told once."""
        if self._too_long_at_s is None or now_s < self._too_long_at_s:
            return False
        self._too_long_at_s = None
        return True

    def next_deadline_s(self) -> float | None:
        """When it will have been down for too long."""
        return self._too_long_at_s


class OperatorCommands:
    """What the operator told the agent of ``uav``.

    Args:
        rejoin: the UAV takes part again, though an earlier life may have been sent home.
    """

    def __init__(self, uav: str, replica: Replica, *, rejoin: bool) -> None:
        self._uav = uav
        self._replica = replica
        self._rejoin = rejoin
        self._known: list[OperatorCommand] = []
        """All of this flight when it was looked last. None of them is ever news again, though the
        order may turn round when a signer loses its keys: see `Replica.demote_revoked`."""

    def news(self, *, begins: bool) -> OperatorCommand | None:
        """The newest command, if it has not been given before; an older one means nothing then.

        What a life finds as it ``begins``, before it has acted, was said to an earlier one.
        """
        found = newest_command(self._replica, self._uav)
        known, self._known = self._known, list(in_force(self._replica).values())
        if found is None or any(found[1] is each for each in known):
            return None
        _, command = found
        overruled = begins and self._rejoin and command.kind is CommandKind.RETURN
        return None if overruled else command
