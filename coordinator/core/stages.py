"""The life of one mission under one coordinator, stage by stage, and when it is planned anew.

`TRANSITIONS` says where it may go from each stage, and `StagedMission` takes it there: it starts
the mission when the fleet is airborne or given up, releases pop-ups when their time comes, has the
rest planned anew where that is worth an epoch, ends the mission when nothing is left that anybody
could do or the operator aborts it, and leaves when everybody has left.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from enum import Enum
from types import MappingProxyType
from typing import Final

from coordinator.core.lifecycle import (
    CoordinatorAction,
    MissionEndCondition,
    Replan,
    Replanned,
    StartDecision,
    StartGate,
)
from coordinator.core.publication import RegisterAnnouncer, exit_status, last_epoch
from coordinator.core.replan_policy import ReplanPolicy
from coordinator.mission_view.wording import left_out_in_words
from coordinator.planner.online import Situation
from swarm.model import Mission
from swarm.protocol.board import TaskBoard
from swarm.protocol.events import Finish, LogLine
from swarm.protocol.membership import Membership
from swarm.protocol.messages import MissionPhase, PlanEpoch
from swarm.protocol.operator_commands import abort_command, describe_command
from swarm.protocol.registers import Replica
from swarm.protocol.timing import Timing

_TASKS_LOGGED = 8


class MissionStage(Enum):
    """How far one process has come with coordinating its mission."""

    LEARNING = "asks what there is to know, and says nothing"
    BRIEFED = "in charge: the fleet is briefed and gets airborne, its plan is made"
    RUNNING = "in charge: the first epoch is said, and mission time runs"
    ENDED = "in charge: the last epoch is said, and the agents leave"
    DONE = "everybody has left: the process ends"
    LEFT = "the mission is another coordinator's, or nobody's: the process ends"


TRANSITIONS: Final[Mapping[MissionStage, Mapping[MissionStage, str]]] = MappingProxyType(
    {
        MissionStage.LEARNING: {
            MissionStage.BRIEFED: "nobody knows of a mission that is on",
            MissionStage.RUNNING: "the mission is on",
            MissionStage.ENDED: "the mission has ended, and agents are still there",
            MissionStage.LEFT: "a coordinator is there, or the process is told to stop",
        },
        MissionStage.BRIEFED: {
            MissionStage.RUNNING: "everybody is airborne or given up, or the mission was on",
            MissionStage.ENDED: "nobody is airborne, there is no plan, or it was aborted",
            MissionStage.LEFT: "another coordinator leads, or led a fleet that is gone",
        },
        MissionStage.RUNNING: {
            MissionStage.RUNNING: "a coordinator that is gone has led it meanwhile",
            MissionStage.ENDED: "nothing is left to do, or it was aborted or ended elsewhere",
            MissionStage.LEFT: "another coordinator leads",
        },
        MissionStage.ENDED: {
            MissionStage.RUNNING: "a coordinator that is gone has gone on with it",
            MissionStage.ENDED: "a coordinator that is gone has ended it, too",
            MissionStage.DONE: "no agent is there any more",
            MissionStage.LEFT: "another coordinator leads",
        },
        MissionStage.DONE: {},
        MissionStage.LEFT: {},
    }
)
"""From each stage to which, and what for. A mission that has ended may turn out to be flown on:
the other side of a partition does not know that it has."""


class StagedMission:
    """One mission, from what is learned of it to the moment when everybody has left."""

    def __init__(
        self,
        mission: Mission,
        replica: Replica,
        membership: Membership,
        announcer: RegisterAnnouncer,
        *,
        method: str,
        seed: int,
        timing: Timing,
        start_timeout_s: float,
    ) -> None:
        self.stage = MissionStage.LEARNING
        self.gate = StartGate(mission, method, seed, replica, membership, start_timeout_s, timing)
        self.end_condition = MissionEndCondition(
            board := TaskBoard(replica, mission.name), membership, timing
        )
        self.replan_policy = ReplanPolicy(method, seed, timing.replan_interval_s)
        self._mission = mission
        self._replica = replica
        self._membership = membership
        self._announcer = announcer
        self._board = board
        self._timing = timing
        self._leave_at_s: float | None = None
        """When it leaves a mission that has ended, unless agents are there then."""
        self._forgets_at_s = math.inf
        """Until when it stays for agents that are there and have never claimed anything."""

    @property
    def asks_for(self) -> tuple[str, ...]:
        """What releases before this one cannot read of it, by the keys of a scenario file."""
        asked = self._mission.constraints
        return (*asked, "zone_margin_m") if self._mission.zone_margin_m else asked

    @property
    def is_over(self) -> bool:
        """Whether the process ends."""
        return self.stage in (MissionStage.DONE, MissionStage.LEFT)

    @property
    def is_led(self) -> bool:
        """Whether this coordinator is in charge of it, or was until everybody had left."""
        return self.stage not in (MissionStage.LEARNING, MissionStage.LEFT)

    def deadlines_s(self, *, unsure: bool = False) -> Iterator[float | None]:
        """All that is waited for in this stage, or while ``unsure`` of what others know."""
        if not unsure or self.stage is MissionStage.BRIEFED:
            yield self._announcer.next_deadline_s()
        if unsure:
            return
        match self.stage:
            case MissionStage.BRIEFED:
                yield self.gate.next_deadline_s()
            case MissionStage.RUNNING:
                yield self.end_condition.next_deadline_s()
                yield self._announcer.next_release_s()
                yield self.replan_policy.next_deadline_s()
            case MissionStage.ENDED:
                yield self._leave_at_s
            case _:
                pass

    def advance(self, now_s: float) -> list[CoordinatorAction]:
        """Do what is due in this stage, and in those that follow from it."""
        if not self.is_led:
            return []
        actions: list[CoordinatorAction] = []
        abort = abort_command(self._replica)
        if abort is not None:
            actions += self.end(describe_command(abort), now_s)
        if self.stage is MissionStage.ENDED:
            actions += self._leave_when_empty(now_s)
        if self.stage is MissionStage.BRIEFED:
            actions += self._start_if_ready(now_s)
        if self.stage is MissionStage.RUNNING:
            actions += self._announcer.post(now_s)
            more_to_come = self._announcer.more_to_come
            mission_s = self._announcer.mission_s(now_s)
            reason = self.end_condition.reason(now_s, mission_s, more_to_come=more_to_come)
            if reason is not None:
                actions += self.end(reason, now_s)
        epoch = self._replica.epoch
        if self.stage is MissionStage.RUNNING and epoch is not None:
            match self.replan_policy.pursue(lambda: self._situation(now_s), epoch, now_s):
                case Replan() as wanted:
                    actions += [wanted, LogLine("plans the rest", {"because": wanted.reason})]
                case PlanEpoch() as changed:
                    actions += self._say_epoch(changed)
                case None:
                    pass
        if not self.is_over:
            actions += self._announcer.repeat(now_s)
        return actions

    def wait(self, now_s: float) -> list[CoordinatorAction]:
        """Do what is due while it is unsure what others know, which is to decide nothing.

        Before the start, while a large fleet joins, it is so all along: then it says what it has
        said, or those who have joined would take it for lost.
        """
        return list(self._announcer.repeat(now_s)) if self.stage is MissionStage.BRIEFED else []

    def brief(self, now_s: float) -> list[CoordinatorAction]:
        """Say what there is to say before the fleet takes off, and plan for all of it.

        A mission that is on, or has ended, only gets what it lacks.
        """
        if self.stage is MissionStage.LEARNING:
            self._enter(MissionStage.BRIEFED, now_s)
        actions: list[CoordinatorAction] = []
        if (abort := abort_command(self._replica)) is not None:
            actions.append(LogLine("this flight was aborted", {"reason": abort.reason}))
        actions += [*self._announcer.brief(), *self._announcer.post(now_s)]
        if self.stage is MissionStage.BRIEFED:
            actions += self.gate.begin(now_s)
        return actions

    def go_on(self, phase: MissionPhase, now_s: float) -> list[CoordinatorAction]:
        """Take the mission on from others, who have come to ``phase`` with it."""
        ended = phase is MissionPhase.ENDED
        actions = self._enter(MissionStage.ENDED if ended else MissionStage.RUNNING, now_s)
        actions += self.replan_policy.stop()
        self.replan_policy.begin(None, {}, now_s)
        # Where no claim is known, nothing says how many may be flying out of sight.
        claims, timing = self._replica.claims, self._timing
        grace_s = timing.relink_grace_s if claims else timing.abandon_s
        self.end_condition.wait_until(now_s + grace_s)
        return actions

    def judge(self, replanned: Replanned, now_s: float) -> list[CoordinatorAction]:
        """A plan of the rest has been made: say it if it is better than going on, or what is left
        out without it.
        """
        epoch, situation = self._replica.epoch, None
        if self.stage is MissionStage.RUNNING:
            situation = self._situation(now_s)
        if epoch is None or situation is None:
            self.replan_policy.drop()
            return []
        following = self.replan_policy.judge(replanned, situation, epoch, now_s)
        return [] if following is None else self._say_epoch(following)

    def end(self, reason: str, now_s: float) -> list[CoordinatorAction]:
        """The mission is over, unless it is already."""
        if self.stage is MissionStage.LEARNING:
            return self.leave("ends before it began", reason, now_s)
        if self.stage not in (MissionStage.BRIEFED, MissionStage.RUNNING):
            return []
        actions = self._enter(MissionStage.ENDED, now_s)
        if (epoch := self._replica.epoch) is None:
            last = self.gate.epoch(MissionPhase.ENDED, reason)
        else:
            last = last_epoch(epoch, self._announcer.mission_s(now_s), reason)
        return [*actions, self._announcer.say(last), LogLine("mission ends", {"reason": reason})]

    def leave(self, how: str, reason: str, now_s: float) -> list[CoordinatorAction]:
        """Leave the mission to others, or to nobody."""
        actions = self._enter(MissionStage.LEFT, now_s)
        return [*actions, LogLine(how, {"reason": reason}), Finish(1)]

    # -- pieces -----------------------------------------------------------------------

    def _enter(self, stage: MissionStage, now_s: float) -> list[CoordinatorAction]:
        """Go on to ``stage``; what is to do for that.

        Raises:
            ValueError: `TRANSITIONS` know no such way.
        """
        if stage not in TRANSITIONS[self.stage]:
            raise ValueError(f"a mission does not get from {self.stage.name} to {stage.name}")
        self.stage = stage
        if stage in (MissionStage.RUNNING, MissionStage.ENDED):
            self.gate.leave()
        if stage is not MissionStage.ENDED:
            return []
        self.end_condition.settle()
        self._leave_at_s = now_s + self._timing.linger_s
        self._forgets_at_s = now_s + self._timing.abandon_s
        return self.replan_policy.stop()

    def _say_epoch(self, epoch: PlanEpoch) -> list[CoordinatorAction]:
        """Say another epoch, or the one in force with what it leaves out by now."""
        before, said = self._replica.epoch, self._announcer.say(epoch)
        if before is None or before.number != epoch.number:
            return [said, LogLine("another epoch", {"because": epoch.reason})]
        tasks = left_out_in_words(epoch.why_left_out, _TASKS_LOGGED)
        return [said, LogLine("leaves out other tasks", {"tasks": tasks or "none"})]

    def _start_if_ready(self, now_s: float) -> list[CoordinatorAction]:
        verdict, actions = self.gate.advance(now_s)
        if verdict is StartDecision.NOBODY:
            return [*actions, *self.end("no UAV is airborne", now_s)]
        if verdict is StartDecision.OVER:
            # Nothing is said: of who was only cut off the mission is another's.
            why = "the fleet was at work already, and has gone without a word of its mission"
            return [*actions, *self.leave("leaves the mission to others", why, now_s)]
        if verdict is StartDecision.WAIT:
            return actions
        actions += self._enter(MissionStage.RUNNING, now_s)
        self._announcer.set_zero(now_s)
        actions.append(self._announcer.say(self.gate.epoch(MissionPhase.RUNNING, self.gate.reason)))
        situation = self._situation(now_s)
        if situation is not None:  # the plan was made by what was known before
            situation = replace(situation, rates=tuple(sorted(self.gate.rates.items())))
        self.replan_policy.begin(situation, self.gate.completion_s, now_s)
        return actions

    def _leave_when_empty(self, now_s: float) -> list[CoordinatorAction]:
        """Stay until all agents have left, so that each has heard of the end.

        One that has never said what it claims is not missed when it hangs.
        """
        if self._leave_at_s is None or now_s < self._leave_at_s:
            return []
        present, claims = self._membership.present, self._replica.claims
        awaited = present if now_s < self._forgets_at_s else present & claims.keys()
        if awaited:
            self._leave_at_s = now_s + self._timing.linger_s
            return []
        actions = self._enter(MissionStage.DONE, now_s)
        return [*actions, Finish(exit_status(self._board, self._mission))]

    def _situation(self, now_s: float) -> Situation | None:
        present = self._membership.credible
        return Situation.of(self._board, present, self._announcer.mission_s(now_s))
