"""An operator's seat on the bus: it learns, gives one command, and watches what comes of it.

The command is stamped above every command that is known, and repeated until it was seen to
take effect; whoever is out of reach learns it later from those who have heard it. Leaves
out: the commands a person types (coordinator.operator.cli), and obeying (agent.core,
coordinator.core).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

from coordinator.status.onlooker import Onlooker
from swarm.config import Timing
from swarm.events import Ask, BusFact, Finish, Learned, Publish, Wish
from swarm.model.ids import FLEET, OPERATOR
from swarm.state.commands import BEING_STOPPED, CANNOT_HOLD
from swarm.state.voice import Voice
from swarm.wire.messages import (
    Brief,
    ClaimPhase,
    Command,
    CommandKind,
    Message,
    Status,
    StatusPhase,
)

__all__ = ["OperatorSeat", "Result", "Verdict"]

_ON_THE_WAY_HOME = (StatusPhase.RETURNING, StatusPhase.HOME)
_NOT_COMMANDED = "takes no part, and its vehicle is not commanded"


class Result(Enum):
    """What has come of a command."""

    OBEYED = "obeyed"
    NOT_OBEYED = "not obeyed"
    UNKNOWN_UAV = "no such UAV"
    UNKNOWN_MISSION = "nothing known of the mission"


@dataclass(frozen=True, slots=True)
class Verdict:
    """What has come of a command, in words as well."""

    result: Result
    text: str


class OperatorSeat:
    """A core that gives one command and sees what comes of it.

    Args:
        mission: mission name.
        target: id of a UAV, or the name that stands for the fleet.
        kind: of the command.
        reason: why, in the operator's words; may be empty.
        incarnation: wall time in milliseconds.
        timing: timers, in the seconds of ``now_s``.
        patience_s: how long to wait for the mission, and then for the effect [s of ``now_s``].
    """

    def __init__(
        self,
        mission: str,
        target: str,
        kind: CommandKind,
        reason: str,
        *,
        incarnation: int,
        timing: Timing,
        patience_s: float,
    ) -> None:
        self.verdict: Verdict | None = None
        """What has come of it; None as long as that is open."""
        self._onlooker = Onlooker(mission, timing, None)
        self._observer = self._onlooker.observer
        self._target = target
        self._kind = kind
        self._reason = reason
        self._voice = Voice(mission, OPERATOR, incarnation)
        self._announce_s = timing.announce_s
        self._ask_s = timing.ask_s
        self._patience_s = patience_s
        self._leave_at_s = math.inf
        self._again_at_s = math.inf
        """When to ask again; once the command is given, when to repeat it."""
        self._said: Message | None = None
        self._before: dict[str, Status] = {}
        """Newest status of each UAV when the command was given."""

    def start(self, now_s: float) -> list[Wish]:
        """Ask what there is to know."""
        self._leave_at_s, self._again_at_s = now_s + self._patience_s, now_s + self._ask_s
        return self._onlooker.start(now_s)

    def step(self, fact: BusFact, now_s: float) -> list[Wish]:
        """Take note of one fact."""
        if self.verdict is not None:
            return []
        wishes = self._onlooker.step(fact, now_s)
        brief, answered = self._observer.replica.brief, isinstance(fact, Learned) and fact.snapshots
        if self._said is None and brief is not None and answered:
            self._speak(brief, now_s)
        if self._again_at_s <= now_s:
            wishes.append(self._repeat(now_s))
        if self.verdict is None:
            self.verdict = self._judge(late=self._leave_at_s <= now_s)
        if self.verdict is not None:
            wishes.append(Finish(0 if self.verdict.result is Result.OBEYED else 1))
        return wishes

    def next_deadline_s(self) -> float | None:
        """When `step` wants a tick; None when it has finished."""
        if self.verdict is not None:
            return None
        looks_s = self._onlooker.next_deadline_s()
        own_s = min(self._leave_at_s, self._again_at_s)
        return own_s if looks_s is None else min(own_s, looks_s)

    @property
    def does(self) -> dict[str, str]:
        """What each UAV does that the command concerns: `StatusPhase`, or absent."""
        statuses, present = self._observer.statuses, self._observer.present
        return {
            uav: statuses[uav].phase.value if uav in present and uav in statuses else "absent"
            for uav in self._concerned
        }

    @property
    def _concerned(self) -> list[str]:
        brief = self._observer.replica.brief
        fleet = [] if brief is None else [str(uav.id) for uav in brief.uavs]
        return fleet if self._target == FLEET else [uav for uav in fleet if uav == self._target]

    def _repeat(self, now_s: float) -> Wish:
        """The command; before it is given, the question what is known, commands among it."""
        if self._said is None:
            self._again_at_s = now_s + self._ask_s
            return Ask()
        self._again_at_s = now_s + self._announce_s
        return Publish(self._said)

    def _speak(self, brief: Brief, now_s: float) -> None:
        if self._target != FLEET and not self._concerned:
            fleet = ", ".join(uav.id for uav in brief.uavs)
            self.verdict = Verdict(Result.UNKNOWN_UAV, f"the fleet is {fleet}")
            return
        replica = self._observer.replica
        for stamp, _ in replica.commands.values():
            self._voice.outdo(stamp)
        self._said = self._voice.say(Command(self._target, self._kind, brief.run, self._reason))
        replica.join(self._said)
        self._before = dict(self._observer.statuses)
        self._again_at_s, self._leave_at_s = now_s, now_s + self._patience_s

    # -- what comes of it -------------------------------------------------------------

    def _judge(self, *, late: bool) -> Verdict | None:
        """What has come of it by now; None as long as that is open, and it is not ``late``."""
        if self._said is None:
            return Verdict(Result.UNKNOWN_MISSION, self._onlooker.lack) if late else None
        stamp, command = self._observer.replica.commands[self._target]
        if stamp != self._said.stamp:
            text = f"another operator has said {command.kind} meanwhile"
            return Verdict(Result.NOT_OBEYED, text)
        found = [self._effect(uav) for uav in self._concerned]
        if any(effect is None for effect in found):
            if not late:
                return None
            open_still = zip(self._concerned, found, strict=True)
            texts = [self._unseen(uav) for uav, effect in open_still if effect is None]
            return Verdict(Result.NOT_OBEYED, "; ".join(texts))
        effects = [effect for effect in found if effect is not None]
        obeyed = all(effect.result is Result.OBEYED for effect in effects)
        text = "; ".join(effect.text for effect in effects)
        return Verdict(Result.OBEYED if obeyed else Result.NOT_OBEYED, text)

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


def _told(uav: str, status: Status) -> str:
    task = "" if status.task is None else f" {status.task}"
    note = f": {status.note}" if status.note else ""
    return f"{uav} is {status.phase}{task}{note}"
