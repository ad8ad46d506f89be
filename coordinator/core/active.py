"""The coordinator at work: hears, asks, takes charge of its mission; events in, actions out.

It learns before it says anything. Where a mission runs it takes charge of that; else it publishes
the mission and leads it through its stages (coordinator.core.stages). The fleet needs it for none
of its own decisions. Whenever others may know more, it asks them before it decides anything
further.
"""

from __future__ import annotations

from collections.abc import Sequence

from coordinator.core.leadership import (
    InheritedState,
    LeadershipBid,
    LeadershipStage,
    Predecessors,
    StateQuery,
    coordinator_messages,
    reunion,
)
from coordinator.core.lifecycle import (
    CoordinatorAction,
    CoordinatorEvent,
    PlanFailed,
    PlanMade,
    Replanned,
    Withdraw,
)
from coordinator.core.publication import RegisterAnnouncer
from coordinator.core.stages import MissionStage, StagedMission
from swarm.model import Mission, Plan
from swarm.model.ids import COORDINATOR
from swarm.model.layers import FlightLayers
from swarm.protocol.codec import UNKNOWN_VERSION
from swarm.protocol.events import (
    Ask,
    KeysReplaced,
    LinkChanged,
    LogLine,
    MessageReceived,
    MessagesReceived,
    PeerGone,
    PeerSeen,
    Save,
    SnapshotsReceived,
    Stop,
)
from swarm.protocol.field_messages import UavReady, ZoneEdit
from swarm.protocol.membership import Membership
from swarm.protocol.messages import Message, Snapshot, StartWithout, TaskEdit
from swarm.protocol.operator_commands import anything_said, zone_edits
from swarm.protocol.registers import Replica
from swarm.protocol.timing import StallDetector, Timing, earliest, stretch_of
from swarm.protocol.uav_messages import Claim, ClaimPhase, Status, StatusPhase


class CoordinatorCore:
    """The coordinator of one mission.

    Args:
        incarnation: greater than in any earlier life of this coordinator.
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
        self._timing = timing
        self._membership = Membership(timing)
        # UAVs of large fleets repeat themselves the more seldom; their silence means as much less.
        self._membership.stretch(stretch_of(len(mission.uavs)))
        self._linked = True
        self._state_query = StateQuery(timing.ask_gap_s, timing.silence_s)
        self._predecessors = Predecessors(memory, memory_is_young=memory_age_s <= timing.recall_s)
        self._announcer = RegisterAnnouncer(mission, layers, incarnation, self.replica, timing)
        self._mission = StagedMission(
            mission,
            self.replica,
            self._membership,
            self._announcer,
            method=method,
            seed=seed,
            timing=timing,
            start_timeout_s=start_timeout_s,
        )
        self._stall_detector = StallDetector(timing.pause_s)
        self._too_old: set[str] = set()
        self._actions: list[CoordinatorAction] = []
        self._saved: object = None

    # -- the one entry point ----------------------------------------------------------

    def start(self, now_s: float) -> list[CoordinatorAction]:
        """Ask what there is to know."""
        self._predecessors.begin(now_s)
        self._state_query.want(now_s, before_deciding=True)
        return self._conclude(now_s)

    def step(self, event: CoordinatorEvent, now_s: float) -> list[CoordinatorAction]:
        """React to one event; ``now_s``, on this process's own clock, never decreases."""
        if self._mission.is_over:
            return []
        if self._stall_detector.late(now_s):
            self._membership.held_up(now_s)
            self._doubt_all(now_s)
            self._actions.append(LogLine("was held up"))
        waits = self._may_wait(event, now_s)
        self._handle(event, now_s)
        if not self._mission.is_over and not waits:
            self._give_up_lost(now_s)
            unsure = self._state_query.unsure
            self._actions += (self._mission.wait if unsure else self._mission.advance)(now_s)
        return self._conclude(now_s)

    def next_deadline_s(self) -> float | None:
        """When `step` wants a `Tick` at the latest; None when it has finished."""
        if self._mission.is_over:
            return None
        deadlines = [self._state_query.next_deadline_s(), self._membership.next_deadline_s()]
        deadlines += self._mission.deadlines_s(unsure=self._state_query.unsure)
        return earliest(*deadlines)

    def snapshot(self, now_s: float) -> Snapshot:
        """What this process answers for: its own registers, and those of who cannot."""
        answers = self.replica.answers(COORDINATOR, self._membership.steady)
        return self._announcer.snapshot(answers, now_s)

    def whole(self, now_s: float) -> Snapshot:
        """What it tells one who asks some for all they know."""
        return self._announcer.snapshot(self.replica.messages(), now_s)

    def memory(self, now_s: float) -> Snapshot:
        """All it knows, for its next life."""
        memory = self._predecessors.memory(now_s)
        return memory or self._announcer.snapshot(self.replica.messages(), now_s)

    @property
    def stage(self) -> MissionStage:
        """How far it has come with its mission."""
        return self._mission.stage

    @property
    def plan(self) -> Plan | None:
        """The plan that the mission starts with."""
        return self._mission.gate.plan

    # -- events -----------------------------------------------------------------------

    def _handle(self, event: CoordinatorEvent, now_s: float) -> None:
        match event:
            case MessageReceived() | MessagesReceived():
                for message in event.messages:
                    self._hear_any(message, now_s)
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
                # Who has other keys from now on is not bound by what was said under the old ones.
                self.replica.demote_revoked(names)
                self._predecessors.disown(names)
            case LinkChanged(up):
                self._membership.link(up, now_s)
                self._linked = up
                if up and self._state_query.ever:
                    self._doubt_all(now_s)
            case PlanMade(request, plan) if self._mission.gate.expects(request):
                self._mission.gate.plan = plan
            case PlanFailed(request, reason) if self._mission.gate.expects(request):
                self._actions += self._mission.end(f"no plan: {reason}", now_s)
            case Replanned() as replanned if self._state_query.unsure:
                self._mission.replan_policy.drop()
            case Replanned() as replanned:
                self._actions += self._mission.judge(replanned, now_s)
            case Withdraw(task):
                self._actions += self._announcer.withdraw(task)
            case Stop(reason, believed=False):  # the flight is another coordinator's to end
                self._actions += self._mission.leave("leaves the mission to others", reason, now_s)
            case Stop(reason):
                self._actions += self._mission.end(reason, now_s)
            case _:
                pass

    def _may_wait(self, event: CoordinatorEvent, now_s: float) -> bool:
        """Whether nothing is due, and UAVs that are there only say how they are.

        That changes nothing of the mission, and of a large fleet one says so each few milliseconds.
        """
        if not isinstance(event, MessageReceived | MessagesReceived):
            return False
        due_s, present = self.next_deadline_s(), self._membership.present
        return (due_s is None or due_s > now_s) and all(
            isinstance(said.body, Status) and said.writer in present for said in event.messages
        )

    def _hear_any(self, message: Message, now_s: float) -> None:
        if message.writer == COORDINATOR:
            self._overhear(message, now_s)
        else:
            self._hear(message, now_s)

    def _hear(self, message: Message, now_s: float) -> None:
        """Words of an agent, or of the operator."""
        if self._membership.heard(message.writer, now_s):
            self._welcome(message.writer, now_s)
        news, body = self.replica.join(message), message.body
        if isinstance(body, Claim):
            self._membership.spoke(message.writer)
            if self._mission.is_led and self._mission.end_condition.somebody_knows_more:
                self._state_query.want(now_s)
        elif news and isinstance(body, TaskEdit) and self.replica.ordered(body.task) is body:
            what = "task withdrawn by the operator" if body.withdrawn else "task by the operator"
            self._actions.append(LogLine(what, {"task": body.task, "reason": body.reason}))
        elif news and isinstance(body, StartWithout):
            told: dict[str, object] = {"uav": body.uav, "reason": body.reason}
            self._actions.append(LogLine("the operator starts without it", told))
        elif news and isinstance(body, ZoneEdit) and body in zone_edits(self.replica).values():
            what = "zone taken away by the operator" if body.withdrawn else "zone by the operator"
            self._actions.append(LogLine(what, {"zone": body.zone.id, "reason": body.reason}))
        elif news and isinstance(body, UavReady):
            told = {"uav": body.uav, "reason": body.reason}
            self._actions.append(LogLine("the operator lets it start again", told))
        elif isinstance(body, Status):
            self._refuse_older(message.writer, body)
        if self.stage is MissionStage.BRIEFED and self._mission.gate.is_forestalled:
            self._state_query.want(now_s, before_deciding=True)

    def _refuse_older(self, uav: str, status: Status) -> None:
        """Say once of an agent that it cannot read this mission's brief, and so takes no part."""
        waits = status.phase is StatusPhase.LEARNING and status.dropped.get(UNKNOWN_VERSION, 0) > 0
        if not waits or uav in self._too_old or not (asked := self._mission.asks_for):
            return
        self._too_old.add(uav)
        told: dict[str, object] = {"uav": uav, "asks_for": ", ".join(asked)}
        told["remedy"] = "install this release there, or start without it"
        self._actions.append(LogLine("its release is too old for this mission", told))

    def _overhear(self, message: Message, now_s: float) -> None:
        """Words from this seat that are not its own: another process is there, or has been.

        Their sender may be dead and its words long under way, so they alone decide nothing;
        until everyone has been asked, this one says nothing that might contradict.
        """
        self._predecessors.overheard.append(message)
        if self._mission.is_led:
            self._state_query.want(now_s, before_deciding=True)

    def _welcome(self, writer: str, now_s: float) -> None:
        """Somebody is there who was not: it may know more, even of a mission that runs."""
        if self._announcer.zero_s is None:
            if self._state_query.ever:  # else a question is under way
                self._state_query.want(now_s, before_deciding=True)
        elif writer in self.replica.writers():
            self._state_query.want(now_s)
        elif self.replica.brief is not None and writer in {u.id for u in self.replica.brief.uavs}:
            # Nothing is known of it: it has to have the time to say what it is about.
            self._mission.end_condition.wait_until(now_s + self._timing.relink_grace_s)

    def _give_up_lost(self, now_s: float) -> None:
        anybody_lost = False
        for writer in self._membership.lost(now_s):
            claim = self.replica.claims.get(writer)
            left = claim is not None and claim.phase is ClaimPhase.OUT
            self._actions.append(LogLine("left" if left else "lost", {"writer": writer}))
            anybody_lost |= not left
        if anybody_lost:
            self._state_query.want(now_s)  # others may have heard its last words

    def _doubt_all(self, now_s: float) -> None:
        """This process was away: much may have happened, and the others have to show themselves."""
        grace_s = now_s + self._timing.relink_grace_s
        self._mission.end_condition.wait_until(grace_s, was_away=True)
        self._state_query.want(now_s, before_deciding=True)

    # -- leading ------------------------------------------------------------------------

    @property
    def _bid(self) -> LeadershipBid:
        """What it has to say for leading, as others see it, too."""
        if not self._mission.is_led:
            seen = LeadershipStage.LEARNING
        elif self.stage is MissionStage.BRIEFED:
            seen = LeadershipStage.BRIEFED
        else:
            seen = LeadershipStage.STARTED
        return LeadershipBid(seen, self._announcer.incarnation)

    def _learn(self, snapshots: Sequence[Snapshot], now_s: float) -> None:
        self._state_query.answered()
        rivals = [answer for answer in snapshots if answer.writer == COORDINATOR]
        if any(self._bid.yields_to(LeadershipBid.of(rival)) for rival in rivals):
            came = "another coordinator has taken over"
            self.stood_down = came if self._mission.is_led else "a coordinator is already there"
            self._actions += self._mission.leave("stands down", self.stood_down, now_s)
        elif self._mission.is_led:
            self._take_in(snapshots, now_s)
        else:
            self._predecessors.answered(snapshots)
            if self._linked and not self._state_query.unsure:
                self._take_charge(now_s)
        self._membership.expect(self.replica.claims, now_s)

    def _take_charge(self, now_s: float) -> None:
        """Resume the mission that is flown, or begin one."""
        memory = self._predecessors.memory(now_s)
        inherited = self._predecessors.inherited(self.replica.messages(), now_s)
        if memory is not None:
            self._announcer.observe(coordinator_messages(memory.messages))
        self._predecessors.succeeded()
        self._join(inherited)
        self._adopt(inherited, now_s)
        self._actions += self._mission.brief(now_s)

    def _take_in(self, snapshots: Sequence[Snapshot], now_s: float) -> None:
        """Add what has become known to the mission in charge of."""
        overheard, runs = self._predecessors.overheard, self._announcer.zero_s is not None
        found = reunion(snapshots, overheard, self._bid, runs=runs)
        self._join(found.inherited)
        if found.is_open:
            self._state_query.want(now_s, before_deciding=True)
            return
        if (
            found.is_followed
            or self._comes_too_late(found.inherited)
            or self._forgets_words(found.inherited)
        ):
            self._adopt(found.inherited, now_s)
        if self._announcer.observe([*found.theirs, *overheard]):
            self._actions += self._announcer.restate()
        self._predecessors.succeeded()
        for entry in self._announcer.merged(found.posts):
            self._actions.append(self._announcer.say(entry))
        if any(snapshot.writer == COORDINATOR for snapshot in snapshots):
            self._announcer.hurry(now_s)

    def _comes_too_late(self, inherited: InheritedState) -> bool:
        """Whether it has begun a flight for a fleet that comes home from one that has ended.

        What UAVs have done in that one would forestall the other for ever.
        """
        begins = self.stage is MissionStage.BRIEFED
        return begins and inherited.has_ended and self._mission.gate.is_for_nobody

    def _forgets_words(self, inherited: InheritedState) -> bool:
        """Whether it has begun a flight though one was begun that the operator has spoken about.

        Nobody has answered its first question, then; no flight but that one has those words.
        """
        theirs, own = inherited.replica.brief, self.replica.brief
        begins = self.stage is MissionStage.BRIEFED and inherited.replica.epoch is None
        if not begins or theirs is None or own is None or theirs.run == own.run:
            return False
        return anything_said(self.replica, theirs.run) and not anything_said(self.replica, own.run)

    def _join(self, inherited: InheritedState) -> None:
        """Take in what all but coordinators have said: this one speaks for itself."""
        self.replica.join_all(m for m in inherited.replica.messages() if m.writer != COORDINATOR)

    def _adopt(self, inherited: InheritedState, now_s: float) -> None:
        """Make what coordinators have said one's own, and say it in one's own name."""
        if COORDINATOR not in inherited.replica.writers():
            return
        epoch = inherited.replica.epoch
        if epoch is not None:
            known_s = epoch.mission_s if inherited.mission_s is None else inherited.mission_s
            self._announcer.set_zero(now_s - known_s)
            self._actions += self._mission.go_on(epoch.phase, now_s)
        self._actions += self._announcer.resume(inherited.replica, now_s)

    # -- in the end of a step -------------------------------------------------------------

    def _conclude(self, now_s: float) -> list[CoordinatorAction]:
        """The actions of this step, with what is to ask and to keep."""
        present = len(self._membership.present)
        if not self._mission.is_over and self._state_query.due(now_s, present):
            self._actions.append(Ask())
        epoch = self.replica.epoch
        words = self.replica
        commands = *words.commands.values(), *words.starts.values(), *words.readies.values()
        state = self.replica.task_version, epoch and (epoch.number, epoch.phase), commands
        if self._mission.is_led and state != self._saved:
            self._saved = state
            self._actions.append(Save())
        self._stall_detector.expect_by(self.next_deadline_s())
        actions, self._actions = self._actions, []
        return actions
