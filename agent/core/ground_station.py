"""What follows for one UAV from the wishes of a ground station beside it, and what that is shown.

Who may command is the operator, by keys. A ground station that the agent was told to heed is a
person at the vehicle: it may stop this UAV, send it home and let it start from a base, and it may
take back its own hold. It undoes nothing that the operator has said: while his hold is the newest
word, the UAV neither goes on nor home for a ground station. Each wish is for a state, so that one
asked for twice is done once.

That a UAV was stopped in this way outlives its agent's process: the own claim says paused, and
nothing that the operator had said by then explains it.
"""

from __future__ import annotations

from agent.core.context import AgentContext, AgentPart
from agent.core.field_tasking import FieldTasking
from agent.core.states import HEADED_HOME, PAUSED_BY_OPERATOR, AgentState
from agent.core.station_words import (
    AnswerStation,
    ShowStations,
    StationAsked,
    StationVerdict,
    StationWish,
)
from agent.core.vehicle_commander import VehicleCommander
from swarm.protocol.board import TaskState
from swarm.protocol.messages import CommandKind
from swarm.protocol.operator_commands import newest_command
from swarm.protocol.registers import Replica
from swarm.protocol.uav_messages import ClaimPhase

HELD_BEFORE = "held at a ground station in an earlier life"

_DONE = StationVerdict.DONE, ""
_WORDS = {
    StationWish.HOLD: "held at a ground station",
    StationWish.RESUME: "told at a ground station to go on",
    StationWish.RETURN: "sent home at a ground station",
    StationWish.ABORT: "aborted at a ground station",
}


class GroundStation(AgentPart):
    """The ground stations of one UAV.

    Args:
        tasking: the UAV's tasks and bases.
        commander: stops the vehicle, and brings it home.
        shown: whether there is a ground station to be shown anything.
    """

    def __init__(
        self,
        context: AgentContext,
        tasking: FieldTasking,
        commander: VehicleCommander,
        *,
        shown: bool,
    ) -> None:
        super().__init__(context)
        self._tasking = tasking
        self._commander = commander
        self._shown = shown
        self._last: tuple[object, ...] | None = None
        """All that was shown last, or what it was worked out from."""

    def hear(self, asked: StationAsked, now_s: float) -> None:
        """Do what is asked for, or say why not."""
        verdict, reason = self._heed(asked.wish, now_s)
        wish = asked.wish.value
        self._log("told at a ground station", wish=wish, verdict=verdict.value, reason=reason)
        self._actions.append(AnswerStation(asked.number, verdict, reason))

    def show(self, now_s: float) -> None:
        """Show what the UAV does, if that has changed."""
        if not self._shown:
            return
        claim = self._replica.claims.get(self._uav)
        task = None if claim is None else claim.task
        ends_s = None if claim is None else claim.completion_s
        done = self._replica.task_version
        view = self._machine.phase, task, ends_s, self._announcer.note, done
        if view == self._last:
            return
        self._last = view
        mission_s = self._mission_view.clock.mission_s(now_s)
        eta_s = None
        if claim is not None and task is not None and mission_s is not None:
            eta_s = max(0.0, claim.completion_s - mission_s)
        states = self._mission_view.board.states
        self._actions.append(
            ShowStations(
                uav=self._uav,
                phase=self._machine.phase,
                task=task,
                task_number=0 if task not in states else 1 + sorted(states).index(task),
                note=self._announcer.note,
                n_done=sum(state is TaskState.DONE for state in states.values()),
                n_open=sum(state is TaskState.OPEN for state in states.values()),
                eta_s=eta_s,
            )
        )

    # -- what is asked for ----------------------------------------------------------------

    def _heed(self, wish: StationWish, now_s: float) -> tuple[StationVerdict, str]:
        state = self._machine.state
        if state is AgentState.SYNCING:
            return StationVerdict.NOT_NOW, "its agent is learning what the others know"
        if state is AgentState.OUT or self._machine.has_ended:
            note = self._announcer.note
            return StationVerdict.DENIED, f"its agent does not command it: {note}"
        match wish:
            case StationWish.HOLD:
                return self._hold(now_s)
            case StationWish.RESUME:
                return self._resume(now_s)
            case StationWish.RETURN | StationWish.ABORT:
                return self._go_home(wish, now_s)
            case StationWish.READY:
                return self._let_start()

    def _hold(self, now_s: float) -> tuple[StationVerdict, str]:
        if self._machine.state not in PAUSED_BY_OPERATOR:
            self._commander.hold(_WORDS[StationWish.HOLD], now_s)
        return _DONE

    def _resume(self, now_s: float) -> tuple[StationVerdict, str]:
        if self._is_held_by_operator:
            return StationVerdict.DENIED, "held by the operator, who alone lets it go on"
        if self._machine.state in PAUSED_BY_OPERATOR:
            self._commander.resume(_WORDS[StationWish.RESUME], now_s)
        elif self._flies_home:
            return StationVerdict.DENIED, "it flies home"
        return _DONE

    def _go_home(self, wish: StationWish, now_s: float) -> tuple[StationVerdict, str]:
        if self._is_held_by_operator:
            return StationVerdict.DENIED, "held by the operator, who alone sends it home"
        if not self._flies_home:
            self._commander.go_home(_WORDS[wish], now_s)
        return _DONE

    def _let_start(self) -> tuple[StationVerdict, str]:
        if self._machine.state in (AgentState.READY_ON_GROUND, AgentState.DEPARTING):
            return _DONE
        if self._tasking.visits.let_start():
            return _DONE
        return StationVerdict.NOT_NOW, "it does not stand at a base for another battery"

    @property
    def _flies_home(self) -> bool:
        return self._machine.state in HEADED_HOME - PAUSED_BY_OPERATOR

    @property
    def _is_held_by_operator(self) -> bool:
        newest = newest_command(self._replica, self._uav)
        is_hold = newest is not None and newest[1].kind is CommandKind.HOLD
        return is_hold and self._machine.state in PAUSED_BY_OPERATOR


def was_held(replica: Replica, uav: str, kept: Replica | None) -> bool:
    """Whether a ground station has stopped ``uav`` in an earlier life of its agent.

    Its claim says paused, and nothing of the operator explains it: he has said nothing at all, or
    his newest word is one that the earlier life had obeyed before it was stopped.

    Args:
        replica: what is known.
        uav: id of the UAV.
        kept: what the earlier life knew; None if it kept nothing that counts.
    """
    if not _is_paused(replica, uav):
        return False
    newest = newest_command(replica, uav)
    if newest is None:
        return True
    heeded = kept is not None and _is_paused(kept, uav) and newest_command(kept, uav) == newest
    return heeded and newest[1].kind is not CommandKind.HOLD


def _is_paused(replica: Replica, uav: str) -> bool:
    claim = replica.claims.get(uav)
    return claim is not None and claim.phase is ClaimPhase.PAUSED
