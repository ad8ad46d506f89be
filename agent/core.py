"""The life of one UAV's agent, from learning to landing: events in, actions out.

The core owns one replica of the shared registers. It learns before it prepares its
vehicle, takes tasks while that is airborne in a running mission, and goes home when
the mission has ended. Leaves out: tasks and claims (agent.tasking), when the mission
is over (agent.ending), the mission as such (agent.picture), what it makes of the
others (agent.peers), when it repeats itself (agent.speech), flying (agent.vehicle)
and transport (agent.runner).
"""

from __future__ import annotations

from collections.abc import Mapping

from agent.ending import Ending
from agent.events import Action, Event, Order
from agent.peers import Peers
from agent.picture import News, Picture
from agent.speech import Speech
from agent.tasking import Tasking
from agent.vehicle import (
    Arrived,
    GoTo,
    HandedOver,
    Home,
    NotReady,
    Prepare,
    Refused,
    Return,
    Telemetry,
    VehicleReady,
)
from swarm.config import Timing
from swarm.events import (
    Ask,
    Finish,
    Heard,
    Learned,
    LinkChanged,
    Note,
    PeerGone,
    PeerSeen,
    Stop,
    Tick,
)
from swarm.model.ids import COORDINATOR
from swarm.state.registers import Replica
from swarm.state.voice import Voice
from swarm.wire.messages import (
    Claim,
    ClaimPhase,
    Epoch,
    EpochPhase,
    Message,
    Snapshot,
    Status,
    StatusPhase,
)

__all__ = ["AgentCore"]


class AgentCore:
    """The agent of one UAV.

    Args:
        mission: mission name.
        uav: id of the UAV this agent flies.
        incarnation: greater than in any earlier life of this agent.
        timing: timers, in the seconds of ``now_s``.
    """

    def __init__(self, mission: str, uav: str, incarnation: int, timing: Timing) -> None:
        self.uav = uav
        self.replica = Replica()
        self.dropped: Mapping[str, int] = {}
        """Messages the shell has dropped so far, by reason; goes out with the status."""
        self._mission = mission
        self._timing = timing
        self._speech = Speech(Voice(mission, uav, incarnation), self.replica, timing)
        self._peers = Peers(uav, timing)
        self._picture = Picture(mission, uav, self.replica)
        self._tasking = Tasking(uav, self.replica, self._picture, self._peers, self._speech, timing)
        self._ending = Ending(self.replica, self._picture, self._peers, timing)
        self._actions: list[Action] = []
        self._stage = StatusPhase.LEARNING
        self._learned = False
        self._finished = False
        self._ask_at_s: float | None = None

    # -- the one entry point ------------------------------------------------------

    def start(self, now_s: float) -> list[Action]:
        """What to do first."""
        self._ask(now_s)
        return self._drain()

    def step(self, event: Event, now_s: float) -> list[Action]:
        """React to one event.

        Args:
            event: what happened.
            now_s: now, on this process's own clock [s]; never decreases.
        """
        if not self._finished:
            self._handle(event, now_s)
        if not self._finished:
            self._advance(now_s)
        return self._drain()

    def next_deadline_s(self) -> float | None:
        """When `step` wants a `Tick` at the latest; None when it has finished.

        Each deadline is None from the moment on at which nobody would heed it any
        more: one that stayed would be past for ever.
        """
        if self._finished:
            return None
        deadlines = (
            self._peers.membership.next_deadline_s(),
            self._speech.next_deadline_s(),
            self._tasking.next_deadline_s(),
            self._ending.next_deadline_s(),
            self._ask_at_s,
        )
        return min((at_s for at_s in deadlines if at_s is not None), default=None)

    def snapshot(self, now_s: float) -> Snapshot:
        """What this process answers for: its own registers, and those of who cannot."""
        writers = {self.uav} | (self.replica.writers() - self._peers.membership.steady)
        messages = tuple(self.replica.messages(writers))
        mission_s = self._picture.known_mission_s(now_s)
        return Snapshot(self._mission, self.uav, self._speech.incarnation, mission_s, messages)

    @property
    def phase(self) -> StatusPhase:
        """What the UAV is doing."""
        return self._tasking.phase or self._stage

    @property
    def claim(self) -> Claim | None:
        """This UAV's claim register; None before the vehicle is airborne."""
        return self._tasking.claim

    # -- events -------------------------------------------------------------------

    def _handle(self, event: Event, now_s: float) -> None:
        match event:
            case Heard(message):
                self._peers.membership.heard(message.writer, now_s)
                self._take_in(message, now_s)
                if isinstance(message.body, Claim | Epoch):
                    self._peers.spoke(message.writer)
                if isinstance(message.body, Epoch):
                    self._set_clock(message.body, now_s)
            case Learned(snapshots):
                self._learn(snapshots, now_s)
            case PeerSeen(writer):
                if (
                    self._peers.membership.seen(writer, now_s)
                    and self._learned
                    and writer != self.uav
                ):
                    self._actions += self._speech.announce(now_s)
                    if writer == COORDINATOR:
                        self._ask(now_s)
            case PeerGone(writer):
                self._peers.membership.gone(writer, now_s)
            case LinkChanged(up):
                self._peers.membership.link(up, now_s)
                if up and self._learned:
                    self._actions += self._speech.announce(now_s)
                    self._ask(now_s)
            case Stop(reason):
                self._go_home(reason, now_s)
            case Tick():
                pass
            case VehicleReady():
                self._become_airborne(now_s)
            case NotReady(reason):
                self._speech.note = reason
                self._actions.append(Note("vehicle not ready", {"reason": reason}))
            case Arrived(leg):
                self._tasking.arrive(leg, now_s)
            case Telemetry() as telemetry:
                self._picture.move(telemetry)
            case Refused(order, reason):
                self._give_up_order(order, reason, now_s)
            case HandedOver(reason):
                self._hand_over(reason, now_s)
            case Home():
                self._come_home(now_s)

    def _take_in(self, message: Message, now_s: float) -> None:
        if message.writer == self.uav:
            self._actions += self._speech.hear_echo(message)
            return
        news = self._picture.take_in(message)
        if news is None:
            return
        self._peers.stated(message.writer, message.body, now_s)
        if news is News.OPENING:
            self._awake(now_s)
        elif news is News.CLAIM:
            self._tasking.peer_claimed(now_s)

    def _learn(self, snapshots: tuple[Snapshot, ...], now_s: float) -> None:
        for snapshot in snapshots:
            for message in snapshot.messages:
                self._take_in(message, now_s)
        known = [s.mission_s for s in snapshots if s.mission_s is not None]
        if known and self.replica.epoch is not None:
            self._picture.set_clock(max(known), now_s)
        self._learned = True

    def _set_clock(self, epoch: Epoch, now_s: float) -> None:
        runs = epoch.phase is EpochPhase.RUNNING
        if runs and self._picture.set_clock(epoch.mission_s, now_s):
            self._awake(now_s)
            self._actions.append(Note("mission runs", {"mission_s": epoch.mission_s}))

    def _become_airborne(self, now_s: float) -> None:
        if self.phase is not StatusPhase.PREPARING:
            return
        self._speech.note = ""
        me = self._picture.me
        if self._picture.place_enu_m is None and me is not None:
            self._picture.place_enu_m = me.position_enu_m
        self._actions += self._tasking.begin(now_s)
        self._actions.append(Note("airborne at the start"))

    def _give_up_order(self, order: object, reason: str, now_s: float) -> None:
        self._actions.append(Note("vehicle refused", {"order": str(order), "reason": reason}))
        if isinstance(order, GoTo):
            self._actions += self._tasking.refuse(order.leg, reason, now_s)
        elif isinstance(order, Prepare | Return):
            self._hand_over(reason, now_s)

    def _hand_over(self, reason: str, now_s: float) -> None:
        if self.phase is StatusPhase.OUT:
            return
        self._actions.append(Note("vehicle handed over", {"reason": reason}))
        returning = self.phase is StatusPhase.RETURNING
        if not returning:
            self._take_no_more_tasks(now_s)
        self._stage, self._speech.note = StatusPhase.OUT, reason[:200]
        if returning:
            # It was told to come home; nobody here can see whether it does.
            self._finish(1, now_s)

    def _come_home(self, now_s: float) -> None:
        if self.phase is StatusPhase.RETURNING:
            self._stage = StatusPhase.HOME
            self._actions.append(Note("landed at home"))
            self._finish(0, now_s)

    # -- what follows from the state ------------------------------------------------

    def _advance(self, now_s: float) -> None:
        for writer in self._peers.membership.lost(now_s):
            claim = self.replica.claims.get(writer)
            left = claim is not None and claim.phase is ClaimPhase.OUT
            self._actions.append(Note("left" if left else "lost", {"writer": writer}))
            self._awake(now_s)
            if writer == COORDINATOR and self._learned and not self._picture.running:
                self._ask(now_s)  # others may have heard its last words
        self._go_home_if_over(now_s)
        if self.phase is StatusPhase.LEARNING:
            self._prepare(now_s)
        if self._tasking.phase is not None and self._picture.running:
            self._actions += self._tasking.advance(now_s)
        if not self._finished:
            self._actions += self._speech.repeat(
                lambda: self._status(now_s), now_s, learned=self._learned
            )

    def _prepare(self, now_s: float) -> None:
        me = self._picture.me
        if self._learned and me is not None:
            self._stage, self._ask_at_s = StatusPhase.PREPARING, None
            self._actions.append(
                Order(Prepare(self._picture.in_layer(me.position_enu_m), me.speed_m_s)),
            )
        elif self._ask_at_s is not None and self._ask_at_s <= now_s:
            missing = self.replica.brief is None
            waits = "waiting for the coordinator's brief" if missing else "not in the brief"
            if self._speech.note != waits:
                self._speech.note = waits
                self._actions.append(Note(waits, {"uav": self.uav}))
            self._ask(now_s)

    def _go_home_if_over(self, now_s: float) -> None:
        if self.phase is StatusPhase.RETURNING or not self._learned:
            return
        reason = self._ending.reason(self.phase, now_s, undecided=self._tasking.undecided)
        if reason is not None:
            self._go_home(reason, now_s)

    # -- pieces ---------------------------------------------------------------------

    def _awake(self, now_s: float) -> None:
        """A task may have opened: everyone who is free decides anew, in sequence order."""
        self._peers.awake(now_s)
        self._tasking.wake(now_s)

    def _go_home(self, reason: str, now_s: float) -> None:
        if self.phase is StatusPhase.OUT:
            # The vehicle is not ours to command any more.
            self._finish(0, now_s)
        elif self.phase is not StatusPhase.RETURNING:
            self._take_no_more_tasks(now_s)
            self._ending.settle()
            self._stage, self._speech.note = StatusPhase.RETURNING, reason[:200]
            self._actions += [Note("returning", {"reason": reason}), Order(Return(reason))]

    def _finish(self, status: int, now_s: float) -> None:
        self._actions += [self._speech.say(self._status(now_s)), Finish(status)]
        self._finished = True

    def _take_no_more_tasks(self, now_s: float) -> None:
        self._ask_at_s = None
        self._actions += self._tasking.end(now_s)

    def _status(self, now_s: float) -> Status:
        claim, telemetry = self.claim, self._picture.telemetry
        stale = self.replica.stale
        return Status(
            phase=self.phase,
            task=None if claim is None else claim.task,
            position_enu_m=self._picture.place_enu_m,
            velocity_enu_m_s=None if telemetry is None else telemetry.velocity_enu_m_s,
            battery_frac=None if telemetry is None else telemetry.battery_frac,
            mission_s=self._picture.known_mission_s(now_s),
            dropped={**self.dropped, **({"stale": stale} if stale else {})},
            note=self._speech.note[:200],
        )

    def _ask(self, now_s: float) -> None:
        if self.phase is StatusPhase.LEARNING:
            self._ask_at_s = now_s + self._timing.ask_s
        self._actions.append(Ask())

    def _drain(self) -> list[Action]:
        actions, self._actions = self._actions, []
        return actions
