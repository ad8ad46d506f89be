"""The life of one UAV's agent, from syncing to landing: events in, actions out.

The core owns one replica of the shared registers and one state (agent.core.states). It syncs with
the others before it prepares its vehicle, or goes on where an earlier life stopped; it takes tasks
while the vehicle is airborne in a running mission, holds it when the operator says so, and goes
home when the mission has ended. Here is only what happens when: what follows for tasks and claims
is in agent.core.tasking, for the vehicle in agent.core.vehicle_commander, for what is known of the
others in agent.core.state_sync. Leaves out: flying (agent.vehicle) and transport (agent.runner).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

from agent.core.announcer import Announcer
from agent.core.attention import Attention
from agent.core.context import AgentContext, AgentPart, usual_field_rule
from agent.core.field_tasking import FieldTasking
from agent.core.ground_station import HELD_BEFORE, GroundStation, was_held
from agent.core.interface import Action, Event, Telemetry
from agent.core.memory import RecoveredState, SaveCondition
from agent.core.mission_view import MissionView, Peers
from agent.core.near_traffic import NearTraffic
from agent.core.state_sync import StateSync
from agent.core.states import (
    HEADED_HOME,
    PAUSED_BY_OPERATOR,
    TAKES_TASKS,
    AgentState,
    AgentStateMachine,
    Trigger,
)
from agent.core.station_words import StationAsked
from agent.core.step_actions import arranged
from agent.core.stop_conditions import BusLossTimer, EndCondition, OperatorCommands
from agent.core.told_zones import ToldZones
from agent.core.vehicle_commander import VehicleCommander
from agent.core.verticals import Verticals
from swarm.model.ids import COORDINATOR
from swarm.protocol.board import RuleMaker, rule_of
from swarm.protocol.events import (
    Finish,
    KeysReplaced,
    LinkChanged,
    MessageReceived,
    MessagesReceived,
    PeerGone,
    PeerSeen,
    Save,
    SnapshotsReceived,
    Stop,
    Tick,
)
from swarm.protocol.messages import CommandKind, Message, Snapshot
from swarm.protocol.operator_commands import describe_command
from swarm.protocol.register_writer import RegisterWriter
from swarm.protocol.registers import Replica
from swarm.protocol.timing import StallDetector, Timing, earliest
from swarm.protocol.uav_messages import MOST_REASONS, Claim, ClaimPhase, Status, StatusPhase

if TYPE_CHECKING:
    from agent.core.field_decision import FieldRuleMaker

IMPOSSIBLE = "impossible transition"
"""Begins the log line about a trigger that the agent's state has no transition for: a bug."""
_MINDS_BUS_LOSS = TAKES_TASKS | PAUSED_BY_OPERATOR | {AgentState.PREPARING}
"""There is a flight to break off for want of a bus."""


class AgentCore(AgentPart):
    """The agent of one UAV.

    Args:
        mission: mission name.
        uav: id of the UAV this agent flies.
        incarnation: greater than in any earlier life of this agent.
        timing: timers, in the seconds of ``now_s``.
        memory: what an earlier life kept, its mission time brought to now; None if there
            is nothing.
        memory_age_s: how long ago that was kept.
        rejoin: take part again, although an earlier life left this flight of the mission.
        path_clearance_m: how much farther than their margin ways lead past zones, for vehicles
            that do not fly quite where they are told.
        verticals: what landing and climbing cost, and where it lands, as far as it is known
            beforehand; None for vehicles that take no time for it.
        without_bus_s: go home when the own link has been down for that long; None: fly on.
        make_rule: what it decides by, given an epoch's rule and routes; alike for the fleet.
        make_field_rule: the same where the field's constraints count.
        shows_stations: whether there are ground stations to be shown what it does.
    """

    def __init__(
        self,
        mission: str,
        uav: str,
        incarnation: int,
        timing: Timing,
        memory: Snapshot | None = None,
        memory_age_s: float = 0.0,
        *,
        rejoin: bool = False,
        without_bus_s: float | None = None,
        make_rule: RuleMaker = rule_of,
        path_clearance_m: float = 0.0,
        verticals: Verticals | None = None,
        make_field_rule: FieldRuleMaker = usual_field_rule,
        shows_stations: bool = False,
    ) -> None:
        self.uav = uav
        self.replica = Replica()
        self.dropped: Callable[[], Mapping[str, int]] = dict
        """Messages the shell has dropped so far, by reason; goes out with the status."""
        self._mission = mission
        self._rejoin = rejoin
        if memory is not None:  # the calendar clock may have gone back since
            incarnation = max(incarnation, memory.incarnation + 1)
        context = AgentContext(
            uav=uav,
            timing=timing,
            replica=self.replica,
            mission_view=MissionView(mission, uav, self.replica),
            peers=Peers(uav, timing),
            announcer=Announcer(RegisterWriter(mission, uav, incarnation), self.replica, timing),
            machine=AgentStateMachine(self._note_impossible),
            path_clearance_m=path_clearance_m,
            verticals=verticals,
            make_field_rule=make_field_rule,
        )
        super().__init__(context)
        self._tasking = FieldTasking(context, make_rule)
        self._near_traffic = NearTraffic(context, is_flown=verticals is not None)
        self._near_traffic.when_disturbed = self._tasking.disturbed
        self._ending = EndCondition(context)
        self._commander = VehicleCommander(context, self._tasking, self._ending)
        self._station = GroundStation(context, self._tasking, self._commander, shown=shows_stations)
        self._sync = StateSync(context, self._tasking)
        self.attention = Attention(context, self._sync, shows_stations=shows_stations)
        self._queries = self._sync.queries
        self._recovered = RecoveredState(uav, memory, memory_age_s, timing)
        self._saving = SaveCondition(uav, self.replica, timing)
        self._operator_commands = OperatorCommands(uav, self.replica, rejoin=rejoin)
        self._bus_loss = BusLossTimer(without_bus_s)
        self._stall_detector = StallDetector(timing.pause_s)
        self._deadline_s: float | None = None
        self._told_zones = ToldZones(self.replica)

    # -- the one entry point ------------------------------------------------------

    def start(self, now_s: float) -> list[Action]:
        """What to do first."""
        self._recovered.begin(now_s)
        self._queries.doubt(now_s, everyone=True)
        self._actions += self._queries.questions(now_s, lacking=True)
        return self._end_step(now_s)

    def step(self, event: Event, now_s: float) -> list[Action]:
        """React to one event.

        Args:
            event: what happened.
            now_s: now, on this process's own clock [s]; never decreases.
        """
        self._mission_view.now_s = now_s
        self._near_traffic.sense(event)
        event = self._airway.hear(event)
        if isinstance(event, Telemetry) and self._is_place_alone(now_s):
            self._mission_view.move(event)
            if not self._tasking.measure(now_s):
                return []
        if isinstance(event, MessageReceived | MessagesReceived):
            event = self._sync.without_repeated(event, now_s)
            if self._is_idle(now_s) and self.attention.only_remembers(event, now_s):
                self._deadline_s = earliest(self._deadline_s, self._near_traffic.next_deadline_s())
                return []
        if self._is_idle(now_s) and self._sync.only_meets(event, now_s):
            return self._end_step(now_s)
        if not self._machine.has_ended:
            if self._stall_detector.late(now_s):
                self._sync.held_up(now_s)
                self._tasking.disturbed()
            self._handle(event, now_s)
            if not self._machine.has_ended:
                self._advance(now_s)
            if self._machine.acts:
                self._settle(now_s)
            if self._machine.has_ended:
                self._finish(now_s)
        return self._end_step(now_s)

    def next_deadline_s(self) -> float | None:
        """When `step` wants a `Tick` at the latest; None when it has finished."""
        return self._deadline_s

    def _earliest_deadline_s(self) -> float | None:
        """Of all parts.

        Each deadline is None from the moment on at which nobody would heed it any
        more: one that stayed would be past for ever.
        """
        if self._machine.has_ended:
            return None
        return earliest(
            self._peers.membership.next_deadline_s(),
            self._announcer.next_deadline_s(),
            self._tasking.next_deadline_s(),
            self._airway.next_deadline_s(),
            self._near_traffic.next_deadline_s(),
            self._ending.next_deadline_s() if self._knows_enough else None,
            self._queries.next_deadline_s(),
            self._recovered.next_deadline_s() if self._is_beginning else None,
            self._bus_loss.next_deadline_s() if self.state in _MINDS_BUS_LOSS else None,
        )

    def snapshot(self, now_s: float) -> Snapshot:
        """What this process answers for: its own registers, and those of who cannot."""
        return self._answer(self._peers.membership.steady, now_s)

    def whole(self, now_s: float) -> Snapshot:
        """What it tells one who asks some for all they know: the coordinator is among them."""
        return self._answer(self._peers.membership.steady & {COORDINATOR}, now_s)

    def _answer(self, others: Collection[str], now_s: float) -> Snapshot:
        """All it knows but what ``others`` answer for; nothing as long as it syncs itself."""
        if self.state in (AgentState.SYNCING, AgentState.YIELDED):
            return self._snapshot_of((), now_s)
        return self._snapshot_of(self.replica.answers(self.uav, others), now_s)

    def memory(self, now_s: float) -> Snapshot:
        """Everything it knows, for a later life of this agent."""
        known = self._snapshot_of(self.replica.messages(), now_s)
        return replace(known, begun=self._commander.begun)

    def _snapshot_of(self, messages: Iterable[Message], now_s: float) -> Snapshot:
        mission_s = self._mission_view.clock.mission_s(now_s)
        incarnation = self._announcer.incarnation
        return Snapshot(self._mission, self.uav, incarnation, mission_s, tuple(messages))

    @property
    def state(self) -> AgentState:
        """What it is about."""
        return self._machine.state

    @property
    def phase(self) -> StatusPhase:
        """What its status calls that."""
        return self._machine.phase

    @property
    def is_contested(self) -> bool:
        """Whether what others claim matters at once: it has no task, or one that is new."""
        return self._tasking.is_contested

    def run_since(self, since_s: float) -> None:
        """Its process has run without a stop since then, and it has heard all that came."""
        self._stall_detector.runs_since_s = since_s

    def next_own_deadline_s(self) -> float | None:
        """When something is due about its own task; None: nothing is, or it waits for its way."""
        return None if self._tasking.awaits_way else self._tasking.next_deadline_s()

    @property
    def claim(self) -> Claim | None:
        """This UAV's claim register; None while it takes no tasks."""
        return self._tasking.claim

    # -- events -------------------------------------------------------------------

    def _handle(self, event: Event, now_s: float) -> None:
        match event:
            case MessageReceived() | MessagesReceived():
                for message in event.messages:
                    self._sync.hear(message, now_s, event.arrived_s)
            case SnapshotsReceived(snapshots):
                self._learn(snapshots, now_s)
            case PeerSeen(writer):
                self._sync.see(writer, now_s)
            case PeerGone(writer):
                self._sync.miss(writer, now_s)
            case KeysReplaced(names):
                self._sync.demote_revoked(names)
                self._recovered.demote_revoked(names)
            case LinkChanged(up):
                self._bus_loss.link(up, now_s)
                self._sync.link(up, now_s)
            case Stop(reason):
                if self.state is AgentState.SYNCING:
                    self._recollect(now_s, last_chance=True)
                self._commander.go_home(reason, now_s, hurry=True)
            case Tick():
                pass
            case StationAsked():
                self._station.hear(event, now_s)
            case report:
                self._commander.hear(report, now_s)

    def _learn(self, snapshots: tuple[Snapshot, ...], now_s: float) -> None:
        if self._sync.yields_to(snapshots):
            # Without a word, and without an order: the other speaks for this UAV and flies it.
            self._machine.take(Trigger.SUPERSEDED)
        else:
            self._sync.learn(snapshots, now_s)

    def _is_place_alone(self, now_s: float) -> bool:
        """Whether nothing follows from where the vehicle is: known before, and nothing is due."""
        return self._mission_view.place_enu_m is not None and self._is_idle(now_s)

    def _is_idle(self, now_s: float) -> bool:
        """Whether nothing is due."""
        due = self._deadline_s is not None and self._deadline_s <= now_s
        return not (due or self._machine.has_ended)

    # -- what follows from the state ------------------------------------------------

    def _advance(self, now_s: float) -> None:
        """What is due by now, whatever the event was: first what others say, then what it does."""
        self._sync.lose(now_s)
        if self._is_beginning:
            self._recollect(now_s)
        if self._knows_enough:
            self._obey(now_s)
            self._go_home_if_over(now_s)
        if self.state in _MINDS_BUS_LOSS and self._bus_loss.too_long(now_s):
            self._commander.go_home(f"without the bus for {self._bus_loss.patience_s:g} s", now_s)
        if self._is_beginning:
            self._begin(now_s)
        self._heed_zones(now_s)
        if self._machine.takes_tasks and self._mission_view.running:
            self._go_on(now_s)
        self._go_home_if_spent(now_s)
        if not self._machine.has_ended:
            lacking = self.state is AgentState.SYNCING
            there = self._peers.membership.present
            self._actions += self._queries.questions(now_s, lacking=lacking, present=there)
            self._actions += self._announcer.repeat(
                lambda: self._status(now_s), now_s, learned=self._machine.acts
            )

    def _heed_zones(self, now_s: float) -> None:
        """Fly other ways at once where zones have changed."""
        displaced, self._airway.displaced = self._airway.displaced, False
        if not (self._tasking.zones_changed() or displaced):
            return
        if self.state in HEADED_HOME:
            self._commander.reroute()
        elif self._machine.takes_tasks and self._mission_view.running:
            self._tasking.reroute(now_s)

    def _go_home_if_spent(self, now_s: float) -> None:
        """Bring a UAV that stands by nothing home before its battery is used up."""
        if not self._commander.may_fly:
            return
        if (reason := self._tasking.spent(now_s)) is not None and self._machine.acts:
            self._commander.go_home(reason, now_s)

    def _go_on(self, now_s: float) -> None:
        """Do what the tasks ask for; whoever is alone then is woken by nobody but itself."""
        before = self.phase, self._tasking.undecided
        self._tasking.advance_in_field(now_s)
        self._tasking.advance(now_s, informed=self._queries.current)
        self._tasking.head_home_in_time(now_s)
        if before != (self.phase, self._tasking.undecided):
            self._go_home_if_over(now_s)

    @property
    def _knows_enough(self) -> bool:
        """Whether it may act: in its first state, only on what all others know."""
        return self._machine.acts or self._queries.current

    @property
    def _is_beginning(self) -> bool:
        """Whether it knows enough, what time it is too, and has not acted on it yet."""
        syncs = self.state is AgentState.SYNCING and self._queries.current
        return syncs and not self._recovered.waits_for_time(self._mission_view)

    # -- the beginning of a life ------------------------------------------------------

    def _recollect(self, now_s: float, *, last_chance: bool = False) -> None:
        """Find out where an earlier life stood, from the others or from its own memory."""
        brief = self.replica.brief
        memory = self._recovered.fitting(brief, now_s, last_chance=last_chance)
        if memory is not None:
            self._sync.remember(memory, now_s)
            self._log("remembers", confirmed=brief is not None)
        claim = self.replica.claims.get(self.uav)
        self._commander.recall(claim, rejoin=self._rejoin, begun=self._recovered.begun)
        if self._recovered.unconfirmed:
            self._commander.go_home("nobody knows of a mission", now_s, status=1)
        elif claim is not None and claim.phase is ClaimPhase.OUT and not self._rejoin:
            self._commander.stay_out(claim, now_s)

    def _begin(self, now_s: float) -> None:
        """Get the vehicle ready; in a running mission, from where an earlier life left it."""
        me = self._mission_view.me
        if me is None:
            unknown = self.replica.brief is None
            waits = "waiting for the coordinator's brief" if unknown else "not in the brief"
            if self._announcer.note != waits:
                self._announcer.explain(waits)
                self._log(waits, uav=self.uav)
            return
        if was_held(self.replica, self.uav, self._recovered.taken) and not self._rejoin:
            self._commander.hold(HELD_BEFORE, now_s)
            return
        claim = self.replica.claims.get(self.uav)
        if claim is not None and self._mission_view.said_to_run and self._tasking.stand(now_s):
            return
        self._commander.prepare(me, Trigger.SYNCED)
        if claim is not None and self._mission_view.running:
            self._tasking.recall(claim)
            self._tasking.resume(claim, now_s)

    # -- what takes it from its tasks ---------------------------------------------------

    def _go_home_if_over(self, now_s: float) -> None:
        if self.state in HEADED_HOME:
            return
        undecided, refused = self._tasking.undecided, self._tasking.leaves_refused(now_s)
        reason = self._ending.reason(self.phase, now_s, undecided=undecided, refused=refused)
        if reason is not None and self.state is AgentState.PAUSED:
            self._commander.stay_paused(now_s)
        elif reason is not None:
            self._commander.go_home(reason, now_s)

    def _obey(self, now_s: float) -> None:
        """Do what the operator has said since; an abort ends the mission besides.

        A vehicle that has been given up is another's to command.
        """
        command = self._operator_commands.news(begins=not self._machine.acts)
        if command is None:
            return
        self._log("told by the operator", command=command.kind.value, reason=command.reason)
        if self.state is AgentState.OUT:
            return
        reason = describe_command(command)
        match command.kind:
            case CommandKind.HOLD:
                self._commander.hold(reason, now_s)
            case CommandKind.RESUME if self.state in PAUSED_BY_OPERATOR:
                self._commander.resume(reason, now_s)
            case CommandKind.RETURN | CommandKind.ABORT:
                self._commander.go_home(reason, now_s)
            case _:
                pass

    # -- what it says of itself, and what it keeps --------------------------------------

    def _finish(self, now_s: float) -> None:
        """The process is to end."""
        if self.state is AgentState.YIELDED:
            self._log("another agent already flies this UAV")
            self._actions.append(Finish(1))
        else:
            self._say(self._status(now_s))
            self._actions.append(Finish(self._commander.exit_status))

    def _status(self, now_s: float) -> Status:
        claim, telemetry = self.claim, self._mission_view.telemetry
        dropped = Counter({**self.dropped(), "stale": self.replica.stale})
        return Status(
            phase=self.phase,
            task=None if claim is None else claim.task,
            position_enu_m=self._mission_view.carried_enu_m,
            velocity_enu_m_s=None if telemetry is None else telemetry.velocity_enu_m_s,
            battery_frac=None if telemetry is None else telemetry.battery_frac,
            mission_s=self._mission_view.clock.mission_s(now_s),
            dropped=dict((+dropped).most_common(MOST_REASONS)),
            note=self._announcer.note,
            layer_m=self._mission_view.told_layer_m,
        )

    def _note_impossible(self, state: AgentState, trigger: Trigger) -> None:
        self._log(IMPOSSIBLE, state=state.name, trigger=trigger.name)

    def _settle(self, now_s: float) -> None:
        """Ask for ways, grant those of others, and set off on what is granted."""
        for report in self._airway.settle(now_s):
            self._commander.hear(report, now_s)
            self._airway.settle(now_s)
        if (restated := self._airway.restated(speaks=self._speaks)) is not None:
            self._restate(restated)
        if (granted := self._airway.granted(now_s)) is not None:
            self._actions.append(self._announcer.say_to(*granted))
        self._near_traffic.settle(now_s)

    def _end_step(self, now_s: float) -> list[Action]:
        """What came of the step; a change worth it is kept for a later life."""
        self._station.show(now_s)
        actions = self._actions.copy()
        self._actions.clear()
        self._told_zones.tell(actions)
        remembers = self.state not in (AgentState.SYNCING, AgentState.YIELDED)
        if remembers and self._saving.worth_keeping(actions, now_s, begun=self._commander.begun):
            actions.insert(0, Save())
        self._deadline_s = self._earliest_deadline_s()
        self._stall_detector.expect_by(self._deadline_s)
        return arranged(actions)
