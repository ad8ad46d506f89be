"""Who keeps the coordinator's seat when two processes sit on it.

They meet when one was started beside the other, or after a partition in which the one
standing by took over. Both apply one rule to what they know of each other, so one gives
way. Leaves out: what the other does then (coordinator.core).
"""

from __future__ import annotations

from enum import IntEnum

from swarm.wire.messages import Epoch, Snapshot

__all__ = ["Standing", "gives_way", "standing_of"]


class Standing(IntEnum):
    """How far a coordinator has come with its mission."""

    LEARNING = 0
    """It has said nothing yet."""
    BRIEFED = 1
    STARTED = 2
    """It has announced that the mission runs, or has ended."""


def standing_of(answer: Snapshot) -> Standing:
    """How far the coordinator has come that answers so."""
    own = [m for m in answer.messages if m.writer == answer.writer]
    if answer.mission_s is not None or any(isinstance(m.body, Epoch) for m in own):
        return Standing.STARTED
    return Standing.BRIEFED if own else Standing.LEARNING


def gives_way(standing: Standing, incarnation: int, answer: Snapshot) -> bool:
    """Whether the coordinator of that standing and incarnation leaves its seat to the other.

    Who has started the mission keeps the seat, else who has briefed the fleet; among
    equals the higher incarnation, which all the fleet listens to. As long as neither has
    said anything, the one that came first may.

    Args:
        standing: how far it has come itself.
        incarnation: its own.
        answer: the other one's answer to a question, so the other one lives.
    """
    theirs = standing_of(answer)
    if standing is theirs is Standing.LEARNING:
        return answer.incarnation < incarnation
    return (theirs, answer.incarnation) > (standing, incarnation)
