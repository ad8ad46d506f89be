"""The words of a mission: numbers, names, places, the operator's commands, choices and claims.

One way to say each thing, for the story, the terminal, the dashboard and explanations.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

from coordinator.mission_view.approaches import Approach
from coordinator.mission_view.predicted_conflicts import PredictedConflict
from swarm.model.ids import FLEET
from swarm.model.plan import LeftOut
from swarm.protocol.board import claim_strength
from swarm.protocol.calibration import FlightRates
from swarm.protocol.field_messages import ZoneEdit
from swarm.protocol.messages import CommandKind, OperatorCommand, TaskEdit, TaskEntry
from swarm.protocol.operator_commands import describe_command
from swarm.protocol.uav_messages import BaseStage, Choice, Claim, ClaimPhase

_PUNCTUAL_S = 0.005
"""Smaller differences are none."""
_MOST_RIVALS = 3
"""Of the tasks that were not taken, so many are named."""
_ORDINALS = ("first", "second", "third")


_ORDERED = {
    CommandKind.HOLD: "operator holds {}",
    CommandKind.RESUME: "operator lets {} go on",
    CommandKind.RETURN: "operator sends {} home",
    CommandKind.ABORT: "operator aborts the mission",
}


_EXACT_M = 0.05
"""A distance that is less off than this is told without saying so."""


def shown_s(time_s: float) -> str:
    """Seconds with as many digits as anyone reads."""
    if abs(time_s) < 9.995:
        return f"{time_s:.2f}"
    return f"{time_s:.1f}" if abs(time_s) < 999.95 else f"{time_s:.0f}"


def shown_value(value: float) -> str:
    """J with as many digits as anyone reads."""
    if abs(value) < 1000.0:
        return f"{value:.2f}"
    return f"{value:.1f}" if abs(value) < 10_000.0 else f"{value:.0f}"


def clean(text: str, *, ascii_only: bool = False) -> str:
    """``text`` on one line, without anything a terminal would obey."""
    line = "".join(sign if sign.isprintable() else "?" for sign in " ".join(text.split()))
    return line.encode("ascii", "replace").decode("ascii") if ascii_only else line


def short_names(names: Sequence[str]) -> list[str]:
    """What tells each name from the others: ``uav07`` of many is ``07``.

    The common beginning is cut off, but no number is cut in two.
    """
    if len(names) < 2:
        return list(names)
    first, last = min(names), max(names)
    shared = 0
    while shared < min(len(first), len(last)) and first[shared] == last[shared]:
        shared += 1
    while shared > 0 and first[shared - 1].isdigit():
        shared -= 1
    return [name[shared:].lstrip("-_.") or name for name in names]


def listed(names: Sequence[str], at_most: int | None = None) -> str:
    """Names one after the other; of more than ``at_most`` the first ones, and how many more."""
    shown = ", ".join(names if at_most is None else names[:at_most])
    more = 0 if at_most is None else len(names) - at_most
    return shown if more <= 0 else f"{shown} and {more} more"


def counted(many: int, noun: str) -> str:
    """``1 task``, ``3 tasks``."""
    return f"{many} {noun}" + ("" if many == 1 else "s")


def because(reason: str) -> str:
    """A reason after what it is the reason for; nothing where there is none."""
    return f": {reason}" if reason else ""


def order_in_words(command: OperatorCommand) -> str:
    """What the operator does by a command, and why."""
    return _ORDERED[command.kind].format(command.target) + because(command.reason)


def command_in_words(command: OperatorCommand) -> str:
    """What holds for whom since the operator's command, and why."""
    whom = "mission" if command.target == FLEET else command.target
    return f"{whom} {describe_command(command)}"


def zone_in_words(edit: ZoneEdit) -> str:
    """What the operator does to a zone, and why."""
    if edit.withdrawn:
        return f"operator takes zone {edit.zone.id} away{because(edit.reason)}"
    keeps = "keeps the fleet inside" if edit.zone.inclusive else "draws"
    return f"operator {keeps} zone {edit.zone.id}{because(edit.reason)}"


def zone_said(edit: ZoneEdit) -> str:
    """What holds of a zone since the operator's word, and why."""
    how = "taken away" if edit.withdrawn else "drawn"
    return f"zone {edit.zone.id} {how} by the operator{because(edit.reason)}"


LEFT_OUT_WORDS: Final = {
    LeftOut.NOBODY_CAN: "nobody can, not even as the only task",
    LeftOut.DUE: "not worth it, or nobody gets done by the due time",
    LeftOut.WINDOW: "nobody gets there before it closes",
    LeftOut.ENERGY: "nobody has the energy for it beside the rest",
}
"""Why a plan leaves a task out."""


def why_left_out(reason: str) -> str:
    """What a reason for which a task is left out means; of a later release it says itself."""
    return {known.value: words for known, words in LEFT_OUT_WORDS.items()}.get(reason, reason)


def left_out_in_words(left_out: Mapping[str, str], at_most: int | None = None) -> str:
    """Tasks that are left out, each with its reason; of more than ``at_most`` the first ones."""
    return listed([f"{task} ({why})" for task, why in left_out.items()], at_most)


_VISITED = {
    BaseStage.APPROACHING: "flies to base {} for another battery",
    BaseStage.WAITING: "waits above base {} for a free slot",
    BaseStage.LANDED: "has landed at base {}",
    BaseStage.PARKED: "is parked at base {}",
}


_TO_BASE = {
    "greedy": "its battery was enough for no task any more, and it is ready there before elsewhere"
}
"""By rule, why a UAV flies to a base."""
_TO_BASE_FIRST = "the best list that it found begins with a full battery"


def visit_in_words(claim: Claim, before: Claim | None) -> str | None:
    """What a UAV does at a base since ``before``; None if that has not changed."""
    if claim.base is None or claim.stage is None:
        return None
    if before is not None and (before.base, before.stage) == (claim.base, claim.stage):
        return None
    return _VISITED[claim.stage].format(claim.base)


def rates_in_words(rates: FlightRates) -> str:
    """How a UAV flies, by its parameters and as measured, beside what the mission says of it."""
    if rates.as_briefed:
        return "flies as planned again"
    parts = []
    if rates.acceleration_m_s2 is not None:
        parts.append(f"speeds up and brakes with {rates.acceleration_m_s2:.3g} m/s²")
    if rates.speed_m_s is not None:
        parts.append(f"flies at most {rates.speed_m_s:.3g} m/s")
    if rates.time_frac != 1.0:
        parts.append(f"takes {rates.time_frac:g} times as long as planned")
    if rates.drain_frac != 1.0:
        parts.append(f"drains its battery {rates.drain_frac:g} times as fast")
    return " and ".join(parts)


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


def shown_m(distance_m: float) -> str:
    """Metres between two UAVs, with as many digits as anyone reads."""
    return f"{distance_m:.2f}" if distance_m < 9.995 else f"{distance_m:.1f}"


def approach_in_words(near: Approach, *, told_at: bool = True) -> str:
    """How near two UAVs came to each other, where, and when unless that is said otherwise."""
    error = f" ± {shown_m(near.error_m)} m" if near.error_m >= _EXACT_M else ""
    apart = f"{' and '.join(near.uavs)} {shown_m(near.distance_m)} m{error} apart"
    if told_at:
        when = "before the start" if near.at_s is None else f"at {seconds_in_words(near.at_s)}"
        apart = f"{apart} {when}"
    one, other = near.places_enu_m
    up = " and ".join(f"{place[2]:.4g}" for place in near.places_enu_m)
    between = 0.5 * (one[0] + other[0]), 0.5 * (one[1] + other[1]), 0.0
    return f"{apart}, {place_in_words(between)}, {up} m up"


def conflict_in_words(conflict: PredictedConflict) -> str:
    """Who would soon come too near to whom."""
    apart = f"{' and '.join(conflict.uavs)} {shown_m(conflict.distance_m)} m"
    return f"{apart} in {conflict.in_s:.0f} s"


def lateness_in_words(late_s: float) -> str:
    """How the end of an attempt compares with what was predicted."""
    if abs(late_s) < _PUNCTUAL_S:
        return ", just when it had said"
    side = "later" if late_s > 0.0 else "sooner"
    return f", {seconds_in_words(abs(late_s))} {side} than it had said"


def goal_in_words(choice: Choice) -> str:
    """The task that a UAV took, or the base that it flies to."""
    return str(choice.task) if choice.base is None else f"base {choice.base}"


def visit_reason_in_words(choice: Choice) -> str | None:
    """Why it flies to a base; None if it took a task."""
    return None if choice.base is None else _TO_BASE.get(choice.rule, _TO_BASE_FIRST)


def choice_in_words(choice: Choice) -> str:
    """Why a UAV took a task, or flies to a base; follows where it goes."""
    rank = choice.rank + 1
    place = _ORDINALS[rank - 1] if rank <= len(_ORDINALS) else f"number {rank}"
    text = f" by the {choice.rule} rule of epoch {choice.epoch}, "
    text += f"{place} in the sequence: "
    if (why := visit_reason_in_words(choice)) is not None:
        return f"{text}{why}; ready there at {seconds_in_words(choice.completion_s)}"
    text += f"score {value_in_words(choice.score)}"
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
    return f"{text}{proof}"


def entry_in_words(entry: TaskEntry | TaskEdit) -> str:
    """What a task on the board is worth, where it is, and what it takes."""
    service = f", service {seconds_in_words(entry.service_s)}" if entry.service_s else ""
    kind = f", kind {entry.kind}" if entry.kind else ""
    where = place_in_words(entry.position_enu_m)
    if entry.path_enu_m:
        where = f"a line of {len(entry.path_enu_m)} points from {where}"
    limits = _limits_in_words(entry)
    return f"value {value_in_words(entry.value)}, {where}{service}{kind}{limits}"


def _limits_in_words(entry: TaskEntry | TaskEdit) -> str:
    """When a task may be done, and how high it is flown; empty if it does not say."""
    opens_s, closes_s, due_s = entry.opens_s, entry.closes_s, entry.due_s
    parts = [
        f", opens at {seconds_in_words(opens_s)}" if opens_s else "",
        "" if closes_s is None else f", closes at {seconds_in_words(closes_s)}",
        "" if due_s is None else f", due by {seconds_in_words(due_s)}",
        "" if entry.height_m is None else f", {entry.height_m:.4g} m high",
    ]
    return "".join(parts)


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
    return f"{uav} keeps it, as {why}"


def _against(mine_s: float, theirs_s: float) -> str:
    digits = 2
    while digits < 6 and round(mine_s, digits) == round(theirs_s, digits):
        digits += 1
    return f"{mine_s:.{digits}f} s against {theirs_s:.{digits}f} s"
