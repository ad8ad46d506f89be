"""The life of one UAV's agent, from learning to landing: events in, actions out.

The core owns one replica of the shared registers. It learns before it prepares its vehicle, or goes
on where an earlier life stopped; it takes tasks while the vehicle is airborne in a running mission,
holds it when the operator says so, and goes home when the mission has ended. Leaves out: tasks and
claims (agent.core.tasking), when the mission is over (agent.core.stop_conditions), the mission as
such (agent.core.mission_view), what it makes of the others (agent.core.mission_view), when it asks
them (agent.core.state_sync) and repeats itself (agent.core.announcer), what counts of an earlier
life's memory (agent.core.state_sync), which of the operator's commands are news
(agent.core.stop_conditions), flying (agent.core.interface) and transport (agent.runner).
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping

from agent.core.announcer import Announcer
from agent.core.interface import (
    Action,
    Arrived,
    AttemptFailed,
    Caution,
    Event,
    GoTo,
    HandedOver,
    HandOverExplained,
    HeardAgain,
    Held,
    Hold,
    Home,
    NotReady,
    OrderVehicle,
    Prepare,
    Refused,
    Return,
    ReturnAdvised,
    ReturnBegun,
    Telemetry,
    VehicleReady,
)
from agent.core.mission_view import MissionView, Peers
from agent.core.state_sync import RecoveredState, StateSync
from agent.core.stop_conditions import BusLossTimer, EndCondition, OperatorCommands
from agent.core.tasking import Tasking
from swarm.protocol.events import (
    Finish,
    KeysReplaced,
    LinkChanged,
    LogLine,
    MessageReceived,
    PeerGone,
    PeerSeen,
    Publish,
    PublishLast,
    Save,
    SnapshotsReceived,
    Stop,
    Tick,
)
from swarm.protocol.messages import (
    CommandKind,
    Message,
    MissionPhase,
    OperatorCommand,
    Snapshot,
    UavSpec,
)
from swarm.protocol.operator_commands import BEING_STOPPED, CANNOT_HOLD, describe_command
from swarm.protocol.register_writer import RegisterWriter
from swarm.protocol.registers import Replica
from swarm.protocol.timing import StallDetector, Timing, earliest
from swarm.protocol.uav_messages import MOST_REASONS, Claim, ClaimPhase, Status, StatusPhase

__all__ = ["AgentCore"]


class AgentCore:
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
        without_bus_s: go home when the own link to the bus has been down for that long; None
            to fly on.
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
    ) -> None:
        self.uav = uav
        self.replica = Replica()
        self.dropped: Mapping[str, int] = {}
        """Messages the shell has dropped so far, by reason; goes out with the status."""
        self._mission = mission
        self._rejoin = rejoin
        if memory is not None:  # the calendar clock may have gone back since
            incarnation = max(incarnation, memory.incarnation + 1)
        self._announcer = Announcer(RegisterWriter(mission, uav, incarnation), self.replica, timing)
        self._peers = Peers(uav, timing)
        self._mission_view = MissionView(mission, uav, self.replica)
        self._tasking = Tasking(
            uav, self.replica, self._mission_view, self._peers, self._announcer, timing
        )
        self._ending = EndCondition(self.replica, self._mission_view, self._peers, timing)
        self._sync = StateSync(
            uav,
            self.replica,
            self._mission_view,
            self._peers,
            self._announcer,
            self._tasking,
            timing,
        )
        self._queries = self._sync.queries
        self._recovered = RecoveredState(uav, memory, memory_age_s, timing)
        self._operator_commands = OperatorCommands(uav, self.replica, rejoin=rejoin)
        self._bus_loss = BusLossTimer(without_bus_s)
        self._stall_detector = StallDetector(timing.pause_s)
        self._keep_again_s = timing.recall_s / 4.0
        self._actions: list[Action] = []
        self._stage = StatusPhase.LEARNING
        self._flew_before = False
        """Whether the vehicle may be in the air though this life has not brought it there."""
        self._flown = False
        """Whether the vehicle has been in the air in this life."""
        self._left_in_air = False
        """Whether an earlier life was last heard to have it in the air."""
        self._homebound = False
        """Whether it takes no further part, so that home is all that is left to fly to."""
        self._on_detour = False
        """Whether the vehicle was told to fly to its start before it returns."""
        self._exit_status = 0
        self._caution = ""
        """What people should know of the vehicle in flight."""
        self._finished = False
        self._deadline_s: float | None = None
        self._kept: object = None
        self._kept_tasks = 0
        """Of the replica's task versions, the one that is kept."""
        self._kept_at_s = -math.inf

    # -- the one entry point ------------------------------------------------------

    def start(self, now_s: float) -> list[Action]:
        """What to do first."""
        self._recovered.begin(now_s)
        self._queries.doubt(now_s)
        self._actions += self._queries.questions(now_s, lacking=True)
        return self._end_step(now_s)

    def step(self, event: Event, now_s: float) -> list[Action]:
        """React to one event.

        Args:
            event: what happened.
            now_s: now, on this process's own clock [s]; never decreases.
        """
        if isinstance(event, Telemetry) and self._changes_nothing_else(now_s):
            self._mission_view.move(event)
            return []
        if not self._finished and self._stall_detector.late(now_s):
            self._actions += self._sync.held_up(now_s)
        if not self._finished:
            self._handle(event, now_s)
        if not self._finished:
            self._advance(now_s)
        return self._end_step(now_s)

    def next_deadline_s(self) -> float | None:
        """When `step` wants a `Tick` at the latest; None when it has finished."""
        return self._deadline_s

    def _earliest_deadline_s(self) -> float | None:
        """Of all parts.

        Each deadline is None from the moment on at which nobody would heed it any
        more: one that stayed would be past for ever.
        """
        if self._finished:
            return None
        return earliest(
            self._peers.membership.next_deadline_s(),
            self._announcer.next_deadline_s(),
            self._tasking.next_deadline_s(),
            self._ending.next_deadline_s() if self._knows_enough else None,
            self._queries.next_deadline_s(),
            self._recovered.next_deadline_s() if self._is_beginning else None,
            self._bus_loss.next_deadline_s() if self._minds_bus_loss else None,
        )

    def snapshot(self, now_s: float) -> Snapshot:
        """What this process answers for: its own registers, and those of who cannot.

        As long as it is learning itself, it has nothing to tell.
        """
        if self._stage is StatusPhase.LEARNING:
            return self._snapshot_of((), now_s)
        steady = self._peers.membership.steady
        return self._snapshot_of(self.replica.answers(self.uav, steady), now_s)

    def memory(self, now_s: float) -> Snapshot:
        """Everything it knows, for a later life of this agent."""
        return self._snapshot_of(self.replica.messages(), now_s)

    def _snapshot_of(self, messages: Iterable[Message], now_s: float) -> Snapshot:
        mission_s = self._mission_view.known_mission_s(now_s)
        incarnation = self._announcer.incarnation
        return Snapshot(self._mission, self.uav, incarnation, mission_s, tuple(messages))

    @property
    def phase(self) -> StatusPhase:
        """What the UAV is doing."""
        return self._tasking.phase or self._stage

    @property
    def claim(self) -> Claim | None:
        """This UAV's claim register; None while it takes no tasks."""
        return self._tasking.claim

    # -- events -------------------------------------------------------------------

    def _handle(self, event: Event, now_s: float) -> None:
        match event:
            case MessageReceived(message):
                self._actions += self._sync.hear(message, now_s)
            case SnapshotsReceived(snapshots):
                self._learn(snapshots, now_s)
            case PeerSeen(writer):
                self._actions += self._sync.see(writer, now_s)
            case PeerGone(writer):
                self._sync.miss(writer, now_s)
            case KeysReplaced(names):
                self._sync.demote_revoked(names)
                self._recovered.demote_revoked(names)
            case LinkChanged(up):
                self._bus_loss.link(up, now_s)
                self._actions += self._sync.link(up, now_s)
            case Stop(reason):
                if self._stage is StatusPhase.LEARNING:
                    self._recollect(now_s, last_chance=True)
                self._go_home(reason, now_s, hurry=True)
            case Tick():
                pass
            case VehicleReady():
                self._become_airborne(now_s)
            case NotReady(reason):
                if self._stage is not StatusPhase.HOLDING:  # why it holds is worth more
                    self._announcer.note = reason
                self._actions.append(LogLine("vehicle not ready", {"reason": reason}))
            case Caution(reason):
                self._caution = reason
                if self._tasking.airborne:  # before and after, the note says what it waits for
                    self._announcer.note = reason[:200]
                self._actions.append(LogLine("caution", {"reason": reason}))
            case Arrived(leg):
                self._tasking.arrive(leg, now_s)
            case AttemptFailed(leg):
                self._tasking.fail(leg)
            case Telemetry() as telemetry:
                self._mission_view.move(telemetry)
            case Refused(order, reason):
                self._give_up_order(order, reason, now_s)
            case HandedOver(reason, silent):
                self._leave_vehicle(reason, now_s, handed_over=not silent)
            case HandOverExplained(reason) if self.phase is StatusPhase.OUT:
                self._explain(reason, now_s)
            case HeardAgain(reason) if self.phase is StatusPhase.OUT:
                self._turn_home(reason, now_s, hurry=True)
            case ReturnBegun():
                self._flown = True
            case ReturnAdvised(reason):
                self._flown = True
                if self.phase is not StatusPhase.OUT:
                    self._go_home(reason, now_s, hurry=True)
            case Held() if self._stage is StatusPhase.HOLDING:
                self._announcer.note = self._announcer.note.removeprefix(BEING_STOPPED)
            case Home():
                self._come_home(now_s)

    def _learn(self, snapshots: tuple[Snapshot, ...], now_s: float) -> None:
        if self._sync.yields_to(snapshots):
            # Without a word, and without an order: the other speaks for this UAV and flies it.
            self._actions += [LogLine("another agent already flies this UAV"), Finish(1)]
            self._finished = True
        else:
            self._actions += self._sync.learn(snapshots, now_s)

    def _become_airborne(self, now_s: float) -> None:
        if self._stage is not StatusPhase.PREPARING or self._tasking.airborne:
            return
        self._flown = True
        self._announcer.note = self._caution[:200]
        me = self._mission_view.me
        if self._mission_view.place_enu_m is None and me is not None:
            self._mission_view.place_enu_m = me.position_enu_m
        self._actions += self._tasking.begin(now_s)
        self._actions.append(LogLine("airborne"))

    def _give_up_order(self, order: object, reason: str, now_s: float) -> None:
        label = self._tasking.label(order.leg) if isinstance(order, GoTo) else {}
        fields = {"order": str(order), "reason": reason, **label}
        self._actions.append(LogLine("vehicle refused", fields))
        if isinstance(order, GoTo):
            self._actions += self._tasking.refuse(order.leg, reason, now_s)
        elif isinstance(order, Prepare) and self._flew_before:
            self._go_home(reason, now_s, status=1, hurry=True)  # it may be in the air
        elif isinstance(order, Hold) and self._stage is StatusPhase.HOLDING:
            self._announcer.note = f"{CANNOT_HOLD}{reason}"[:200]
        elif isinstance(order, Prepare | Return):
            self._leave_vehicle(reason, now_s, handed_over=False)

    def _leave_vehicle(self, reason: str, now_s: float, *, handed_over: bool) -> None:
        """The vehicle is not to be commanded any more."""
        if self.phase is StatusPhase.OUT:
            return
        self._actions.append(LogLine("vehicle given up", {"reason": reason}))
        returning = self.phase is StatusPhase.RETURNING
        self._actions += self._tasking.end(now_s, handed_over=handed_over)
        self._enter(StatusPhase.OUT, reason)
        if returning:
            # It was told to come home; nobody here can see whether it does.
            self._finish(1, now_s)

    def _explain(self, reason: str, now_s: float) -> None:
        """More is known of the vehicle given up; one that was only silent is another's now."""
        self._actions.append(LogLine("of the vehicle given up", {"reason": reason}))
        claim = self.replica.claims.get(self.uav)
        if claim is not None and not claim.handed_over:
            self._actions += self._tasking.end(now_s, handed_over=True)
        self._enter(StatusPhase.OUT, reason)

    def _come_home(self, now_s: float) -> None:
        held = self._stage is StatusPhase.HOLDING and self._homebound
        if held or self.phase is StatusPhase.RETURNING:
            self._enter(StatusPhase.HOME, self._announcer.note)
            self._actions.append(LogLine(self._how_it_ended))
            self._finish(self._exit_status, now_s)

    @property
    def _how_it_ended(self) -> str:
        """What is true of a vehicle that is said to be home."""
        if self._flown:
            return "landed at home"
        return "is on the ground" if self._flew_before else "ends without having taken off"

    def _changes_nothing_else(self, now_s: float) -> bool:
        """Whether nothing follows from where the vehicle is: known before, and nothing is due."""
        due = self._deadline_s is not None and self._deadline_s <= now_s
        return self._mission_view.place_enu_m is not None and not (due or self._finished)

    # -- what follows from the state ------------------------------------------------

    def _advance(self, now_s: float) -> None:
        self._actions += self._sync.lose(now_s)
        if self._is_beginning:
            self._recollect(now_s)
        if self._knows_enough:
            self._obey(now_s)
            self._go_home_if_over(now_s)
        if self._minds_bus_loss and self._bus_loss.too_long(now_s):
            self._go_home(f"without the bus for {self._bus_loss.patience_s:g} s", now_s)
        if self._is_beginning:
            self._begin(now_s)
        if self._tasking.phase is not None and self._mission_view.running:
            self._go_on(now_s)
        if not self._finished:
            lacking = self._stage is StatusPhase.LEARNING
            self._actions += self._queries.questions(now_s, lacking=lacking)
            self._actions += self._announcer.repeat(
                lambda: self._status(now_s), now_s, learned=self._sync.at_work
            )

    def _go_on(self, now_s: float) -> None:
        """Do what the tasks ask for; whoever is alone then is woken by nobody but itself."""
        before = self.phase, self._tasking.undecided
        self._actions += self._tasking.advance(now_s, informed=self._queries.current)
        if before != (self.phase, self._tasking.undecided):
            self._go_home_if_over(now_s)

    @property
    def _knows_enough(self) -> bool:
        """Whether it may act: in its first stage, only on what all others know."""
        return self._stage is not StatusPhase.LEARNING or self._queries.current

    @property
    def _is_beginning(self) -> bool:
        """Whether it knows enough, and has not acted on it yet."""
        return self._stage is StatusPhase.LEARNING and self._queries.current

    def _recollect(self, now_s: float, *, last_chance: bool = False) -> None:
        """Find out where an earlier life stood, from the others or from its own memory."""
        brief = self.replica.brief
        memory = self._recovered.fitting(brief, now_s, last_chance=last_chance)
        if memory is not None:
            self._actions += self._sync.remember(memory, now_s)
            self._actions.append(LogLine("remembers", {"confirmed": brief is not None}))
        claim = self.replica.claims.get(self.uav)
        self._flew_before = claim is not None
        aloft = (ClaimPhase.IDLE, ClaimPhase.PROPOSED, ClaimPhase.HELD)
        self._left_in_air = claim is not None and claim.phase in aloft and not self._rejoin
        if self._recovered.unconfirmed:
            self._go_home("nobody knows of a mission", now_s, status=1)
        elif claim is not None and claim.phase is ClaimPhase.OUT and not self._rejoin:
            self._stay_out(claim, now_s)

    def _stay_out(self, claim: Claim, now_s: float) -> None:
        """An earlier life took no more part: neither does this one."""
        if claim.handed_over:
            self._leave_vehicle("handed over in an earlier life", now_s, handed_over=True)
        elif self._mission_runs:
            self._go_home("left the mission in an earlier life", now_s)

    def _begin(self, now_s: float) -> None:
        """Get the vehicle ready; in a running mission, from where an earlier life left it."""
        me = self._mission_view.me
        if me is None:
            missing = self.replica.brief is None
            waits = "waiting for the coordinator's brief" if missing else "not in the brief"
            if self._announcer.note != waits:
                self._announcer.note = waits
                self._actions.append(LogLine(waits, {"uav": self.uav}))
            return
        self._prepare(me)
        claim = self.replica.claims.get(self.uav)
        if claim is not None and self._mission_view.running:
            self._actions += self._tasking.resume(claim, now_s)

    def _prepare(self, me: UavSpec) -> None:
        self._enter(StatusPhase.PREPARING, "")
        place_enu_m, ground_up_m = (
            self._mission_view.in_layer(me.position_enu_m),
            me.position_enu_m[2],
        )
        resume = self._mission_runs or self._left_in_air
        order = Prepare(place_enu_m, me.speed_m_s, resume, ground_up_m, self._left_in_air)
        self._actions.append(OrderVehicle(order))

    @property
    def _mission_runs(self) -> bool:
        """Whether that is the last word, be the time of the mission known or not."""
        epoch = self.replica.epoch
        return epoch is not None and epoch.phase is MissionPhase.RUNNING

    def _go_home_if_over(self, now_s: float) -> None:
        waits = self._stage is StatusPhase.HOLDING and self._homebound
        if waits or self._stage is StatusPhase.RETURNING:
            return
        tasking = self._tasking
        reason = self._ending.reason(
            self.phase, now_s, undecided=tasking.undecided, refused=tasking.leaves_refused(now_s)
        )
        if reason is not None and self._stage is StatusPhase.HOLDING:
            self._take_no_further_part(now_s)  # and stays where the operator wants it
        elif reason is not None:
            self._go_home(reason, now_s)

    @property
    def _minds_bus_loss(self) -> bool:
        """Whether there is a flight to break off for want of a bus."""
        return self._stage in (StatusPhase.PREPARING, StatusPhase.HOLDING)

    # -- what the operator says -------------------------------------------------------

    def _obey(self, now_s: float) -> None:
        """Do what the operator has said since; an abort ends the mission besides.

        A vehicle that has been given up is another's to command.
        """
        command = self._operator_commands.news(begins=self._stage is StatusPhase.LEARNING)
        if command is None:
            return
        fields: dict[str, object] = {"command": command.kind.value, "reason": command.reason}
        self._actions.append(LogLine("told by the operator", fields))
        if self._stage is StatusPhase.OUT:
            return
        match command.kind:
            case CommandKind.HOLD:
                self._hold(command, now_s)
            case CommandKind.RESUME if self._stage is StatusPhase.HOLDING:
                self._resume(command, now_s)
            case CommandKind.RETURN | CommandKind.ABORT:
                self._go_home(describe_command(command), now_s)
            case _:
                pass

    def _hold(self, command: OperatorCommand, now_s: float) -> None:
        """Stop the vehicle, or leave it on the ground where nobody has begun to prepare it."""
        self._flew_before |= self._tasking.airborne
        untouched = self._stage is StatusPhase.LEARNING and not self._flew_before
        if not self._homebound:
            self._actions += self._tasking.pause(now_s)
        self._enter(
            StatusPhase.HOLDING, ("" if untouched else BEING_STOPPED) + describe_command(command)
        )
        if not untouched:
            self._actions.append(OrderVehicle(Hold(describe_command(command))))

    def _resume(self, command: OperatorCommand, now_s: float) -> None:
        """Take part again, as far as there is anything to take part in."""
        me = self._mission_view.me
        if self._homebound or me is None:
            self._go_home(describe_command(command), now_s)
        else:
            self._prepare(me)

    # -- pieces ---------------------------------------------------------------------

    def _enter(self, stage: StatusPhase, note: str) -> None:
        """A new part of its life begins; ``note`` tells a reader why."""
        self._stage, self._announcer.note = stage, note[:200]
        self._sync.at_work = True

    def _go_home(self, reason: str, now_s: float, *, status: int = 0, hurry: bool = False) -> None:
        """Bring the vehicle home; where there is time, in its own layer as far as its start."""
        if self.phase is StatusPhase.OUT:
            # The vehicle is not ours to command any more.
            self._finish(0, now_s)
        elif self.phase is not StatusPhase.RETURNING or (hurry and self._on_detour):
            self._exit_status = max(self._exit_status, status)
            self._turn_home(reason, now_s, hurry=hurry)

    def _turn_home(self, reason: str, now_s: float, *, hurry: bool) -> None:
        """Order the return, from whatever the vehicle does now."""
        self._take_no_further_part(now_s)
        self._enter(StatusPhase.RETURNING, reason)
        me = None if hurry else self._mission_view.me
        via_enu_m = None if me is None else self._mission_view.in_layer(me.position_enu_m)
        self._on_detour = via_enu_m is not None
        order = Return(reason, self._flew_before, via_enu_m)
        self._actions += [LogLine("returning", {"reason": reason}), OrderVehicle(order)]

    def _take_no_further_part(self, now_s: float) -> None:
        if not self._homebound:
            self._homebound = True
            self._actions += self._tasking.end(now_s, handed_over=False)
            self._ending.settle()

    def _finish(self, status: int, now_s: float) -> None:
        self._actions += [self._announcer.say(self._status(now_s)), Finish(status)]
        self._finished = True

    def _status(self, now_s: float) -> Status:
        claim, telemetry = self.claim, self._mission_view.telemetry
        dropped = Counter({**self.dropped, "stale": self.replica.stale})
        return Status(
            phase=self.phase,
            task=None if claim is None else claim.task,
            position_enu_m=self._mission_view.place_enu_m,
            velocity_enu_m_s=None if telemetry is None else telemetry.velocity_enu_m_s,
            battery_frac=None if telemetry is None else telemetry.battery_frac,
            mission_s=self._mission_view.known_mission_s(now_s),
            dropped=dict((+dropped).most_common(MOST_REASONS)),
            note=self._announcer.note[:200],
        )

    def _end_step(self, now_s: float) -> list[Action]:
        """What came of the step; a change worth it is kept for a later life."""
        actions, self._actions = self._actions, []
        if self._stage is not StatusPhase.LEARNING and self._worth_keeping(actions, now_s):
            actions.insert(0, Save())
        # The vehicle first: it waits, while keeping and telling take their time.
        if len(actions) > 1:
            actions.sort(key=_place)
        self._deadline_s = self._earliest_deadline_s()
        self._stall_detector.expect_by(self._deadline_s)
        return actions

    def _worth_keeping(self, actions: list[Action], now_s: float) -> bool:
        """Whether this agent, coordinator or operator has said something new.

        What others have done follows with its next announcement, and so does all when what is
        kept is about to grow old: each time is a write to a memory that wears out.
        """
        replica = self.replica
        plan = None if replica.epoch is None else (replica.epoch.number, replica.epoch.phase)
        commands, own = tuple(replica.commands.values()), replica.heads.get(self.uav)
        before, self._kept = self._kept, (plan, replica.board_version, commands, own)
        worth = before != self._kept
        if not worth and any(_is_register(action) for action in actions):
            old = now_s - self._kept_at_s >= self._keep_again_s
            worth = old or replica.task_version != self._kept_tasks
        if worth:
            self._kept_at_s, self._kept_tasks = now_s, replica.task_version
        return worth


def _is_register(action: Action) -> bool:
    return isinstance(action, Publish) and not isinstance(action.message.body, Status)


def _place(action: Action) -> int:
    match action:
        case OrderVehicle():
            return 0
        case PublishLast():
            return 2
        case _:
            return 1
