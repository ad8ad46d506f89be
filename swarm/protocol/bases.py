"""Who may land at a base: slots are held like tasks, by claims and without a referee.

A claim on a base is as strong as its arrival is early: of two that wait above it the one that
arrived first goes first, then rank, then id. Who stands on a slot keeps it, lost or not, until it
is heard to have left or the operator says that it is ready. Who is alive each process judges for
itself, and passes in.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Collection, Mapping

from swarm.protocol.uav_messages import BaseStage, Claim, ClaimPhase


def arrival_order(uav: str, claim: Claim) -> tuple[float, int, str]:
    """Sort key of claims on one base: the smallest goes first. Who tells no time goes last."""
    arrives_s = math.inf if claim.arrives_s is None else claim.arrives_s
    return arrives_s, claim.rank, uav


def holds_slot(claim: Claim) -> bool:
    """Whether who claims so stands on a slot of its base, or is about to touch down on one."""
    return claim.base is not None and claim.stage is BaseStage.LANDED


def wants_slot(claim: Claim) -> bool:
    """Whether who claims so stands beside the slots of its base with a battery that is used up.

    Who stands there with a full one tells no end of its sortie.
    """
    parked = claim.base is not None and claim.stage is BaseStage.PARKED
    return parked and claim.phase is ClaimPhase.HELD and claim.sortie_end_s is not None


def blocking(
    claims: Mapping[str, Claim], lost: Collection[str], ready: Collection[str] = ()
) -> dict[str, str]:
    """UAV id -> base, of the lost ones that still stand on its slot.

    Args:
        claims: by UAV, of all that are known.
        lost: UAVs no longer believed alive.
        ready: of them, those of which the operator has said so since they landed.
    """
    return {
        uav: claim.base
        for uav, claim in claims.items()
        if uav in lost and uav not in ready and claim.base is not None and holds_slot(claim)
    }


def may_land(
    uav: str,
    base: str,
    slots: int | None,
    claims: Mapping[str, Claim],
    blocking: Mapping[str, str],
    *,
    waited: bool,
    punctual: bool = False,
    swap_s: float = 0.0,
) -> bool:
    """Whether ``uav``, which is above ``base`` or beside its slots, may take one of them now.

    At once when its claim is held and everybody who claims the base finds a slot, or, if it has
    come when it said it would, everybody who is there or said that it would come earlier: their
    words are as old as its own, so all know the same order. Else when it has waited and fewer than
    there are slots stand there or wait in front of it. Who waits on the ground lets those in the
    air go first, as time costs it nothing, but not for ever: only who arrives within the time of a
    swap after it.

    Args:
        uav: who asks; its own claim is among ``claims``.
        base: where.
        slots: UAVs served there at a time; None: no limit.
        claims: its own and those of credible others.
        blocking: of the lost, see `blocking`; lost ones that were on their way block nothing.
        waited: whether it has said that it waits, an objection window ago or more.
        punctual: whether it has arrived when it has said since an objection window ago or more.
        swap_s: how long a swap takes there [s].
    """
    own = claims.get(uav)
    if slots is None:
        return True
    if own is None or own.base != base:
        return False
    there = {other: claim for other, claim in claims.items() if other != uav and claim.base == base}
    flying = {o: claim for o, claim in there.items() if claim.stage is not BaseStage.PARKED}
    stands = {other for other, where in blocking.items() if where == base and other != uav}
    place = arrival_order(uav, own)
    if own.stage is BaseStage.PARKED:
        ahead = {
            other
            for other, claim in there.items()
            if (wants_slot(claim) and arrival_order(other, claim) < place)
            or (other in flying and (holds_slot(claim) or not _lets_pass(claim, own, swap_s)))
        }
        return waited and len(stands | ahead) < slots
    overdue = {
        other
        for other, claim in there.items()
        if wants_slot(claim) and _lets_pass(own, claim, swap_s)
    }
    taken = stands | overdue
    held = own.phase is ClaimPhase.HELD
    if held and len(flying.keys() | taken) < slots:
        return True
    earlier = {other for other, claim in flying.items() if arrival_order(other, claim) < place}
    holding = {other for other, claim in flying.items() if holds_slot(claim)}
    if held and punctual and len(holding | earlier | taken) < slots:
        return True
    waiting = {other for other in earlier if flying[other].stage is BaseStage.WAITING}
    return waited and len(holding | waiting | taken) < slots


def lands_s(
    base: str,
    free: int,
    swap_s: float,
    claims: Mapping[str, Claim],
    arrives_s: float,
    now_s: float,
    land_s: float = 0.0,
) -> float:
    """When somebody who arrives at ``base`` then stands on a slot [s]; infinite where none is.

    Whoever is there, or said that it arrives no later, lands first, each as soon as it can: who is
    in the air waits there for its slot, and lands then.

    Args:
        base: where.
        free: slots on which nobody stands who is lost.
        swap_s: how long a swap takes there [s].
        claims: those of credible others.
        arrives_s: when it would stand there if a slot were free [s mission time].
        now_s: nobody leaves a slot before [s mission time].
        land_s: how long it takes from above the base to the ground; others are taken to be as
            quick [s].
    """
    if free <= 0:
        return math.inf
    here = [(uav, claim) for uav, claim in claims.items() if claim.base == base]
    left_s = [
        max(now_s, claim.completion_s if claim.departs_s is None else claim.departs_s)
        for _, claim in here
        if holds_slot(claim)
    ]
    slots_s = sorted(left_s)[-free:] + [now_s] * (free - len(left_s))
    heapq.heapify(slots_s)
    queue = [(*arrival_order(uav, claim), claim) for uav, claim in here if _queues(claim)]
    queue.sort(key=lambda each: each[:3])
    for comes_s, _, _, claim in queue:
        if comes_s <= arrives_s:
            down_s = 0.0 if wants_slot(claim) else land_s
            heapq.heapreplace(slots_s, max(slots_s[0] + down_s, comes_s) + swap_s)
    return max(slots_s[0] + land_s, arrives_s)


def _queues(claim: Claim) -> bool:
    """Whether who claims so is going to take a slot, and has none yet."""
    in_the_air = claim.stage in (BaseStage.APPROACHING, BaseStage.WAITING)
    return in_the_air or wants_slot(claim)


def _lets_pass(flying: Claim, parked: Claim, swap_s: float) -> bool:
    """Whether who is in the air comes so late that it lets who waits on the ground go first."""
    if flying.arrives_s is None or parked.arrives_s is None:
        return False
    return flying.arrives_s > parked.arrives_s + swap_s
