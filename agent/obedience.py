"""What the operator has said to one UAV and is still to be obeyed: each command once.

Leaves out: what follows from it (agent.core), and which commands count for whom
(swarm.state.commands).
"""

from __future__ import annotations

from swarm.state.commands import in_force, newest
from swarm.state.registers import Replica
from swarm.wire.messages import Command, CommandKind

__all__ = ["Obedience"]


class Obedience:
    """The obedience of the agent of ``uav``.

    Args:
        uav: id of the UAV.
        replica: the shared registers.
        rejoin: the UAV takes part again, though an earlier life may have been sent home.
    """

    def __init__(self, uav: str, replica: Replica, *, rejoin: bool) -> None:
        self._uav = uav
        self._replica = replica
        self._rejoin = rejoin
        self._known: list[Command] = []
        """All of this flight when it was looked last. None of them is ever news again, though the
        order may turn round when a signer loses its keys: see `Replica.disown`."""

    def news(self, *, begins: bool) -> Command | None:
        """The newest command, if it has not been given before; an older one means nothing then.

        Args:
            begins: whether this life of the agent is yet to act; what it finds then was said to
                an earlier one.
        """
        found = newest(self._replica, self._uav)
        known, self._known = self._known, list(in_force(self._replica).values())
        if found is None or any(found[1] is each for each in known):
            return None
        _, command = found
        overruled = begins and self._rejoin and command.kind is CommandKind.RETURN
        return None if overruled else command
