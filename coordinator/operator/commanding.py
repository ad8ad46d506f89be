"""One command to a UAV or the fleet: what is to be said, and whether it is obeyed.

Leaves out: saying it (coordinator.operator.errands), and obeying (agent.core,
coordinator.core).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from coordinator.observer import Observer
from coordinator.operator.verdict import Result, Verdict
from swarm.events import BusFact
from swarm.model.ids import FLEET
from swarm.state.commands import BEING_STOPPED, CANNOT_HOLD
from swarm.wire.messages import (
    Brief,
    ClaimPhase,
    Command,
    CommandKind,
    Message,
    Status,
    StatusPhase,
)

__all__ = ["CommandWish", "Commanding"]

_ON_THE_WAY_HOME = (StatusPhase.RETURNING, StatusPhase.HOME)
_NOT_COMMANDED = "takes no part, and its vehicle is not commanded"


@dataclass(frozen=True, slots=True)
class CommandWish:
    """Hold, resume or return one UAV, or abort the mission."""

    kind: CommandKind
    target: str = FLEET
    """Id of a UAV, or the name that stands for the fleet."""
    reason: str = ""
    """Why, in the operator's words."""

    def __str__(self) -> str:
        return self.kind.value if self.target == FLEET else f"{self.kind} {self.target}"


class Commanding:
    """One command, and what comes of it.

    Args:
        wish: what the operator wants.
        observer: of the mission.
        patience_s: how long to wait for the effect [s of ``now_s``].
    """

    asks = False
    """What a UAV says by itself tells whether it obeys."""

    def __init__(self, wish: CommandWish, observer: Observer, patience_s: float) -> None:
        self._target, self._kind, self._reason = wish.target, wish.kind, wish.reason
        self._observer = observer
        self._patience_s = patience_s
        self._before: dict[str, Status] = {}
        """Newest status of each UAV when the command was given."""

    def body(self, brief: Brief) -> Command | Verdict:
        """What to say; or why it cannot be said."""
        if self._target != FLEET and not self.concerned:
            fleet = ", ".join(uav.id for uav in brief.uavs)
            return Verdict(Result.UNKNOWN_UAV, f"the fleet is {fleet}")
        self._before = dict(self._observer.statuses)
        return Command(self._target, self._kind, brief.run, self._reason)

    def heed(self, fact: BusFact, said: Message) -> None:
        """Nothing but what the observer makes of it counts."""

    def next_deadline_s(self) -> float | None:
        """Only news can change the judgement."""
        return None

    def judge(self, said: Message, now_s: float, *, late: bool) -> Verdict | None:
        """What has come of it by now; None as long as that is open, and it is not ``late``."""
        del now_s  # it is as good later
        stamp, command = self._observer.replica.commands[self._target]
        if stamp != said.stamp:
            text = f"another operator has said {command.kind} meanwhile"
            return Verdict(Result.NOT_OBEYED, text)
        found = [self._effect(uav) for uav in self.concerned]
        if any(effect is None for effect in found):
            if not late:
                return None
            open_still = zip(self.concerned, found, strict=True)
            texts = [self._unseen(uav) for uav, effect in open_still if effect is None]
            return Verdict(Result.NOT_OBEYED, "; ".join(texts))
        effects = [effect for effect in found if effect is not None]
        obeyed = all(effect.result is Result.OBEYED for effect in effects)
        text = _in_short({u: e.text for u, e in zip(self.concerned, effects, strict=True)})
        return Verdict(Result.OBEYED if obeyed else Result.NOT_OBEYED, text)

    @property
    def concerned(self) -> list[str]:
        """UAVs of the fleet that the command is to."""
        brief = self._observer.replica.brief
        fleet = [] if brief is None else [str(uav.id) for uav in brief.uavs]
        return fleet if self._target == FLEET else [uav for uav in fleet if uav == self._target]

    def _effect(self, uav: str) -> Verdict | None:
        """What has come of it for ``uav``; None as long as that is open."""
        observer = self._observer
        status, claim = observer.statuses.get(uav), observer.replica.claims.get(uav)
        if uav not in observer.present:
            gone = claim is not None and claim.phase is ClaimPhase.OUT
            if self._kind in (CommandKind.RETURN, CommandKind.ABORT) and gone:
                return Verdict(Result.OBEYED, f"{uav} has left the mission")
            if self._kind is CommandKind.ABORT and claim is None:
                return Verdict(Result.OBEYED, f"nobody flies {uav}")
            return None
        if status is None or status is self._before.get(uav):
            return None
        if status.phase is StatusPhase.OUT:
            # The mission is over for it at any rate.
            result = Result.OBEYED if self._kind is CommandKind.ABORT else Result.NOT_OBEYED
            return Verdict(result, f"{uav} {_NOT_COMMANDED}: {status.note}")
        return self._seen(uav, status)

    def _seen(self, uav: str, status: Status) -> Verdict | None:
        """What a status tells that ``uav`` has said since."""
        phase, obeyed = status.phase, Verdict(Result.OBEYED, _told(uav, status))
        match self._kind:
            case CommandKind.HOLD if phase is StatusPhase.HOLDING:
                if status.note.startswith(CANNOT_HOLD):
                    return Verdict(Result.NOT_OBEYED, _told(uav, status))
                return None if status.note.startswith(BEING_STOPPED) else obeyed
            case CommandKind.HOLD:
                return None
            case CommandKind.RETURN | CommandKind.ABORT:
                return obeyed if phase in _ON_THE_WAY_HOME else None
            case CommandKind.RESUME if phase in (StatusPhase.HOLDING, StatusPhase.LEARNING):
                return None
            case CommandKind.RESUME if phase in _ON_THE_WAY_HOME:
                before = self._before.get(uav)
                if before is not None and before.phase is StatusPhase.HOLDING:
                    return obeyed  # it had been stopped on its way
                return Verdict(Result.NOT_OBEYED, f"{_told(uav, status)}; it takes no further part")
            case CommandKind.RESUME:
                return obeyed

    def _unseen(self, uav: str) -> str:
        """Why nothing was seen to come of it."""
        status, waited = self._observer.statuses.get(uav), f"within {self._patience_s:g} s"
        if uav not in self._observer.present:
            return (
                f"nobody flies {uav}, or it is cut off; back again, it learns of it from those "
                "who know"
            )
        if status is None or status is self._before.get(uav):
            return f"{uav} has not been heard of {waited}"
        return f"{_told(uav, status)} still, {self._kind} was not obeyed {waited}"


def _in_short(texts: Mapping[str, str]) -> str:
    """What came of it for each UAV; what is the same for several is said once."""
    same: dict[str, list[str]] = {}
    for uav, text in texts.items():
        same.setdefault(text.removeprefix(uav), []).append(uav)
    parts = []
    for told, uavs in same.items():
        more = f" and {len(uavs) - 3} more" if len(uavs) > 3 else ""
        each = f"{', '.join(uavs[:3])}{more}: each{told}"
        parts.append(texts[uavs[0]] if len(uavs) == 1 else each)
    return "; ".join(parts)


def _told(uav: str, status: Status) -> str:
    task = "" if status.task is None else f" {status.task}"
    note = f": {status.note}" if status.note else ""
    return f"{uav} is {status.phase}{task}{note}"
