"""The coordinator at work: task board, membership, epochs; events in, actions out.

It learns before it says anything. Where a mission runs it takes charge of that; else it
publishes the mission, plans while the vehicles get ready, and starts it when all are airborne
(or given up). It releases pop-ups when their time comes, and ends the mission when nothing is
left that anybody could do, or the operator aborts it; where that is worth more it publishes
another epoch meanwhile. The fleet needs it for none of its own decisions. Leaves out: how plans
are made (coordinator.planner), and transport (coordinator.daemon).
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

from coordinator.core.events import (
    CoordinatorAction,
    CoordinatorEvent,
    PlanFailed,
    PlanMade,
    Replanned,
    StopPlanning,
    Withdraw,
)
from coordinator.core.leadership import (
    InheritedState,
    LeadershipStage,
    StateQuery,
    coordinator_messages,
    inherited_state,
    stage_of,
    without_incarnation,
    yields_to,
)
from coordinator.core.lifecycle import MissionEndCondition, StartDecision, StartGate
from coordinator.core.publication import (
    FlightLayers,
    RegisterAnnouncer,
    TaskReleaser,
    exit_status,
    mission_config_of,
    scenario_differences,
)
from coordinator.core.replanning import ReplanPolicy
from coordinator.planner.online import Situation
from swarm.model import Mission, Plan
from swarm.model.ids import COORDINATOR
from swarm.protocol.board import TaskBoard
from swarm.protocol.events import (
    Ask,
    Finish,
    KeysReplaced,
    LinkChanged,
    LogLine,
    MessageReceived,
    PeerGone,
    PeerSeen,
    Save,
    SnapshotsReceived,
    Stop,
)
from swarm.protocol.membership import Membership
from swarm.protocol.messages import (
    Body,
    Message,
    MissionPhase,
    PlanEpoch,
    Snapshot,
    StartWithout,
    TaskEdit,
)
from swarm.protocol.operator_commands import abort_command, describe_command
from swarm.protocol.register_writer import RegisterWriter
from swarm.protocol.registers import Replica, snapshot_without, without_signers
from swarm.protocol.timing import StallDetector, Timing
from swarm.protocol.uav_messages import Claim, ClaimPhase

__all__ = ["CoordinatorCore"]


class CoordinatorCore:
    """The coordinator of one mission.

    Args:
        mission: the scenario, pop-ups included.
        method: planning method, whose rule the agents then use.
        seed: of the planner.
        incarnation: greater than in any earlier life of this coordinator.
        timing: timers, in the seconds of ``now_s``.
        start_timeout_s: UAVs that are not airborne by then are given up [s].
        layers: heights of flight.
        memory: of an earlier life, its mission time brought to now; None if there is none.
        memory_age_s: how old that is [s].
    """

    def __init__(
        self,
        mission: Mission,
        *,
        method: str,
        seed: int,
        incarnation: int,
        timing: Timing,
        start_timeout_s: float,
        layers: FlightLayers,
        memory: Snapshot | None = None,
        memory_age_s: float = 0.0,
    ) -> None:
        self.replica = Replica()
        self.stood_down: str | None = None
        """Why it has left its seat to another coordinator; None as long as it has not."""
        self._mission = mission
        self._timing = timing
        self._layers = layers
        self._memory = memory
        self._memory_is_young = memory_age_s <= timing.recall_s
        self._membership = Membership(timing)
        self._board = TaskBoard(self.replica, mission.name)
        self._task_releaser = TaskReleaser(mission, self.replica)
        register_writer = RegisterWriter(mission.name, COORDINATOR, incarnation)
        self._announcer = RegisterAnnouncer(register_writer, self.replica, timing)
        self._start_gate = StartGate(
            mission, method, seed, self.replica, self._membership, start_timeout_s, timing
        )
        self._ending = MissionEndCondition(self._board, self._membership, timing)
        self._replan_policy = ReplanPolicy(method, seed, timing.replan_interval_s)
        self._state_query = StateQuery(timing.ask_gap_s, timing.silence_s)
        self._stall_detector = StallDetector(timing.pause_s)
        self._actions: list[CoordinatorAction] = []
        self._began_s = 0.0
        self._in_charge = False
        self._linked = True
        self._answers: list[Snapshot] = []
        self._overheard: list[Message] = []
        self._zero_s: float | None = None
        self._leave_at_s: float | None = None
        self._finished = False
        self._saved: object = None

    # -- the one entry point ----------------------------------------------------------

    def start(self, now_s: float) -> list[CoordinatorAction]:
        """Ask what there is to know."""
        self._began_s = now_s
        self._state_query.want(now_s, before_deciding=True)
        return self._conclude(now_s)

    def step(self, event: CoordinatorEvent, now_s: float) -> list[CoordinatorAction]:
        """React to one event.

        Args:
            event: what happened.
            now_s: now, on this process's own clock [s]; never decreases.
        """
        if self._finished:
            return []
        if self._stall_detector.late(now_s):
            self._membership.held_up(now_s)
            self._ending.wait_until(now_s + self._timing.relink_grace_s, was_away=True)
            self._state_query.want(now_s, before_deciding=True)
            self._actions.append(LogLine("was held up"))
        self._handle(event, now_s)
        if not self._finished:
            self._advance(now_s)
        return self._conclude(now_s)

    def next_deadline_s(self) -> float | None:
        """When `step` wants a `Tick` at the latest; None when it has finished."""
        if self._finished:
            return None
        deadlines = [self._state_query.next_deadline_s(), self._membership.next_deadline_s()]
        if not self._state_query.unsure:  # what it would do waits until it knows more
            deadlines += [
                self._announcer.next_deadline_s(),
                self._start_gate.next_deadline_s(),
                self._ending.next_deadline_s(),
                self._leave_at_s,
            ]
            if self._zero_s is not None and not self._ended:
                deadlines.append(self._task_releaser.next_deadline_s(self._zero_s))
                deadlines.append(self._replan_policy.next_deadline_s())
        return min((at_s for at_s in deadlines if at_s is not None), default=None)

    def snapshot(self, now_s: float) -> Snapshot:
        """What this process answers for: its own registers, and those of who cannot."""
        answers = self.replica.answers(COORDINATOR, self._membership.steady)
        return self._snapshot(tuple(answers), now_s)

    def memory(self, now_s: float) -> Snapshot:
        """All it knows, for its next life."""
        if not self._in_charge and self._memory is not None:
            return _aged(self._memory, now_s - self._began_s)
        return self._snapshot(tuple(self.replica.messages()), now_s)

    @property
    def plan(self) -> Plan | None:
        """The plan that the mission starts with."""
        return self._start_gate.plan

    def _snapshot(self, messages: tuple[Message, ...], now_s: float) -> Snapshot:
        mission_s = None if self._zero_s is None else now_s - self._zero_s
        incarnation = self._announcer.incarnation
        return Snapshot(self._mission.name, COORDINATOR, incarnation, mission_s, messages)

    # -- events -----------------------------------------------------------------------

    def _handle(self, event: CoordinatorEvent, now_s: float) -> None:
        match event:
            case MessageReceived(message) if message.writer == COORDINATOR:
                self._hear_another(message, now_s)
            case MessageReceived(message):
                if self._membership.heard(message.writer, now_s):
                    self._welcome(message.writer, now_s)
                news = self.replica.join(message)
                if isinstance(message.body, Claim):
                    self._membership.spoke(message.writer)
                    if self._in_charge and self._ending.somebody_knows_more:
                        self._state_query.want(now_s)
                elif news and isinstance(message.body, TaskEdit):
                    self._note_order(message.body)
                elif news and isinstance(message.body, StartWithout):
                    told: dict[str, object] = {"uav": message.body.uav}
                    told["reason"] = message.body.reason
                    self._actions.append(LogLine("the operator starts without it", told))
                if self._standing is LeadershipStage.BRIEFED and self._start_gate.is_forestalled:
                    self._state_query.want(now_s, before_deciding=True)
            case SnapshotsReceived(snapshots):
                self._learn(snapshots, now_s)
            case PeerSeen(writer) if writer != COORDINATOR:
                # What it has heard while one of us had no link has not come here.
                missed = self._membership.missing(writer)
                if self._membership.seen(writer, now_s) or missed:
                    self._welcome(writer, now_s)
            case PeerGone(writer):
                self._membership.gone(writer, now_s)
            case KeysReplaced(names):
                self._disown(names)
            case LinkChanged(up):
                self._membership.link(up, now_s)
                self._linked = up
                if up and self._state_query.ever:
                    self._ending.wait_until(now_s + self._timing.relink_grace_s, was_away=True)
                    self._state_query.want(now_s, before_deciding=True)
            case PlanMade(request, plan) if self._start_gate.expects(request):
                self._start_gate.plan = plan
            case PlanFailed(request, reason) if self._start_gate.expects(request):
                self._end(f"no plan: {reason}", now_s)
            case Replanned() as replanned:
                self._judge(replanned, now_s)
            case Withdraw(task) if (entry := self.replica.posted.get(task)) is not None:
                if not entry.withdrawn:
                    self._say(replace(entry, withdrawn=True))
            case Stop(reason, believed=False):  # the flight is another coordinator's to end
                self._finished = True
                self._actions += [
                    LogLine("leaves the mission to others", {"reason": reason}),
                    Finish(1),
                ]
            case Stop(reason):
                self._end(reason, now_s)
            case _:
                pass

    def _note_order(self, order: TaskEdit) -> None:
        if self.replica.ordered(order.task) is order:
            what = "task withdrawn by the operator" if order.withdrawn else "task by the operator"
            self._actions.append(LogLine(what, {"task": order.task, "reason": order.reason}))

    def _welcome(self, writer: str, now_s: float) -> None:
        """Somebody is there who was not: it may know more, even of a mission that runs."""
        if self._zero_s is None:
            if self._state_query.ever:  # else a question is under way
                self._state_query.want(now_s, before_deciding=True)
        elif writer in self.replica.writers():
            self._state_query.want(now_s)

    def _hear_another(self, message: Message, now_s: float) -> None:
        """Words from this seat that are not its own: another process is there, or has been.

        Their sender may be dead and its words long under way, so they alone decide nothing;
        until everyone has been asked, this one says nothing that might contradict.
        """
        self._overheard.append(message)
        if self._in_charge:
            self._state_query.want(now_s, before_deciding=True)

    # -- taking charge ------------------------------------------------------------------

    @property
    def _standing(self) -> LeadershipStage:
        if not self._in_charge:
            return LeadershipStage.LEARNING
        return LeadershipStage.BRIEFED if self.replica.epoch is None else LeadershipStage.STARTED

    def _learn(self, snapshots: Sequence[Snapshot], now_s: float) -> None:
        self._state_query.answered()
        mine = self._announcer.incarnation
        others = [snapshot for snapshot in snapshots if snapshot.writer == COORDINATOR]
        if any(yields_to(self._standing, mine, other) for other in others):
            came = "another coordinator has taken over"
            self._stand_down(came if self._in_charge else "a coordinator is already there")
        elif self._in_charge:
            self._take_in(snapshots, others, now_s)
        else:
            self._answers += snapshots
            if self._linked and not self._state_query.unsure:
                self._take_charge(now_s)
        self._membership.expect(self.replica.claims, now_s)

    def _stand_down(self, reason: str) -> None:
        self.stood_down, self._finished = reason, True
        self._actions += [LogLine("stands down", {"reason": reason}), Finish(1)]

    def _take_charge(self, now_s: float) -> None:
        """Resume the mission that is flown, or begin one."""
        memory = None if self._memory is None else _aged(self._memory, now_s - self._began_s)
        heard = [*self.replica.messages(), *self._overheard]
        inherited = inherited_state(
            self._answers, heard, memory, memory_is_young=self._memory_is_young
        )
        if memory is not None:
            self._announcer.observe(coordinator_messages(memory.messages))
        self._in_charge = True
        self._answers, self._overheard, self._memory = [], [], None
        self._adopt(inherited, now_s)
        if (abort := abort_command(self.replica)) is not None:
            self._actions.append(LogLine("this flight was aborted", {"reason": abort.reason}))
        if self.replica.brief is None:
            self._say(mission_config_of(self._mission, self._layers, self._announcer.incarnation))
        self._post(now_s)
        if self.replica.epoch is None:
            self._actions += self._start_gate.begin(now_s)

    def _take_in(
        self, snapshots: Sequence[Snapshot], others: Sequence[Snapshot], now_s: float
    ) -> None:
        """Add what has become known to the mission in charge of.

        Newer statements from this seat than the own ones are of a coordinator that is gone:
        they hold, unless it had only begun a mission that runs already. While one that has
        come as far lives they are not outdone, or the two would outbid each other for ever
        instead of one giving way.
        """
        mine, started = self._announcer.incarnation, self._zero_s is not None
        # Who has only begun a flight takes the brief of the one that runs for its own.
        inherited = inherited_state(snapshots if started else without_incarnation(snapshots, mine))
        theirs = coordinator_messages(inherited.replica.messages())
        newer = [m for m in theirs if m.stamp.incarnation > mine]
        equals = any(stage_of(other) is self._standing for other in others)
        if equals and (newer or any(m.stamp.incarnation > mine for m in self._overheard)):
            messages = inherited.replica.messages()
            self.replica.join_all(m for m in messages if m.writer != COORDINATOR)
            self._state_query.want(now_s, before_deciding=True)
            return
        newer_hold = any(isinstance(message.body, PlanEpoch) for message in newer)
        if newer_hold if started else inherited.runs:
            self._adopt(inherited, now_s)
        else:
            messages = inherited.replica.messages()
            self.replica.join_all(m for m in messages if m.writer != COORDINATOR)
        if self._announcer.observe([*theirs, *self._overheard]):
            self._actions += self._announcer.restate()
        self._overheard = []
        if started:
            older = [m for m in theirs if m.stamp.incarnation < mine]
            same = [s for s in others if stage_of(s) is LeadershipStage.STARTED]
            older += [m for s in same for m in coordinator_messages(s.messages)]
            for entry in self._task_releaser.merged(older):
                self._say(entry)
        if others:
            self._announcer.hurry(now_s)

    def _disown(self, names: Collection[str]) -> None:
        """Whoever has other keys from now on is not bound by what was said under the old ones."""
        self.replica.demote_revoked(names)
        self._overheard = without_signers(names, self._overheard)
        self._answers = [snapshot_without(names, answer) for answer in self._answers]
        if self._memory is not None:
            self._memory = snapshot_without(names, self._memory)

    def _adopt(self, inherited: InheritedState, now_s: float) -> None:
        """Make all that is known of the mission one's own, and say it in one's own name."""
        messages, epoch = list(inherited.replica.messages()), inherited.replica.epoch
        self.replica.join_all(m for m in messages if m.writer != COORDINATOR)
        theirs = coordinator_messages(messages)
        if not theirs:
            return
        if epoch is not None:
            known_s = epoch.mission_s if inherited.mission_s is None else inherited.mission_s
            self._zero_s = now_s - known_s if self._zero_s is None else self._zero_s
            self._leave_at_s = now_s + self._timing.linger_s if _ended(epoch) else None
            self._start_gate.leave()
            # Where no claim is known, nothing says how many may be flying out of sight.
            claims, timing = self.replica.claims, self._timing
            grace_s = timing.relink_grace_s if claims else timing.abandon_s
            self._ending.wait_until(now_s + grace_s)
            self._stop_planning()
            self._replan_policy.begin(None, {}, now_s)
            epoch = replace(epoch, mission_s=self._mission_s(now_s))
        self._announcer.observe(theirs)
        brief, own = inherited.replica.brief, self.replica.brief
        if brief is not None and own is not None and own.run != brief.run:
            # Before others take the one that it began for that of who is in charge.
            self._say(brief)
        bodies = [message.body for message in theirs if not isinstance(message.body, PlanEpoch)]
        self._actions += self._announcer.restate(bodies if epoch is None else [epoch, *bodies])
        self._actions.append(LogLine("resumes the mission", {"mission_s": self._mission_s(now_s)}))
        if changed := scenario_differences(self._mission, self._layers, self.replica):
            fields: dict[str, object] = {"differs_in": ", ".join(changed)}
            self._actions.append(LogLine("the mission is not that of the scenario file", fields))

    # -- phases ---------------------------------------------------------------------

    @property
    def _ended(self) -> bool:
        return self.replica.epoch is not None and _ended(self.replica.epoch)

    def _mission_s(self, now_s: float) -> float:
        """Mission time [s]; 0 as long as the mission has not begun."""
        return 0.0 if self._zero_s is None else now_s - self._zero_s

    def _advance(self, now_s: float) -> None:
        anybody_lost = False
        for writer in self._membership.lost(now_s):
            claim = self.replica.claims.get(writer)
            left = claim is not None and claim.phase is ClaimPhase.OUT
            self._actions.append(LogLine("left" if left else "lost", {"writer": writer}))
            anybody_lost |= not left
        if anybody_lost:
            self._state_query.want(now_s)  # others may have heard its last words
        if self._state_query.unsure or not self._in_charge:
            return
        abort = abort_command(self.replica)
        if abort is not None and not self._ended:
            self._end(describe_command(abort), now_s)
        if self._ended:
            self._leave_when_empty(now_s)
        else:
            if self._zero_s is None:
                self._start_if_ready(now_s)
            if self._zero_s is not None:
                self._post(now_s)
                self._end_if_over(now_s)
                self._replan(now_s)
        if not self._finished:
            self._actions += self._announcer.repeat(now_s, self._mission_s(now_s))

    def _start_if_ready(self, now_s: float) -> None:
        verdict, actions = self._start_gate.advance(now_s)
        self._actions += actions
        if verdict is StartDecision.START:
            self._zero_s = now_s
            self._say(self._start_gate.epoch(MissionPhase.RUNNING, self._start_gate.reason))
            self._replan_policy.begin(self._situation(now_s), self._start_gate.completion_s, now_s)
        elif verdict is StartDecision.NOBODY:
            self._end("no UAV is airborne", now_s)

    def _post(self, now_s: float) -> None:
        for entry in self._task_releaser.due(self._zero_s, now_s):
            self._say(entry)
            if self._zero_s is not None:
                self._actions.append(LogLine("pop-up posted", {"task": entry.task}))

    def _end_if_over(self, now_s: float) -> None:
        reason = self._ending.reason(now_s, more_to_come=self._task_releaser.more_to_come)
        if reason is not None:
            self._end(reason, now_s)

    def _situation(self, now_s: float) -> Situation | None:
        return Situation.of(self._board, self._membership.credible, self._mission_s(now_s))

    def _replan(self, now_s: float) -> None:
        epoch = self.replica.epoch
        if epoch is None or self._ended or self._replan_policy.is_quiet(now_s):
            return
        situation = self._situation(now_s)
        wanted = situation and self._replan_policy.wanted(situation, epoch, now_s)
        if wanted:
            self._actions += [wanted, LogLine("plans the rest", {"because": wanted.reason})]

    def _stop_planning(self) -> None:
        """What is being planned is for nothing, whatever it turns out to be."""
        if self._replan_policy.is_under_way:
            self._replan_policy.drop()
            self._actions.append(StopPlanning())

    def _judge(self, replanned: Replanned, now_s: float) -> None:
        epoch, situation = self.replica.epoch, self._situation(now_s)
        if self._state_query.unsure or epoch is None or situation is None or self._ended:
            self._replan_policy.drop()
            return
        better = self._replan_policy.judge(replanned, situation, epoch, now_s)
        if better is not None:
            self._say(better)
            self._actions.append(LogLine("another epoch", {"because": better.reason}))

    def _end(self, reason: str, now_s: float) -> None:
        if not self._in_charge:
            self._finished = True
            self._actions += [LogLine("ends before it began", {"reason": reason}), Finish(1)]
        elif not self._ended:
            self._start_gate.leave()
            self._stop_planning()
            self._ending.settle()
            self._say_next_epoch(now_s, MissionPhase.ENDED, reason)
            self._actions.append(LogLine("mission ends", {"reason": reason}))
            self._leave_at_s = now_s + self._timing.linger_s

    def _leave_when_empty(self, now_s: float) -> None:
        """Stay until all agents have left, so that each has heard of the end."""
        if self._leave_at_s is None or now_s < self._leave_at_s:
            return
        if self._membership.present:
            self._leave_at_s = now_s + self._timing.linger_s
            return
        self._finished, self._leave_at_s = True, None
        self._actions.append(Finish(exit_status(self._board, self._mission)))

    # -- saying -----------------------------------------------------------------------

    def _say(self, body: Body) -> None:
        self._actions.append(self._announcer.say(body))

    def _say_next_epoch(self, now_s: float, phase: MissionPhase, reason: str) -> None:
        """The epoch in force gives way to one that differs in phase."""
        last = self.replica.epoch
        if last is None:
            self._say(self._start_gate.epoch(phase, reason))
            return
        number, mission_s = last.number + 1, self._mission_s(now_s)
        epoch = replace(last, number=number, phase=phase, mission_s=mission_s, reason=reason[:200])
        self._say(epoch)

    def _conclude(self, now_s: float) -> list[CoordinatorAction]:
        """The actions of this step, with what is to ask and to keep."""
        if not self._finished and self._state_query.due(now_s):
            self._actions.append(Ask())
        epoch = self.replica.epoch
        commands = *self.replica.commands.values(), *self.replica.starts.values()
        state = self.replica.task_version, epoch and (epoch.number, epoch.phase), commands
        if self._in_charge and state != self._saved:
            self._saved = state
            self._actions.append(Save())
        self._stall_detector.expect_by(self.next_deadline_s())
        actions, self._actions = self._actions, []
        return actions


def _ended(epoch: PlanEpoch) -> bool:
    return epoch.phase is MissionPhase.ENDED


def _aged(memory: Snapshot, age_s: float) -> Snapshot:
    """``memory`` with the mission time of that much later."""
    if memory.mission_s is None:
        return memory
    return replace(memory, mission_s=memory.mission_s + age_s)
