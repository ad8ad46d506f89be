"""The space of priority sequences: which are equal to each other, and which are near.

Leaves out: what they are worth (`coordinator.planner.sequence`).
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from swarm.allocation.lower_level import TeamState
from swarm.allocation.problem import Problem

__all__ = ["Sequence", "disturbed", "has_plain_first_round", "neighbours", "twins"]

Sequence = tuple[int, ...]
"""UAV indices, first decider first."""


def has_plain_first_round(problem: Problem, state: TeamState, uavs: Sequence) -> bool:
    """Whether priority alone orders the first round: all are free at once, nobody twice."""
    if len({float(state.free_s[uav]) for uav in uavs}) > 1:
        return False
    for uav in uavs:
        tasks = state.open & problem.capable[uav]
        travel_s = problem.travel_s(uav, state.place_enu_m[uav])
        if ((travel_s + problem.service_s)[tasks] <= 0.0).any():
            return False
    return True


def twins(problem: Problem, state: TeamState, uavs: Sequence) -> dict[int, Sequence]:
    """For each UAV all that equal it in every respect, itself included, ascending."""
    classes: dict[bytes, list[int]] = {}
    for uav in uavs:
        traits = (
            state.free_s[uav],
            state.survived[uav],
            *state.place_enu_m[uav],
            problem.speed_m_s[uav],
            *problem.success[uav],
            *problem.survival[uav],
        )
        classes.setdefault(np.array(traits).tobytes(), []).append(uav)
    return {uav: tuple(twins) for twins in classes.values() for uav in twins}


def neighbours(sequence: Sequence, rng: np.random.Generator) -> Iterator[Sequence]:
    """Every swap of two UAVs and every insertion of one elsewhere, in random order."""
    n = len(sequence)
    for move in rng.permutation(n * n):
        low, high = divmod(int(move), n)
        changed = list(sequence)
        if low < high:
            changed[low], changed[high] = changed[high], changed[low]
        elif low > high:
            changed.insert(high, changed.pop(low))
        else:
            continue
        yield tuple(changed)
    for move in rng.permutation(n * n):
        low, high = divmod(int(move), n)
        if low + 1 < high:  # neighbours in the sequence have been swapped above
            changed = list(sequence)
            changed.insert(high, changed.pop(low))
            yield tuple(changed)


def disturbed(sequence: Sequence, rng: np.random.Generator) -> Sequence:
    """A sequence a few random swaps away."""
    changed = list(sequence)
    for _ in range(max(3, len(changed) // 8)):
        i, j = rng.integers(len(changed), size=2)
        changed[i], changed[j] = changed[j], changed[i]
    return tuple(changed)
