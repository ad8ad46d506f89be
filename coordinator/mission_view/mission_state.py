"""The state of one mission as somebody who listens to the bus knows it.

Everything that is shown, recorded or measured of a running mission is read from here. Its parts:
registers and board (swarm.protocol), the mission and what came of it (`FlownMission`), what the
agents report (`FleetReports`), mission time (`PacedClock`), and the story (`MissionNarrator`).
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import replace
from itertools import chain
from typing import TYPE_CHECKING

from coordinator.mission_view.approaches import Approach, ObservedApproaches
from coordinator.mission_view.fleet_reports import FleetReports
from coordinator.mission_view.flown_mission import FlownMission
from coordinator.mission_view.narrator import MissionNarrator
from coordinator.mission_view.observed_flights import ObservedFlights
from coordinator.mission_view.observed_limits import ObservedLimits
from coordinator.mission_view.pace import PacedClock
from coordinator.mission_view.predicted_conflicts import ConflictForecast, PredictedConflict
from coordinator.mission_view.results import MissionResult
from coordinator.mission_view.story import EventKind, MissionEvent
from swarm.model import Mission, Plan, UavId
from swarm.model.ids import COORDINATOR
from swarm.model.plan import Schedule
from swarm.protocol.board import TaskBoard, TaskState, holders
from swarm.protocol.calibration import flight_rates
from swarm.protocol.events import (
    Ask,
    CommonAction,
    CommonEvent,
    KeysReplaced,
    LinkChanged,
    MessageReceived,
    PeerGone,
    PeerSeen,
    SnapshotsReceived,
)
from swarm.protocol.field_messages import ZoneEdit
from swarm.protocol.membership import Membership
from swarm.protocol.messages import (
    REVOKED_INCARNATION,
    Body,
    Message,
    MissionConfig,
    MissionPhase,
    PlanEpoch,
    Snapshot,
    TaskEdit,
)
from swarm.protocol.operator_commands import zones_in_force
from swarm.protocol.registers import Replica
from swarm.protocol.sync import MOST_OPEN, QuestionTimer
from swarm.protocol.timing import StallDetector, Timing, earliest, stretch_of
from swarm.protocol.uav_messages import AttemptResult, Choice, Claim, ClaimPhase, Outcome, Status

if TYPE_CHECKING:
    from coordinator.mission_view.ways import FleetWays, UavWays

FEW_S = 5.0
FEW_STATUSES = 10
"""Of a UAV that told nothing for that long, or the time of so many statuses, nobody knows where it
flew meanwhile [s of mission]."""
EPOCHS_KEPT = 16
"""Epochs that an observer tells from new ones; one is restated soon after it was stated, or not."""


class MissionState:
    """The state of one mission, as one observer knows it.

    Args:
        timing: timers, in the seconds of ``now_s``.
        explains: tell of everything why, for an explanation of a recording.
        near_m: remember every time that two UAVs came as near as this to each other [m].
    """

    def __init__(
        self,
        mission: Mission,
        timing: Timing,
        *,
        explains: bool = False,
        near_m: float | None = None,
    ) -> None:
        self.plan: Plan | None = None
        """The offline plan, once somebody who knows it has told; see `take_plan`."""
        self.replica = Replica()
        self.board = TaskBoard(self.replica, mission.name)
        self.present: set[str] = set()
        """Writers believed to be there."""
        self.lost: list[UavId] = []
        """UAVs that disappeared while they took part, and are not back."""
        self.cut_since_s: float | None = None
        """When the own link to the bus went down [s of ``now_s``]; None while it is up."""
        self._timing = timing
        self.flights = ObservedFlights(
            ObservedApproaches(max(FEW_S, FEW_STATUSES * timing.status_s), near_m)
        )
        """Where UAVs went, as far as they have told."""
        self.limits = ObservedLimits()
        """How near they came to zones and to the end of their batteries, likewise."""
        self._ways: FleetWays | None = None
        self._forecast = ConflictForecast()
        self._flown = FlownMission(mission, self.board)
        self._reports = FleetReports(self.replica)
        self.statuses = self._reports.statuses
        """Newest status by UAV id."""
        self.heard_s = self._reports.heard_s
        """When each writer last said something itself [s of ``now_s``]."""
        self.choices = self._reports.choices
        """Why UAVs took tasks, as far as it is remembered."""
        self._membership = Membership(timing)
        self._clock = PacedClock()
        self._narrator = MissionNarrator(
            mission, self.board, self._membership, self._clock, explains=explains
        )
        self._epochs: deque[tuple[object, ...]] = deque(maxlen=EPOCHS_KEPT)
        """The last ones in which the mission ran."""
        self._epochs_heard = 0
        self._end_heard = False
        self._repeated_visits = 0
        self._coordinator: int | None = None
        """Incarnation of the one that spoke last."""
        self._coordinator_missed = False
        self._missed: set[str] = set()
        self._stall_detector = StallDetector(timing.pause_s)
        self._asking = QuestionTimer(timing.ask_gap_s, MOST_OPEN)
        self._ask_at_s = 0.0

    def take_plan(self, plan: Plan) -> None:
        """The coordinator has planned. What it plans on the way is in the epochs.

        The word of the first plan may come after the word that the mission runs: one comes from
        the coordinator's output, the other over the bus.
        """
        if self.plan is None or self.phase is MissionPhase.PREPARING:
            self.plan = plan

    def start(self, now_s: float) -> list[CommonAction]:
        """Ask what has happened so far."""
        self._asking.want(now_s)
        return self._ask(now_s)

    def step(self, fact: CommonEvent, now_s: float) -> list[CommonAction]:
        """Take note of one fact."""
        ask = self._stall_detector.late(now_s)
        if ask:
            self._membership.held_up(now_s)
        match fact:
            case MessageReceived(message):
                self._reports.hear_from(message.writer, now_s)
                if self._membership.heard(message.writer, now_s):
                    ask |= self._welcome_back(message.writer, now_s)
                if message.writer == COORDINATOR:
                    self._hear_coordinator(message, now_s)
                self.take_note(message, now_s, fact.arrived_s)
                ask |= self._names_unknown(message.body)
            case SnapshotsReceived(snapshots):
                self._asking.answered()
                self._learn(snapshots, now_s)
            case PeerSeen(writer):
                # What it said while one of us had no link has not come here.
                ask |= self._membership.missing(writer)
                if self._membership.seen(writer, now_s):
                    ask |= self._welcome_back(writer, now_s) or self._is_newcomer(writer)
            case PeerGone(writer):
                self._membership.gone(writer, now_s)
            case KeysReplaced(names):
                self._disown(names, now_s)
            case LinkChanged(up):
                self._membership.link(up, now_s)
                if up or self.cut_since_s is None:
                    self.cut_since_s = None if up else now_s
                ask |= up
            case _:
                pass
        for writer in self._membership.lost(now_s):
            ask |= self._lose(writer, now_s)
        self.present = self._membership.present
        if ask or (self.replica.brief is None and self._ask_at_s <= now_s):
            self._asking.want(now_s)
        wishes = self._ask(now_s)
        self._stall_detector.expect_by(self.next_deadline_s())
        return wishes

    def _learn(self, snapshots: Collection[Snapshot], now_s: float) -> None:
        """Take in what others knew; of what was before this process came, in its order."""
        self._narrator.joining, told = self.replica.brief is None, self.told
        for snapshot in snapshots:
            is_word = snapshot.writer == COORDINATOR or not self._clock.is_set
            if is_word and snapshot.mission_s is not None:
                self._clock.hear(snapshot.mission_s, now_s)
            for message in snapshot.messages:
                self.take_note(message, now_s)
        if self._narrator.joining:
            self._narrator.story.order_since(told)
            self._narrator.joining = False
        self._membership.expect(self.replica.claims, now_s)

    # -- what is known ------------------------------------------------------------------

    @property
    def mission(self) -> Mission:
        """What is being flown, as far as it is known."""
        return self._flown.mission

    def revise(self, mission: Callable[[], Mission]) -> None:
        """The mission was unknown, or the board has changed: take what ``mission`` gives.

        It is called when somebody next wants to know, as boards are told entry by entry.
        """
        self._flown.revise(mission)

    @property
    def dropped(self) -> dict[str, Counter[str]]:
        """What each UAV's agents have dropped in all their lives, by reason."""
        return self._reports.dropped

    @property
    def pace(self) -> float:
        """Mission seconds per second of ``now_s``; see `keep_time`."""
        return self._clock.pace

    def next_deadline_s(self) -> float | None:
        """When `step` wants a tick."""
        return earliest(
            self._membership.next_deadline_s(),
            self._asking.next_deadline_s(),
            self._ask_at_s if self.replica.brief is None and not self._asking.is_full else None,
        )

    def mission_s(self, now_s: float) -> float | None:
        """Mission time; None before the start."""
        return self._clock.mission_s(now_s)

    def keep_time(self, now_s: float, mission_s: float, pace: float) -> None:
        """Follow a mission whose time runs at ``pace`` (> 0) seconds per own second."""
        self._clock.set(mission_s, now_s, pace)

    def silent_s(self, uav: str, now_s: float) -> float | None:
        """How long one that is there has said nothing, once that is half of what gives it up [s].

        While the own link is down nothing is heard of anybody, which says nothing of them.
        """
        heard_s = self.heard_s.get(uav)
        if heard_s is None or uav not in self.present or self.cut_since_s is not None:
            return None
        silent_s = now_s - heard_s
        return silent_s if silent_s >= self._timing.silence_s / 2.0 else None

    @property
    def phase(self) -> MissionPhase:
        """How far the mission is."""
        epoch = self.replica.epoch
        return MissionPhase.PREPARING if epoch is None else epoch.phase

    @property
    def holders(self) -> dict[str, str]:
        """Task id -> UAV id that is on its way to it or serves it."""
        claims = {u: c for u, c in self.replica.claims.items() if u in self.present}
        states = self.board.states
        return {t: u for t, u in holders(claims).items() if states.get(t) is TaskState.OPEN}

    @property
    def left_out(self) -> dict[str, str]:
        """Open tasks that the plan in force leaves out and that nobody has taken, each with why."""
        epoch, plan = self.replica.epoch, self.plan
        if epoch is not None:
            why = epoch.why_left_out
        else:
            why = {} if plan is None else {str(t): w.value for t, w in plan.left_out.items()}
        if not why:
            return {}
        states, taken = self.board.states, self.holders
        return {
            task: reason
            for task, reason in why.items()
            if states.get(task, TaskState.OPEN) is TaskState.OPEN and task not in taken
        }

    @property
    def nearest(self) -> Approach | None:
        """The nearest that two UAVs in flight have come to each other, as far as they told."""
        return self.flights.approaches.nearest

    def nearest_now(self, now_s: float) -> Approach | None:
        """The two in flight that are nearest to each other now."""
        return self.flights.approaches.nearest_now(self.mission_s(now_s), now_s)

    def conflicts(self, now_s: float) -> tuple[PredictedConflict, ...]:
        """Who would soon come too near to whom, the soonest first."""
        mission_s = self.mission_s(now_s)
        flying = self.flights.approaches.flying(mission_s, now_s)
        return self._forecast.conflicts(
            self.replica, flying, now_s if mission_s is None else mission_s
        )

    def executed_schedule(self) -> Schedule:
        """Every UAV's list as it has flown it, as far as it is known."""
        return self.flights.executed_schedule(self.mission, self.board.field_problem)

    def result(self) -> MissionResult:
        """What has been executed so far."""
        flown = self._flown.result(
            repeated_visits=self._repeated_visits, lost=self.lost, epochs=self._epochs_heard
        )
        return replace(flown, rates=flight_rates(self.replica))

    # -- the story ----------------------------------------------------------------------

    @property
    def story(self) -> list[MissionEvent]:
        """The newest lines; where older ones are gone, the first tells how many."""
        return self._narrator.story.lines

    def ways(self, now_s: float) -> Mapping[str, UavWays]:
        """By UAV id, the ways of a fleet in the field; none of a plain mission."""
        if self.board.field_problem is None:
            return {}
        if self._ways is None:
            # Plain missions never load it.
            from coordinator.mission_view.ways import FleetWays

            self._ways = FleetWays(self.board, self.flights)
        return self._ways.of(self.present, max(0.0, self.mission_s(now_s) or 0.0))

    @property
    def told(self) -> int:
        """How many lines the story has had so far."""
        return self._narrator.story.told

    def told_since(self, told: int) -> list[MissionEvent]:
        """The lines after the first ``told`` ever, as far as they are remembered."""
        return self._narrator.story.since(told)

    def tell(self, text: str, now_s: float) -> None:
        """Add to the story what happened now."""
        self._narrator.tell(EventKind.NOTE, text, now_s)

    # -- what was said ------------------------------------------------------------------

    def take_note(self, message: Message, now_s: float, arrived_s: float | None = None) -> None:
        """Take in what somebody says, be it this very process; it came now, or at ``arrived_s``."""
        writer = message.writer
        if isinstance(message.body, Status):
            before = self.statuses.get(writer)
            reborn = self._reports.take_status(writer, message.stamp, message.body)
            if reborn is not None:
                self._narrator.status(writer, message.body, before, now_s, reborn=reborn)
                self._follow(writer, message.body, now_s)
            return
        if isinstance(message.body, Choice):
            if self._reports.take_choice(writer, message.stamp, message.body):
                self._narrator.choice(writer, message.body, now_s)
            return
        if self._clock.is_set and self.replica.is_premature(message):
            return
        claim, earlier = self.replica.claims.get(writer), self.replica.known(message)
        brief, epoch = self.replica.brief, self.replica.epoch
        if not self.replica.join(message):
            return
        self._clock.heed(message.body, brief, epoch)
        self.flights.hear(writer, message.body, self.mission_s(now_s))
        match message.body:
            case PlanEpoch() as epoch:
                self._hear_epoch(epoch, now_s, now_s if arrived_s is None else arrived_s)
            case Outcome() as outcome if earlier is not None:
                if not self._is_another_visit(outcome, earlier):
                    return
            case TaskEdit() as edit:
                self._flown.edit(edit, max(0.0, self.mission_s(now_s) or 0.0))
            case ZoneEdit():
                self._flown.complete()
            case MissionConfig() if self.replica.task_orders or self.replica.zone_edits:
                self._flown.complete()
            case _:
                pass
        self._narrator.hear(message, earlier, claim, now_s)

    def _follow(self, uav: str, status: Status, now_s: float) -> None:
        """See where a UAV of the fleet flies."""
        brief = self.replica.brief
        fleet = () if brief is None else brief.uavs
        spec = next((each for each in fleet if each.id == uav), None)
        if brief is None or spec is None:
            return
        grounds = [spec.position_enu_m, *(base.position_enu_m for base in brief.bases)]
        self.flights.hear_status(uav, status, spec.layer_m, grounds, now_s)
        terrain = None if brief.terrain is None else brief.terrain.terrain()
        zones = zones_in_force(self.replica)
        self.limits.hear(uav, status, spec.layer_m, zones, terrain, grounds)

    def _is_another_visit(self, outcome: Outcome, earlier: Message) -> bool:
        """Whether it is no mere restatement, by a new life of the agent, of what was known."""
        former = earlier.body
        if not isinstance(former, Outcome) or former.result is not AttemptResult.DONE:
            return True
        if outcome.result is not AttemptResult.DONE:
            return True
        if former.completed_s == outcome.completed_s:
            return False
        self._repeated_visits += 1
        return True

    def _hear_epoch(self, epoch: PlanEpoch, now_s: float, arrived_s: float) -> None:
        lists = tuple((uav, tasks) for uav, tasks in sorted(epoch.routes.items()))
        course = epoch.number, epoch.rule, epoch.sequence, lists
        if epoch.phase is MissionPhase.RUNNING:
            self._clock.hear(epoch.mission_s, arrived_s)
        if epoch.phase is MissionPhase.RUNNING:
            if course not in self._epochs:
                self._epochs.append(course)
                self._epochs_heard += 1
                self._narrator.epoch(epoch, now_s)
            self._narrator.left_out(epoch, now_s)
        elif epoch.phase is MissionPhase.ENDED and not self._end_heard:
            self._end_heard = True
            self._asking.want(now_s)  # soon nobody will be there to tell what was not heard
            self._narrator.end(epoch, now_s)

    def _disown(self, names: Collection[str], now_s: float) -> None:
        """What has been heard under those names is no measure of what is said from now on."""
        self._narrator.keys_replaced(names, now_s)
        self.replica.demote_revoked(names)
        self._reports.demote_revoked(names)
        stamp = self.replica.epoch_stamp
        if stamp is not None and stamp.incarnation == REVOKED_INCARNATION:
            self._coordinator = None

    # -- who is there -------------------------------------------------------------------

    def _hear_coordinator(self, message: Message, now_s: float) -> None:
        """See whether the coordinator is back, or another one has taken its place."""
        life = message.stamp.incarnation
        if self._coordinator is not None and life < self._coordinator:
            return
        if self.phase is not MissionPhase.ENDED and COORDINATOR in self._membership.present:
            another = self._coordinator is not None and life > self._coordinator
            if another or self._coordinator_missed:
                self._narrator.coordinator_back(now_s, another=another)
                self._coordinator_missed = False
        self._coordinator = life

    def _welcome_back(self, writer: str, now_s: float) -> bool:
        """Whether ``writer``, present anew, had been missed."""
        missed = writer in self._missed
        self._missed.discard(writer)
        if writer in self.lost:
            self.lost.remove(UavId(writer))
            self._narrator.back(writer, now_s)
        return missed

    def _names_unknown(self, body: Body) -> bool:
        """Whether it names a task not heard of: others have been told, as by an operator's shell
        that has no link to this process.
        """
        named: Iterable[str] = ()
        match body:
            case PlanEpoch():
                named = chain(*body.routes.values(), *body.left_out.values())
            case Claim(task=str() as task):
                named = (task,)
            case _:
                pass
        board = self.replica.board
        return self.replica.brief is not None and any(task not in board for task in named)

    def _is_newcomer(self, writer: str) -> bool:
        """Whether it is a UAV whose first words may have been said before they could be heard."""
        brief, claims = self.replica.brief, self.replica.claims
        return brief is not None and writer not in claims and writer in {u.id for u in brief.uavs}

    def _lose(self, writer: str, now_s: float) -> bool:
        """Take note of a loss; whether others may have heard last words."""
        self._missed.add(writer)
        silent = self._membership.mute(writer)
        if writer == COORDINATOR:
            self._narrator.coordinator_lost(now_s, silent=silent)
            self._coordinator_missed = True
            return True
        claim = self.replica.claims.get(writer)
        if claim is None or claim.phase is ClaimPhase.OUT:
            return False
        if writer not in self.lost:
            self.lost.append(UavId(writer))
        self._narrator.lost(writer, claim, now_s, silent=silent)
        return True

    def _ask(self, now_s: float) -> list[CommonAction]:
        self._asking.stretch = stretch_of(len(self._membership.present))
        if not self._asking.due(now_s):
            return []
        self._ask_at_s = now_s + self._timing.ask_s
        return [Ask()]
