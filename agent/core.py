"""Claim, fly, serve and release the tasks of one UAV: events in, actions out.

The core owns one replica of the shared registers and its UAV's claim. It learns
before it prepares its vehicle, decides whenever it is free, gives way to stronger
claims, and goes home when the mission has ended. Leaves out: which task to take
(agent.deciding), flying (agent.vehicle) and transport (agent.runner).
"""

from __future__ import annotations

from dataclasses import replace

from agent.deciding import Turn, decide, ranks, rule_of
from agent.events import Action, Event, Order
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
from swarm.allocation.lower_level import Rule
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
    Publish,
    Stop,
    Tick,
)
from swarm.model.ids import COORDINATOR
from swarm.state.board import TaskBoard, TaskState, doable
from swarm.state.claims import winner
from swarm.state.membership import Membership
from swarm.state.registers import Replica
from swarm.state.voice import Voice
from swarm.wire.messages import (
    Board,
    Body,
    Brief,
    Claim,
    ClaimPhase,
    Epoch,
    EpochPhase,
    Fleet,
    Message,
    Outcome,
    Point,
    Result,
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
        self.phase = StatusPhase.LEARNING
        self.dropped = 0
        """Messages the shell has dropped so far; goes out with the status."""
        self._timing = timing
        self._voice = Voice(mission, uav, incarnation)
        self._membership = Membership(timing)
        self._actions: list[Action] = []
        self._board = TaskBoard(self.replica, mission)
        self._learned = False
        self._rule: Rule | None = None
        self._rule_epoch: int | None = None
        self._zero_s: float | None = None
        self._free_since_s = 0.0
        self._telemetry: Telemetry | None = None
        self._place_enu_m: Point | None = None
        self._leg = 0
        self._excluded: set[str] = set()
        self._idle_since_s: dict[str, float] = {}
        self._awake_since_s = 0.0
        self._adrift = False
        self._announced = 0
        self._note = ""
        self._held_at_s: float | None = None
        self._served_at_s: float | None = None
        self._retry_at_s: float | None = None
        self._forsaken_since_s: float | None = None
        self._ask_at_s: float | None = None
        self._announce_at_s: float | None = None
        self._status_at_s = 0.0

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
        self._handle(event, now_s)
        if self.phase is not StatusPhase.HOME:
            self._advance(now_s)
        return self._drain()

    def next_deadline_s(self) -> float:
        """When `step` wants a `Tick` at the latest.

        Only what the present phase acts upon counts: a deadline that nobody heeds
        would be past for ever.
        """
        deadlines = [self._membership.next_deadline_s(), self._announce_at_s, self._status_at_s]
        if self.phase is StatusPhase.LEARNING:
            deadlines.append(self._ask_at_s)
        if self._airborne or self.phase is StatusPhase.OUT:
            deadlines.append(self._forsaken_until_s)
        if self._airborne and self._running:
            deadlines += [self._held_at_s, self._served_at_s, self._retry_at_s]
        return min(deadline for deadline in deadlines if deadline is not None)

    def snapshot(self, now_s: float) -> Snapshot:
        """What this process answers for: its own registers, and those of the absent."""
        writers = {self.uav} | (self.replica.writers() - self._membership.present)
        messages = tuple(self.replica.messages(writers))
        mission_s = None if self._zero_s is None else now_s - self._zero_s
        return Snapshot(self._voice.mission, self.uav, mission_s, messages)

    @property
    def claim(self) -> Claim | None:
        """This UAV's claim register; None before the vehicle is airborne."""
        return self.replica.claims.get(self.uav) if self._airborne else None

    # -- events -------------------------------------------------------------------

    def _handle(self, event: Event, now_s: float) -> None:
        match event:
            case Heard(message):
                self._take_in(message, now_s)
                if isinstance(message.body, Epoch):
                    self._set_clock(message.body, now_s)
            case Learned(snapshots):
                self._learn(snapshots, now_s)
            case PeerSeen(writer):
                if self._membership.seen(writer) and self._learned and writer != self.uav:
                    self._announce(now_s)
                    if writer == COORDINATOR:
                        self._ask(now_s)
            case PeerGone(writer):
                self._membership.gone(writer, now_s)
            case LinkChanged(up):
                self._membership.link(up, now_s)
                if up and self._learned:
                    self._ask(now_s)
            case Stop(reason):
                self._go_home(reason, now_s)
            case Tick():
                pass
            case VehicleReady():
                self._become_airborne(now_s)
            case NotReady(reason):
                self._note = reason
                self._actions.append(Note("vehicle not ready", {"reason": reason}))
            case Arrived(leg):
                self._arrive(leg, now_s)
            case Telemetry() as telemetry:
                self._telemetry = telemetry
                self._place_enu_m = self._below_layer(telemetry.position_enu_m)
            case Refused(order, reason):
                self._give_up_order(order, reason, now_s)
            case HandedOver(reason):
                self._hand_over(reason, now_s)
            case Home():
                self._come_home(now_s)

    def _take_in(self, message: Message, now_s: float) -> None:
        if message.writer == self.uav:
            # An echo of an earlier life: never say less than others remember.
            self._voice.outdo(message.stamp)
            if isinstance(message.body, Outcome):
                self.replica.join(message)
            return
        if not self.replica.join(message):
            return
        match message.body:
            case Brief() | Board():
                self._awake(now_s)
            case Claim(phase=ClaimPhase.IDLE):
                self._idle_since_s[message.writer] = now_s
            case Claim(phase=ClaimPhase.OUT) | Outcome(result=Result.FAILED):
                self._awake(now_s)
            case _:
                pass

    def _learn(self, snapshots: tuple[Snapshot, ...], now_s: float) -> None:
        for snapshot in snapshots:
            for message in snapshot.messages:
                self._take_in(message, now_s)
        epoch = self.replica.epoch
        known = [s.mission_s for s in snapshots if s.mission_s is not None]
        if self._zero_s is None and known and epoch is not None:
            self._zero_s = now_s - max(known)
        self._learned = True

    def _set_clock(self, epoch: Epoch, now_s: float) -> None:
        if self._zero_s is None and epoch.phase is EpochPhase.RUNNING:
            self._zero_s = now_s - epoch.mission_s
            self._awake_since_s = now_s
            self._actions.append(Note("mission runs", {"mission_s": epoch.mission_s}))

    def _become_airborne(self, now_s: float) -> None:
        if self.phase is not StatusPhase.PREPARING:
            return
        self.phase, self._note = StatusPhase.IDLE, ""
        self._free_since_s = self._mission_s(now_s) if self._zero_s is not None else 0.0
        if self._place_enu_m is None and (me := self._me()) is not None:
            self._place_enu_m = me.position_enu_m
        self._publish_idle()
        self._actions.append(Note("airborne at the start"))

    def _arrive(self, leg: int, now_s: float) -> None:
        task = self._task()
        if leg != self._leg or task is None or self.phase is not StatusPhase.FLYING:
            return
        self.phase = StatusPhase.SERVING
        self._place_enu_m = task.position_enu_m
        self._served_at_s = now_s + task.service_s

    def _give_up_order(self, order: object, reason: str, now_s: float) -> None:
        self._actions.append(Note("vehicle refused", {"order": str(order), "reason": reason}))
        if isinstance(order, GoTo) and order.leg == self._leg:
            task = self._task()
            if task is not None:
                self._excluded.add(task.task)
                self._release(f"vehicle refused: {reason}", now_s)
        elif isinstance(order, Prepare | Return):
            self._hand_over(reason, now_s)

    def _hand_over(self, reason: str, now_s: float) -> None:
        if self.phase is StatusPhase.HOME:
            return
        if self.phase is StatusPhase.RETURNING:
            # It was told to come home; nobody here can see whether it does.
            self.phase = StatusPhase.HOME
            self._actions += [Note("not seen landing", {"reason": reason}), Finish(1)]
            return
        self._say_out(now_s)
        self.phase, self._note = StatusPhase.OUT, reason[:200]
        self._actions.append(Note("vehicle handed over", {"reason": reason}))

    def _come_home(self, now_s: float) -> None:
        if self.phase is StatusPhase.RETURNING:
            self.phase = StatusPhase.HOME
            self._actions.append(Publish(self._voice.say(self._status(now_s))))
            self._actions += [Note("landed at home"), Finish(0)]

    # -- what follows from the state ------------------------------------------------

    def _advance(self, now_s: float) -> None:
        for writer in self._membership.lost(now_s):
            claim = self.replica.claims.get(writer)
            left = claim is not None and claim.phase is ClaimPhase.OUT
            self._actions.append(Note("left" if left else "lost", {"writer": writer}))
            self._awake(now_s)
        if self.phase is StatusPhase.LEARNING:
            self._prepare(now_s)
        self._finish_if_over(now_s)
        if self._airborne and self._running:
            self._serve(now_s)
            self._keep_or_lose_claim(now_s)
            if self.phase is StatusPhase.IDLE:
                self._decide(now_s)
        self._repeat(now_s)

    def _prepare(self, now_s: float) -> None:
        me = self._me()
        if self._learned and me is not None:
            self.phase = StatusPhase.PREPARING
            self._actions.append(
                Order(Prepare(self._in_layer(me.position_enu_m), me.speed_m_s)),
            )
        elif self._ask_at_s is not None and self._ask_at_s <= now_s:
            missing = self.replica.brief is None
            waits = "waiting for the coordinator's brief" if missing else "not in the brief"
            if self._note != waits:
                self._note = waits
                self._actions.append(Note(waits, {"uav": self.uav}))
            self._ask(now_s)

    def _finish_if_over(self, now_s: float) -> None:
        if self.phase in (StatusPhase.RETURNING, StatusPhase.HOME):
            return
        epoch = self.replica.epoch
        if epoch is not None and epoch.phase is EpochPhase.ENDED and self._learned:
            self._go_home(epoch.reason, now_s)
        elif self._forsaken(now_s):
            self._go_home("no coordinator and nothing left to do", now_s)

    def _forsaken(self, now_s: float) -> bool:
        """Whether there has been neither a coordinator nor anything to do for long enough."""
        present = self._membership.present
        waiting = self.phase is StatusPhase.IDLE and not self._running
        finished = self._running and not doable(self._board, present | {self.uav})
        if COORDINATOR in present or not (waiting or finished):
            self._forsaken_since_s = None
            return False
        if self._forsaken_since_s is None:
            self._forsaken_since_s = now_s
        return self._forsaken_until_s is not None and self._forsaken_until_s <= now_s

    @property
    def _forsaken_until_s(self) -> float | None:
        if self._forsaken_since_s is None:
            return None
        patience_s = self._timing.linger_s if self._running else self._timing.abandon_s
        return self._forsaken_since_s + patience_s

    def _serve(self, now_s: float) -> None:
        task = self._task()
        if self._served_at_s is None or task is None or self._served_at_s > now_s:
            return
        self._served_at_s = None
        mission_s = self._mission_s(now_s)
        earlier = self.replica.outcomes.get((self.uav, task.task))
        attempt = 1 if earlier is None else earlier.attempt + 1
        self._publish(Outcome(task.task, Result.DONE, attempt, mission_s))
        self._actions.append(Note("task done", {"task": task.task, "mission_s": mission_s}))
        self._become_free(mission_s)
        # The next claim, made in this same step, replaces the old one on the bus.

    def _keep_or_lose_claim(self, now_s: float) -> None:
        claim, task = self.claim, self._task()
        if claim is None or task is None or self.phase is StatusPhase.IDLE:
            return
        state = self._board.states.get(task.task)
        rival = self._winner(task.task)
        if state is not TaskState.OPEN:
            self._release(f"task is {state}", now_s)
        elif rival != self.uav:
            self._release(f"{rival} has the stronger claim", now_s)
        elif self._held_at_s is not None and self._held_at_s <= now_s:
            self._held_at_s = None
            self._publish(replace(claim, phase=ClaimPhase.HELD))

    def _decide(self, now_s: float) -> None:
        epoch, problem, place = self.replica.epoch, self._board.problem, self._place_enu_m
        if epoch is None or problem is None or place is None or self.uav not in problem.uav_ids:
            return
        rule = self._rule_of(epoch)
        if rule is None:
            return
        turn = Turn(
            uav=self.uav,
            now_s=self._mission_s(now_s),
            decided_s=self._free_since_s,
            place_enu_m=place,
            present=self._membership.present,
            awaited=self._awaited(now_s),
            excluded=self._excluded,
        )
        decision = decide(problem, self._board, rule, turn)
        if decision is None:
            self._stay_idle(now_s)
            return
        task = self.replica.board[problem.task_ids[decision.task]]
        rank = ranks(epoch.sequence, problem.uav_ids)[self.uav]
        self.phase = StatusPhase.FLYING
        self._retry_at_s, self._adrift = None, False
        self._leg += 1
        self._held_at_s = now_s + self._timing.objection_window_s
        claim = Claim(
            ClaimPhase.PROPOSED, task.task, self._free_since_s, rank, decision.completion_s
        )
        self._actions.append(Order(GoTo(self._leg, self._in_layer(task.position_enu_m))))
        self._publish(claim)
        self._actions.append(
            Note(
                "decided",
                {
                    "task": task.task,
                    "score": decision.score,
                    "second_score": decision.second_score,
                    "certificate": decision.certificate,
                    "completion_s": decision.completion_s,
                },
            )
        )

    def _rule_of(self, epoch: Epoch) -> Rule | None:
        if self._rule_epoch != epoch.number:
            self._rule, self._rule_epoch = rule_of(epoch), epoch.number
            if self._rule is None:
                self._note = f"cannot decide by rule {epoch.rule}"
                self._actions.append(Note("unknown rule", {"rule": epoch.rule}))
        return self._rule

    def _stay_idle(self, now_s: float) -> None:
        claim = self.claim
        if claim is not None and claim.phase is not ClaimPhase.IDLE:
            self._publish_idle()
        if self._adrift and self._telemetry is not None:
            # Nothing to fly to any more: stop here rather than at a lost target.
            self._leg += 1
            self._actions.append(Order(GoTo(self._leg, self._telemetry.position_enu_m)))
        self._adrift = False
        patience_ends_s = [self._patience_ends_s(uav) for uav in self._awaited(now_s)]
        self._retry_at_s = min(patience_ends_s, default=None)

    # -- pieces ---------------------------------------------------------------------

    @property
    def _airborne(self) -> bool:
        return self.phase in (StatusPhase.IDLE, StatusPhase.FLYING, StatusPhase.SERVING)

    @property
    def _running(self) -> bool:
        epoch = self.replica.epoch
        running = epoch is not None and epoch.phase is EpochPhase.RUNNING
        return running and self._zero_s is not None

    def _mission_s(self, now_s: float) -> float:
        if self._zero_s is None:
            raise ValueError("mission time is not known yet")
        return now_s - self._zero_s

    def _me(self) -> Fleet | None:
        brief = self.replica.brief
        fleet = () if brief is None else brief.uavs
        return next((uav for uav in fleet if uav.id == self.uav), None)

    def _task(self) -> Board | None:
        claim = self.claim
        return None if claim is None or claim.task is None else self.replica.board.get(claim.task)

    def _in_layer(self, point: Point) -> Point:
        me = self._me()
        return point[0], point[1], point[2] + (0.0 if me is None else me.layer_m)

    def _below_layer(self, point: Point) -> Point:
        me = self._me()
        return point[0], point[1], point[2] - (0.0 if me is None else me.layer_m)

    def _winner(self, task: str) -> str | None:
        present = self._membership.present | {self.uav}
        claims = self.replica.claims.items()
        return winner((uav, c) for uav, c in claims if c.task == task and uav in present)

    def _patience_ends_s(self, uav: str) -> float:
        since_s = max(self._idle_since_s.get(uav, 0.0), self._awake_since_s)
        return since_s + self._timing.patience_s

    def _awaited(self, now_s: float) -> set[str]:
        """Free peers that may still be expected to decide in their turn."""
        return {
            uav
            for uav, claim in self.replica.claims.items()
            if claim.phase is ClaimPhase.IDLE
            and uav != self.uav
            and uav in self._membership.present
            and now_s < self._patience_ends_s(uav)
        }

    def _awake(self, now_s: float) -> None:
        """A task may have opened: everyone who is free decides anew, in sequence order."""
        self._awake_since_s = now_s
        if self.phase is StatusPhase.IDLE and self._running:
            self._free_since_s = self._mission_s(now_s)

    def _become_free(self, free_since_s: float) -> None:
        self.phase = StatusPhase.IDLE
        self._free_since_s = free_since_s
        self._held_at_s = self._served_at_s = None

    def _release(self, reason: str, now_s: float) -> None:
        """Give the task up; a claim lost while only proposed keeps its place in the order."""
        claim = self.claim
        if claim is None:
            return
        self._actions.append(Note("released", {"task": claim.task, "reason": reason}))
        proposed = claim.phase is ClaimPhase.PROPOSED
        self._become_free(claim.decided_s if proposed else self._mission_s(now_s))
        self._adrift = True

    def _go_home(self, reason: str, now_s: float) -> None:
        if self.phase in (StatusPhase.RETURNING, StatusPhase.HOME):
            return
        if self.phase is StatusPhase.OUT:
            # The vehicle is not ours to command any more.
            self.phase = StatusPhase.HOME
            self._actions.append(Finish(0))
            return
        self._say_out(now_s)
        self.phase, self._note = StatusPhase.RETURNING, reason[:200]
        self._actions += [Note("returning", {"reason": reason}), Order(Return(reason))]

    # -- saying ---------------------------------------------------------------------

    def _say_out(self, now_s: float) -> None:
        mission_s = 0.0 if self._zero_s is None else self._mission_s(now_s)
        self._become_free(mission_s)
        self._publish(Claim(ClaimPhase.OUT, None, mission_s, 0, mission_s))

    def _publish_idle(self) -> None:
        since_s = self._free_since_s
        self._publish(Claim(ClaimPhase.IDLE, None, since_s, 0, since_s))

    def _publish(self, body: Body) -> None:
        message = self._voice.say(body)
        self.replica.join(message)
        self._actions.append(Publish(message))

    def _announce(self, now_s: float) -> None:
        """Repeat the own registers, so that what got lost on the way arrives after all."""
        own = [m for m in self.replica.messages({self.uav}) if m.stamp.incarnation]
        claims = [message for message in own if isinstance(message.body, Claim)]
        outcomes = [message for message in own if isinstance(message.body, Outcome)]
        if outcomes:
            self._announced = (self._announced + 1) % len(outcomes)
            claims.append(outcomes[self._announced])
        self._actions += [Publish(message) for message in claims]
        self._announce_at_s = now_s + self._timing.announce_s

    def _repeat(self, now_s: float) -> None:
        if self._learned and (self._announce_at_s is None or self._announce_at_s <= now_s):
            self._announce(now_s)
        if self._status_at_s <= now_s:
            self._status_at_s = now_s + self._timing.status_s
            self._actions.append(Publish(self._voice.say(self._status(now_s))))

    def _status(self, now_s: float) -> Status:
        claim, telemetry = self.claim, self._telemetry
        return Status(
            phase=self.phase,
            task=None if claim is None else claim.task,
            position_enu_m=self._place_enu_m,
            velocity_enu_m_s=None if telemetry is None else telemetry.velocity_enu_m_s,
            battery_frac=None if telemetry is None else telemetry.battery_frac,
            mission_s=None if self._zero_s is None else self._mission_s(now_s),
            dropped=self.dropped + self.replica.stale,
            note=self._note[:200],
        )

    def _ask(self, now_s: float) -> None:
        self._ask_at_s = now_s + self._timing.ask_s
        self._actions.append(Ask())

    def _drain(self) -> list[Action]:
        actions, self._actions = self._actions, []
        return actions
