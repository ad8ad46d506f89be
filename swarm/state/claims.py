"""Who holds a task: one winner wherever the registers are equal.

Held beats proposed. Proposed against proposed: earlier decision, then rank, then
id. Held against held, which takes a partition: earlier predicted completion, then
rank, then id. Leaves out: who is alive, which each process judges for itself and
passes in by leaving the lost out.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from swarm.wire.messages import Claim, ClaimPhase

__all__ = ["claim_strength", "holders", "winner"]


def claim_strength(uav: str, claim: Claim) -> tuple[bool, float, int, str]:
    """Sort key of claims on one task: the smallest wins."""
    proposed = claim.phase is ClaimPhase.PROPOSED
    return (proposed, claim.decided_s if proposed else claim.completion_s, claim.rank, uav)


def winner(claims: Sequence[tuple[str, Claim]]) -> str | None:
    """The UAV that keeps the task all ``claims`` (UAV id, claim) name; None if there are none."""
    if len(claims) == 1:
        return claims[0][0]
    strongest = min(claims, key=lambda item: claim_strength(*item), default=None)
    return None if strongest is None else strongest[0]


def holders(claims: Mapping[str, Claim]) -> dict[str, str]:
    """Task id -> winning UAV id, for every task that any of ``claims`` names."""
    rivals: dict[str, list[tuple[str, Claim]]] = {}
    for uav, claim in claims.items():
        if claim.task is not None:
            rivals.setdefault(claim.task, []).append((uav, claim))
    found = {task: winner(items) for task, items in rivals.items()}
    return {task: uav for task, uav in found.items() if uav is not None}
