"""An operator's word to UAVs: hold, resume, return, abort, or start without one.

What is to be said, and what has come of it.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from types import MappingProxyType
from typing import Generic, TypeVar

from coordinator.mission_view.mission_state import MissionState
from coordinator.mission_view.wording import listed
from swarm.model.ids import COORDINATOR, FLEET
from swarm.protocol.events import CommonEvent, SnapshotsReceived
from swarm.protocol.messages import (
    CommandKind,
    Message,
    MissionConfig,
    MissionPhase,
    OperatorCommand,
    Stamp,
    StartWithout,
)
from swarm.protocol.operator_commands import BEING_STOPPED, CANNOT_HOLD, abort_command, dispensable
from swarm.protocol.uav_messages import ClaimPhase, Status, StatusPhase


class RequestResult(Enum):
    """What has come of a command or an order."""

    OBEYED = "obeyed"
    NOT_OBEYED = "not obeyed"
    UNKNOWN_UAV = "no such UAV"
    UNKNOWN_TASK = "no such task"
    UNKNOWN_ZONE = "no such zone"
    TAKEN_ID = "that id is taken"
    UNKNOWN_MISSION = "nothing known of the mission"

    @property
    def is_wrong_input(self) -> bool:
        """Whether it was never said, as what was asked for does not fit the mission."""
        return self in (
            RequestResult.UNKNOWN_UAV,
            RequestResult.UNKNOWN_TASK,
            RequestResult.UNKNOWN_ZONE,
            RequestResult.TAKEN_ID,
        )


@dataclass(frozen=True, slots=True)
class RequestVerdict:
    """What has come of it, in words as well."""

    result: RequestResult
    text: str
    """One line; of wrong input what would be right."""

    @classmethod
    def good(cls, text: str) -> RequestVerdict:
        """It has taken effect."""
        return cls(RequestResult.OBEYED, text)

    @classmethod
    def bad(cls, text: str) -> RequestVerdict:
        """It was not seen to take effect, or cannot."""
        return cls(RequestResult.NOT_OBEYED, text)


Wish = TypeVar("Wish")
Statement = TypeVar("Statement")


class RequestHandler(ABC, Generic[Wish, Statement]):
    """One request: what to say for it, and what comes of it.

    Args:
        wish: what the operator wants.
        mission_state: of the mission.
        patience_s: how long to wait for the effect [s of ``now_s``].
    """

    asks = True
    """Whether everyone is to be asked for what has come of it."""

    def __init__(self, wish: Wish, mission_state: MissionState, patience_s: float) -> None:
        self.known_to: set[str] = set()
        """Who has confirmed that it knows what was said."""
        self.all_shown = False
        """Whether everyone who is there has had the time to show its token."""
        self._wish = wish
        self._mission_state = mission_state
        self._patience_s = patience_s
        self._stamp: Stamp | None = None
        """Of the statement that `known_to` is about."""

    @abstractmethod
    def body(self, brief: MissionConfig) -> Statement | RequestVerdict:
        """What to say; or why it cannot be said."""

    def apart(self, said: Message) -> Statement | None:
        """What to say instead, as somebody has said something else in the same place."""
        del said
        return None

    def heed(self, fact: CommonEvent, said: Message) -> None:
        """See who knows what was said, from a fact that the observer has taken note of."""
        if said.stamp != self._stamp:
            self._stamp = said.stamp
            self.known_to.clear()
        if isinstance(fact, SnapshotsReceived):
            for snapshot in fact.snapshots:
                if any(m.key == said.key and m.stamp >= said.stamp for m in snapshot.messages):
                    self.known_to.add(snapshot.writer)

    @abstractmethod
    def judge(self, said: Message, now_s: float, *, late: bool) -> RequestVerdict | None:
        """What has come of it by now; None as long as that is open, and it is not ``late``."""

    def next_deadline_s(self) -> float | None:
        """When `judge` may find something though nothing happens."""
        return None

    @property
    def task(self) -> str | None:
        """Id of the task that it is about, once there is one."""
        return None

    @property
    def told(self) -> dict[str, object]:
        """What a program is told of it."""
        return {}

    @property
    def _fleet(self) -> list[str]:
        brief = self._mission_state.replica.brief
        return [] if brief is None else [str(uav.id) for uav in brief.uavs]

    @property
    def _expected(self) -> set[str]:
        """Who is there and takes part, and so ought to know of what concerns everybody.

        A UAV that takes part and has not been seen may just not have shown its token yet. What
        they know a coordinator learns from them.
        """
        claims = self._mission_state.replica.claims.items()
        out = {uav for uav, claim in claims if claim.phase is ClaimPhase.OUT}
        taking_part = {*self._fleet} - out
        there = (taking_part | {COORDINATOR}) & self._mission_state.present
        return there if self.all_shown else taking_part | there

    @property
    def _is_over(self) -> bool:
        mission_state = self._mission_state
        return (
            mission_state.phase is MissionPhase.ENDED
            or abort_command(mission_state.replica) is not None
        )

    def _no_such_uav(self) -> RequestVerdict:
        return RequestVerdict(RequestResult.UNKNOWN_UAV, f"the fleet is {', '.join(self._fleet)}")


_ON_THE_WAY_HOME = (StatusPhase.RETURNING, StatusPhase.HOME)
_NOT_COMMANDED = "takes no part, and its vehicle is not commanded"


@dataclass(frozen=True, slots=True)
class CommandRequest:
    """Hold, resume or return one UAV, or abort the mission."""

    kind: CommandKind
    target: str = FLEET
    reason: str = ""

    def __str__(self) -> str:
        return self.kind.value if self.target == FLEET else f"{self.kind} {self.target}"


class CommandHandler(RequestHandler[CommandRequest, OperatorCommand]):
    """One command, and what comes of it."""

    asks = False
    """What a UAV says by itself tells whether it obeys."""
    _before: Mapping[str, Status] = MappingProxyType({})
    """Newest status of each UAV when the command was given."""

    def body(self, brief: MissionConfig) -> OperatorCommand | RequestVerdict:
        """What to say; or why it cannot be said."""
        wish = self._wish
        if wish.target != FLEET and not self.concerned:
            return self._no_such_uav()
        self._before = dict(self._mission_state.statuses)
        return OperatorCommand(wish.target, wish.kind, brief.run, wish.reason)

    def judge(self, said: Message, now_s: float, *, late: bool) -> RequestVerdict | None:
        """What has come of it by now; None as long as that is open, and it is not ``late``."""
        del now_s  # it is as good later
        stamp, command = self._mission_state.replica.commands[self._wish.target]
        if stamp != said.stamp:
            return RequestVerdict.bad(f"another operator has said {command.kind} meanwhile")
        found = {uav: self._effect(uav) for uav in self.concerned}
        if open_still := [uav for uav, effect in found.items() if effect is None]:
            return RequestVerdict.bad("; ".join(map(self._unseen, open_still))) if late else None
        effects = {uav: effect for uav, effect in found.items() if effect is not None}
        obeyed = all(effect.result is RequestResult.OBEYED for effect in effects.values())
        text = _in_short({uav: effect.text for uav, effect in effects.items()})
        return RequestVerdict.good(text) if obeyed else RequestVerdict.bad(text)

    @property
    def concerned(self) -> list[str]:
        """UAVs of the fleet that the command is to."""
        target = self._wish.target
        return self._fleet if target == FLEET else [uav for uav in self._fleet if uav == target]

    def _effect(self, uav: str) -> RequestVerdict | None:
        """What has come of it for ``uav``; None as long as that is open."""
        mission_state = self._mission_state
        status, claim = mission_state.statuses.get(uav), mission_state.replica.claims.get(uav)
        if uav not in mission_state.present:
            gone = claim is not None and claim.phase is ClaimPhase.OUT
            if self._wish.kind in (CommandKind.RETURN, CommandKind.ABORT) and gone:
                return RequestVerdict.good(f"{uav} has left the mission")
            if self._wish.kind is CommandKind.ABORT and claim is None:
                return RequestVerdict.good(f"nobody flies {uav}")
            return None
        if status is None or status is self._before.get(uav):
            return None
        if status.phase is StatusPhase.OUT:
            # The mission is over for it at any rate.
            verdict = (
                RequestVerdict.good if self._wish.kind is CommandKind.ABORT else RequestVerdict.bad
            )
            return verdict(f"{uav} {_NOT_COMMANDED}: {status.note}")
        return self._seen(uav, status)

    def _seen(self, uav: str, status: Status) -> RequestVerdict | None:
        """What a status tells that ``uav`` has said since."""
        phase, obeyed = status.phase, RequestVerdict.good(_told(uav, status))
        match self._wish.kind:
            case CommandKind.HOLD if phase is StatusPhase.HOLDING:
                if status.note.startswith(CANNOT_HOLD):
                    return RequestVerdict.bad(_told(uav, status))
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
                return RequestVerdict.bad(f"{_told(uav, status)}; it takes no further part")
            case CommandKind.RESUME:
                return obeyed

    def _unseen(self, uav: str) -> str:
        """Why nothing was seen to come of it."""
        status, waited = self._mission_state.statuses.get(uav), f"within {self._patience_s:g} s"
        if uav not in self._mission_state.present:
            return (
                f"nobody flies {uav}, or it is cut off; back again, it learns of it from those "
                "who know"
            )
        if status is None or status is self._before.get(uav):
            return f"{uav} has not been heard of {waited}"
        return f"{_told(uav, status)} still, {self._wish.kind} was not obeyed {waited}"


def _in_short(texts: Mapping[str, str]) -> str:
    """What came of it for each UAV; what is the same for several is said once."""
    same: dict[str, list[str]] = {}
    for uav, text in texts.items():
        same.setdefault(text.removeprefix(uav), []).append(uav)
    parts = []
    for told, uavs in same.items():
        each = f"{listed(uavs, 3)}: each{told}"
        parts.append(texts[uavs[0]] if len(uavs) == 1 else each)
    return "; ".join(parts)


def _told(uav: str, status: Status) -> str:
    task = "" if status.task is None else f" {status.task}"
    note = f": {status.note}" if status.note else ""
    return f"{uav} is {status.phase}{task}{note}"


@dataclass(frozen=True, slots=True)
class StartRequest:
    """Start the mission without one UAV."""

    target: str
    reason: str = ""

    def __str__(self) -> str:
        return f"start without {self.target}"


class StartHandler(RequestHandler[StartRequest, StartWithout]):
    """One such word, and what comes of it: the coordinator's own answer tells whether it knows."""

    def body(self, brief: MissionConfig) -> StartWithout | RequestVerdict:
        """What to say; or why it cannot be said."""
        uav, phase = self._wish.target, self._mission_state.phase
        if uav not in self._fleet:
            return self._no_such_uav()
        if phase is not MissionPhase.PREPARING:
            past = "has started already" if phase is MissionPhase.RUNNING else "has ended"
            return RequestVerdict.bad(f"the mission {past}: nobody waits for {uav}")
        return StartWithout(uav, brief.run, self._wish.reason)

    def judge(self, said: Message, now_s: float, *, late: bool) -> RequestVerdict | None:
        """What has come of it by now; None as long as that is open, and it is not ``late``."""
        del said, now_s  # whoever has said it since means the same
        mission_state, uav = self._mission_state, self._wish.target
        epoch = mission_state.replica.epoch
        if epoch is not None and epoch.phase is MissionPhase.RUNNING:
            how = "with" if uav in epoch.sequence else "without"
            return RequestVerdict.good(f"the mission has started {how} {uav}")
        if epoch is not None and epoch.phase is MissionPhase.ENDED:
            return RequestVerdict.bad(f"the mission has ended: {epoch.reason}")
        waits_for = self._waits_for
        if COORDINATOR in self.known_to and (late or waits_for):
            what = f"waits for {waits_for}" if waits_for else "starts as soon as it is planned"
            return RequestVerdict.good(f"without {uav}; the mission {what}")
        if not late:
            return None
        if COORDINATOR not in mission_state.present:
            text = "there is no coordinator that could start the mission"
        else:
            text = f"the coordinator has not confirmed it within {self._patience_s:g} s"
        return RequestVerdict.bad(text)

    @property
    def _waits_for(self) -> str:
        """What else the start waits for; empty if for nothing but its plan."""
        replica, present = self._mission_state.replica, self._mission_state.present
        phases = {u: c.phase for u, c in replica.claims.items() if u in present}
        settled = (ClaimPhase.IDLE, ClaimPhase.OUT, ClaimPhase.PAUSED)
        without = dispensable(replica)
        missing = [u for u in self._fleet if phases.get(u) not in settled and u not in without]
        if missing:
            return ", ".join(missing)
        nobody = ClaimPhase.IDLE not in phases.values()
        return "the first UAV that is airborne" if nobody else ""
