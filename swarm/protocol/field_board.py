"""What the registers say of a mission in the field: places, batteries, slots, what can be done.

Leaves out: what follows for one UAV's decision (agent.core.field_decision).
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

from swarm.allocation.field import FieldProblem, FieldState
from swarm.protocol.board import TaskBoard
from swarm.protocol.uav_messages import Claim


def field_state(
    problem: FieldProblem,
    board: TaskBoard,
    claims: Mapping[str, Claim],
    *,
    sequence: Sequence[str] = (),
    blocking: Mapping[str, str] | None = None,
) -> FieldState:
    """Where everybody stands, once they have ended what ``claims`` say.

    Args:
        problem: of this board.
        board: the registers; outcomes say where a UAV was last, and what it survived.
        claims: by UAV, those that count: their tasks are not open, and their UAVs are free at
            their completion. Of others it is read what battery they have and where they stand.
        sequence: UAV ids, best rank first; others follow by id.
        blocking: UAV -> base, lost ones that stand on a slot for good.

    Returns:
        A state in which all are active but the ``blocking``; who takes part is the caller's
        judgement. Who approaches a base is free when it says that it will be ready.
    """
    raise NotImplementedError


def doable_in_field(
    problem: FieldProblem, board: TaskBoard, present: Collection[str], mission_s: float
) -> list[str]:
    """Open tasks that somebody claims or could still do as its only one, in board order.

    From its registered state, with as many swaps as that takes and every slot free.

    Args:
        problem: of this board.
        board: the registers.
        present: the writers believed alive; the lost take no part.
        mission_s: now [s mission time]: nobody departs before.
    """
    raise NotImplementedError
