"""How choices, claims and numbers of a recorded mission are put into words.

Leaves out: what is told (coordinator.recording.event_log).
"""

from __future__ import annotations

from coordinator.mission_view.presentation import shown_s, shown_value
from swarm.protocol.board import claim_strength
from swarm.protocol.uav_messages import Choice, Claim, ClaimPhase

__all__ = [
    "choice_in_words",
    "contest_in_words",
    "lateness_in_words",
    "place_in_words",
    "seconds_in_words",
    "value_in_words",
]


_PUNCTUAL_S = 0.005
"""Smaller differences are none."""
_MOST_RIVALS = 3
"""Of the tasks that were not taken, so many are named."""
_ORDINALS = ("first", "second", "third")


def seconds_in_words(time_s: float) -> str:
    """A duration, or a moment of mission time."""
    return f"{shown_s(time_s)} s"


def value_in_words(value: float) -> str:
    """A value or a score."""
    return f"{value:g}" if value == round(value, 2) and abs(value) < 1000.0 else shown_value(value)


def place_in_words(position_enu_m: tuple[float, float, float]) -> str:
    """Where something is."""
    east_m, north_m, up_m = position_enu_m
    parts = [
        f"{abs(distance_m):.4g} m {name if distance_m >= 0.0 else opposite}"
        for distance_m, name, opposite in (
            (east_m, "east", "west"),
            (north_m, "north", "south"),
            (up_m, "up", "down"),
        )
        if abs(distance_m) >= 0.05
    ]
    return f"{', '.join(parts)} of the origin" if parts else "at the origin"


def lateness_in_words(late_s: float) -> str:
    """How the end of an attempt compares with what was predicted."""
    if abs(late_s) < _PUNCTUAL_S:
        return ", just when it had said"
    side = "later" if late_s > 0.0 else "sooner"
    return f", {seconds_in_words(abs(late_s))} {side} than it had said"


def choice_in_words(uav: str, choice: Choice) -> str:
    """Why ``uav`` took a task."""
    aside = "" if choice.left is None else f", turning aside from {choice.left}"
    rank = choice.rank + 1
    place = _ORDINALS[rank - 1] if rank <= len(_ORDINALS) else f"number {rank}"
    text = f"{uav} chose {choice.task}{aside} by the {choice.rule} rule of epoch {choice.epoch}, "
    text += f"{place} in the sequence: score {value_in_words(choice.score)}"
    others = [each for each in choice.candidates if each.task != choice.task]
    if others:
        named = [f"{each.task} ({value_in_words(each.score)})" for each in others[:_MOST_RIVALS]]
        more = "" if len(others) <= _MOST_RIVALS else " and others"
        text += f", against {', '.join(named)}{more}"
    elif choice.second_score is not None:
        text += f", against {value_in_words(choice.second_score)} for the next best"
    else:
        text += "; there was no other it could take"
    proof = "; Theorem 5 proves that it was the best for this UAV" if choice.certificate else ""
    return f"{text}{proof}."


def contest_in_words(winner: tuple[str, Claim], loser: tuple[str, Claim]) -> str:
    """Why the first of two claims on one task is the stronger; see swarm.protocol.board."""
    (uav, claim), (_, other) = winner, loser
    mine, theirs = claim_strength(*winner), claim_strength(*loser)
    place = next(place for place in range(4) if mine[place] != theirs[place])
    proposed = claim.phase is ClaimPhase.PROPOSED
    match place:
        case 0:
            why = "held beats proposed"
        case 1 if proposed:
            why = f"it had decided earlier ({_against(claim.decided_s, other.decided_s)})"
        case 1:
            why = f"it would be done sooner ({_against(claim.completion_s, other.completion_s)})"
        case 2:
            why = f"it ranks higher (number {claim.rank + 1} against {other.rank + 1})"
        case _:
            why = "its name comes first, all else being equal"
    return f"{uav} keeps it, as {why}."


def _against(mine_s: float, theirs_s: float) -> str:
    digits = 2
    while digits < 6 and round(mine_s, digits) == round(theirs_s, digits):
        digits += 1
    return f"{mine_s:.{digits}f} s against {theirs_s:.{digits}f} s"
