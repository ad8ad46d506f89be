"""Claim, fly, serve and release the tasks of one UAV: events in, actions out.

The core owns one replica of the shared registers and its UAV's claim. It learns
before it prepares its vehicle, decides whenever it is free, gives way to stronger
claims, and goes home when the mission has ended. Leaves out: which task to take
(agent.deciding), what it makes of the others (agent.peers), when it repeats itself
(agent.speech), flying (agent.vehicle) and transport (agent.runner).
"""

from __future__ import annotations

from dataclasses import replace

from agent.deciding import Turn, decide, ranks, rule_of
from agent.events import Action, Event, Order
from agent.peers import Peers
from agent.speech import Speech
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
    Stop,
    Tick,
)
from swarm.model.ids import COORDINATOR
from swarm.state.board import TaskBoard, TaskState
from swarm.state.claims import winner
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
        self._mission = mission
        self._timing = timing
        self._speech = Speech(Voice(mission, uav, incarnation), self.replica, timing)
        self._peers = Peers(uav, timing)
        self._board = TaskBoard(self.replica, mission)
        self._actions: list[Action] = []
        self._learned = False
        self._rule: Rule | None = None
        self._rule_epoch: tuple[int, str] | None = None
        self._finished = False
        self._zero_s: float | None = None
        self._free_since_s = 0.0
        self._telemetry: Telemetry | None = None
        self._place_enu_m: Point | None = None
        self._leg = 0
        self._excluded: set[str] = set()
        self._adrift = False
        self._to_decide = False
        self._awaits_peers = False
        self._note = ""
        self._held_at_s: float | None = None
        self._served_at_s: float | None = None
        self._retry_at_s: float | None = None
        self._forsaken_at_s: float | None = None
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
            self._held_at_s,
            self._served_at_s,
            self._retry_at_s,
            self._forsaken_at_s,
            self._ask_at_s,
        )
        return min((at_s for at_s in deadlines if at_s is not None), default=None)

    def snapshot(self, now_s: float) -> Snapshot:
        """What this process answers for: its own registers, and those of who cannot."""
        writers = {self.uav} | (self.replica.writers() - self._peers.membership.steady)
        messages = tuple(self.replica.messages(writers))
        mission_s = None if self._zero_s is None else now_s - self._zero_s
        return Snapshot(self._mission, self.uav, mission_s, messages)

    @property
    def claim(self) -> Claim | None:
        """This UAV's claim register; None before the vehicle is airborne."""
        return self.replica.claims.get(self.uav) if self._airborne else None

    # -- events -------------------------------------------------------------------

    def _handle(self, event: Event, now_s: float) -> None:
        match event:
            case Heard(message):
                self._take_in(message, now_s)
                if isinstance(message.body, Claim | Epoch):
                    self._peers.spoke(message.writer)
                if isinstance(message.body, Epoch):
                    self._set_clock(message.body, now_s)
            case Learned(snapshots):
                self._learn(snapshots, now_s)
            case PeerSeen(writer):
                if self._peers.membership.seen(writer) and self._learned and writer != self.uav:
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
            self._actions += self._speech.hear_echo(message)
            return
        before, epoch = self.replica.claims.get(message.writer), self.replica.epoch
        if not self.replica.join(message):
            return
        if isinstance(message.body, Outcome):
            self._peers.turned_idle(message.writer, now_s)
        match message.body:
            case Brief() | Board() | Outcome(result=Result.FAILED):
                self._awake(now_s)
            case Claim() as claim:
                if claim.phase is ClaimPhase.IDLE:
                    self._peers.turned_idle(message.writer, now_s)
                if before is not None and before.task != claim.task and self._is_open(before.task):
                    self._awake(now_s)
                elif self._awaits_peers:
                    self._wake(now_s)
            case Epoch(number=number) if epoch is None or number != epoch.number:
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
            self._awake(now_s)
            self._actions.append(Note("mission runs", {"mission_s": epoch.mission_s}))

    def _become_airborne(self, now_s: float) -> None:
        if self.phase is not StatusPhase.PREPARING:
            return
        self._note = ""
        self._become_free(self._mission_s(now_s) if self._zero_s is not None else 0.0)
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
        if self.phase is StatusPhase.OUT:
            return
        self._actions.append(Note("vehicle handed over", {"reason": reason}))
        returning = self.phase is StatusPhase.RETURNING
        if not returning:
            self._say_out(now_s)
        self.phase, self._note = StatusPhase.OUT, reason[:200]
        if returning:
            # It was told to come home; nobody here can see whether it does.
            self._finish(1, now_s)

    def _come_home(self, now_s: float) -> None:
        if self.phase is StatusPhase.RETURNING:
            self.phase = StatusPhase.HOME
            self._actions.append(Note("landed at home"))
            self._finish(0, now_s)

    # -- what follows from the state ------------------------------------------------

    def _advance(self, now_s: float) -> None:
        for writer in self._peers.membership.lost(now_s):
            claim = self.replica.claims.get(writer)
            left = claim is not None and claim.phase is ClaimPhase.OUT
            self._actions.append(Note("left" if left else "lost", {"writer": writer}))
            self._awake(now_s)
            if writer == COORDINATOR and self._learned and not self._running:
                self._ask(now_s)  # others may have heard its last words
        self._go_home_if_over(now_s)
        if self.phase is StatusPhase.LEARNING:
            self._prepare(now_s)
        if self._airborne and self._running:
            self._serve(now_s)
            self._keep_or_lose_claim(now_s)
            if self._retry_at_s is not None and self._retry_at_s <= now_s:
                self._wake(now_s)
            if self.phase is StatusPhase.IDLE and self._to_decide:
                self._decide(now_s)
        if not self._finished:
            self._actions += self._speech.repeat(
                lambda: self._status(now_s), now_s, learned=self._learned
            )

    def _prepare(self, now_s: float) -> None:
        me = self._me()
        if self._learned and me is not None:
            self.phase, self._ask_at_s = StatusPhase.PREPARING, None
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

    def _go_home_if_over(self, now_s: float) -> None:
        epoch = self.replica.epoch
        if self.phase is StatusPhase.RETURNING or not self._learned:
            return
        if epoch is not None and epoch.phase is EpochPhase.ENDED:
            self._go_home(epoch.reason, now_s)
        elif self._forsaken(now_s):
            self._go_home("no coordinator and nothing left to do", now_s)

    def _forsaken(self, now_s: float) -> bool:
        """Whether there has been neither a coordinator nor anything to do for long enough."""
        waiting = self.phase is StatusPhase.IDLE and not self._running
        finished = self._running and self._nothing_to_do()
        if COORDINATOR in self._peers.membership.present or not (waiting or finished):
            self._forsaken_at_s = None
            return False
        if self._forsaken_at_s is None:
            patience_s = self._timing.abandon_s if waiting else self._timing.linger_s
            self._forsaken_at_s = now_s + patience_s
        return self._forsaken_at_s <= now_s

    def _nothing_to_do(self) -> bool:
        """Tasks may be open still: those that nobody who is there can or will take."""
        if TaskState.OPEN not in self._board.states.values():
            return True
        if self.phase is StatusPhase.IDLE:
            return not (self._to_decide or self._awaits_peers or self._peers_at_work())
        return self.phase is StatusPhase.OUT and not self._peers_at_work()

    def _peers_at_work(self) -> bool:
        credible = self._peers.credible
        return any(
            uav in credible and self._is_open(claim.task)
            for uav, claim in self.replica.claims.items()
        )

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
        # The next claim, made in this same step, replaces the old one on the bus.
        self._become_free(mission_s)

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
            self._stay_idle(now_s)
            return
        turn = Turn(
            uav=self.uav,
            now_s=self._mission_s(now_s),
            decided_s=self._free_since_s,
            place_enu_m=place,
            credible=self._peers.credible,
            awaited=self._peers.awaited(self.replica, now_s),
            patience_s=self._timing.patience_s,
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
        if self._rule_epoch != (epoch.number, epoch.rule):
            self._rule, self._rule_epoch = rule_of(epoch), (epoch.number, epoch.rule)
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
        self._adrift = self._to_decide = False
        patience_ends_s = self._peers.patience_ends_s(self.replica, now_s)
        self._awaits_peers = patience_ends_s is not None
        # Look again by and by while anything is open, lest a lost message strand it.
        unfinished = TaskState.OPEN in self._board.states.values()
        again_s = now_s + self._timing.announce_s if unfinished else None
        self._retry_at_s = patience_ends_s if patience_ends_s is not None else again_s

    # -- pieces ---------------------------------------------------------------------

    @property
    def _airborne(self) -> bool:
        return self.phase in (StatusPhase.IDLE, StatusPhase.FLYING, StatusPhase.SERVING)

    @property
    def _running(self) -> bool:
        epoch = self.replica.epoch
        over = epoch is None or epoch.phase is EpochPhase.ENDED
        return self._zero_s is not None and not over

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
        rivals = {*self._peers.credible, self.uav}
        claims = self.replica.claims.items()
        return winner((uav, c) for uav, c in claims if c.task == task and uav in rivals)

    def _is_open(self, task: str | None) -> bool:
        return task is not None and self._board.states.get(task) is TaskState.OPEN

    def _awake(self, now_s: float) -> None:
        """A task may have opened: everyone who is free decides anew, in sequence order."""
        self._peers.awake(now_s)
        self._wake(now_s)

    def _wake(self, now_s: float) -> None:
        """Decide anew when free; who found nothing before takes no precedence from that."""
        self._retry_at_s = None
        if self.phase is StatusPhase.IDLE and not self._to_decide:
            self._to_decide = True
            if self._running:
                self._free_since_s = self._mission_s(now_s)

    def _become_free(self, free_since_s: float) -> None:
        self.phase, self._to_decide = StatusPhase.IDLE, True
        self._free_since_s = free_since_s
        self._held_at_s = self._served_at_s = self._retry_at_s = None

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
        if self.phase is StatusPhase.OUT:
            # The vehicle is not ours to command any more.
            self._finish(0, now_s)
        elif self.phase is not StatusPhase.RETURNING:
            self._say_out(now_s)
            self._forsaken_at_s = None
            self.phase, self._note = StatusPhase.RETURNING, reason[:200]
            self._actions += [Note("returning", {"reason": reason}), Order(Return(reason))]

    def _finish(self, status: int, now_s: float) -> None:
        self._actions += [self._speech.say(self._status(now_s)), Finish(status)]
        self._finished = True

    # -- saying ---------------------------------------------------------------------

    def _say_out(self, now_s: float) -> None:
        mission_s = 0.0 if self._zero_s is None else self._mission_s(now_s)
        self._become_free(mission_s)
        self._ask_at_s = None
        self._publish(Claim(ClaimPhase.OUT, None, mission_s, 0, mission_s))

    def _publish_idle(self) -> None:
        since_s = self._free_since_s
        self._publish(Claim(ClaimPhase.IDLE, None, since_s, 0, since_s))

    def _publish(self, body: Body) -> None:
        self._actions.append(self._speech.say(body))

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
        if self.phase is StatusPhase.LEARNING:
            self._ask_at_s = now_s + self._timing.ask_s
        self._actions.append(Ask())

    def _drain(self) -> list[Action]:
        actions, self._actions = self._actions, []
        return actions
