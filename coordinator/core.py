"""The coordinator's decisions: task board, membership, epochs; events in, actions out.

It briefs the fleet, plans while the vehicles get ready, starts the mission when all
are airborne (or given up), posts pop-ups when their time comes, and ends the
mission when nothing is left that anybody could do. The fleet needs it for none of
its own decisions. Leaves out: how plans are made (coordinator.planner), transport
(coordinator.daemon).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from coordinator.events import Action, Event, MakePlan, PlanFailed, PlanMade
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
from swarm.model import Mission, Origin, Plan, Task, UavId
from swarm.model.frames import DEFAULT_ORIGIN
from swarm.model.ids import COORDINATOR
from swarm.state.board import TaskBoard, TaskState, doable
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
    Snapshot,
)

__all__ = ["CoordinatorCore", "FlightLayers"]


@dataclass(frozen=True, slots=True)
class FlightLayers:
    """Heights at which the UAVs fly, each its own.

    Raises:
        ValueError: a height is not positive.
    """

    lowest_m: float = 10.0
    """Height of the first UAV's layer above the places it visits [m]."""
    spacing_m: float = 3.0
    """Distance between neighbouring layers [m]."""

    def __post_init__(self) -> None:
        if not (self.lowest_m > 0.0 and self.spacing_m >= 0.0):
            raise ValueError(f"layers need lowest_m > 0 and spacing_m >= 0, not {self}")

    def layer_m(self, index: int) -> float:
        """Layer of the UAV with that place in the scenario [m]."""
        return self.lowest_m + index * self.spacing_m


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
    ) -> None:
        self.replica = Replica()
        self.plan: Plan | None = None
        """The plan the current epoch stands on."""
        self._mission = mission
        self._method = method
        self._seed = seed
        self._timing = timing
        self._start_timeout_s = start_timeout_s
        self._layers = layers
        self._voice = Voice(mission.name, COORDINATOR, incarnation)
        self._membership = Membership(timing)
        self._board = TaskBoard(self.replica, mission.name)
        self._actions: list[Action] = []
        self._zero_s: float | None = None
        self._request = 0
        self._planned_for: tuple[UavId, ...] = ()
        self._start_by_s: float | None = None
        self._stalemate_at_s: float | None = None
        self._announce_at_s = 0.0
        self._leave_at_s: float | None = None
        self._announced = 0
        self._finished = False

    def start(self, now_s: float) -> list[Action]:
        """Brief the fleet, post the tasks known at the start and begin to plan."""
        self._start_by_s = now_s + self._start_timeout_s
        self._announce_at_s = now_s + self._timing.announce_s
        self._say(_brief(self._mission, self._layers, self._voice.incarnation))
        self._post(now_s)
        self._make_plan(tuple(uav.id for uav in self._mission.uavs))
        return self._drain()

    def step(self, event: Event, now_s: float) -> list[Action]:
        """React to one event.

        Args:
            event: what happened.
            now_s: now, on this process's own clock [s]; never decreases.
        """
        match event:
            case Heard(message):
                self._membership.heard(message.writer, now_s)
                self.replica.join(message)
                if isinstance(message.body, Claim):
                    self._membership.spoke(message.writer)
            case Learned(snapshots):
                for snapshot in snapshots:
                    self.replica.join_all(snapshot.messages)
            case PeerSeen(writer):
                self._membership.seen(writer, now_s)
            case PeerGone(writer):
                self._membership.gone(writer, now_s)
            case LinkChanged(up):
                self._membership.link(up, now_s)
            case PlanMade(request, plan):
                if request == self._request:
                    self.plan = plan
            case PlanFailed(request, reason):
                if request == self._request:
                    self._end(f"no plan: {reason}", now_s)
            case Stop(reason):
                self._end(reason, now_s)
            case Tick():
                pass
        self._advance(now_s)
        return self._drain()

    def next_deadline_s(self) -> float | None:
        """When `step` wants a `Tick` at the latest; None when it has finished."""
        if self._finished:
            return None
        deadlines = [
            self._announce_at_s,
            self._membership.next_deadline_s(),
            self._start_by_s,
            self._stalemate_at_s,
            self._leave_at_s,
        ]
        if self._zero_s is not None and not self._ended:
            deadlines += [self._zero_s + task.appears_s for task in self._unposted()]
        return min(deadline for deadline in deadlines if deadline is not None)

    def snapshot(self, now_s: float) -> Snapshot:
        """What this process answers for: its own registers, and those of who cannot."""
        writers = {COORDINATOR} | (self.replica.writers() - self._membership.steady)
        mission_s = None if self._zero_s is None else now_s - self._zero_s
        messages = tuple(self.replica.messages(writers))
        incarnation = self._voice.incarnation
        return Snapshot(self._mission.name, COORDINATOR, incarnation, mission_s, messages)

    # -- phases ---------------------------------------------------------------------

    @property
    def _ended(self) -> bool:
        epoch = self.replica.epoch
        return epoch is not None and epoch.phase is EpochPhase.ENDED

    def _advance(self, now_s: float) -> None:
        anybody_lost = False
        for writer in self._membership.lost(now_s):
            claim = self.replica.claims.get(writer)
            left = claim is not None and claim.phase is ClaimPhase.OUT
            self._actions.append(Note("left" if left else "lost", {"writer": writer}))
            anybody_lost |= not left
        if anybody_lost:
            self._actions.append(Ask())  # others may have heard its last words
        if self._ended:
            self._leave_when_empty(now_s)
        else:
            if self._zero_s is None:
                self._start_if_ready(now_s)
            if self._zero_s is not None:
                self._post(now_s)
                self._end_if_over(now_s)
        if self._announce_at_s <= now_s and not self._finished:
            self._announce(now_s)

    def _start_if_ready(self, now_s: float) -> None:
        if self._start_by_s is not None and self._start_by_s <= now_s:
            self._start_by_s = None
        uavs = tuple(uav.id for uav in self._mission.uavs)
        ready = tuple(uav for uav in uavs if self._phase_of(uav) is ClaimPhase.IDLE)
        out = [uav for uav in uavs if self._phase_of(uav) is ClaimPhase.OUT]
        if len(ready) + len(out) < len(uavs) and self._start_by_s is not None:
            return
        if not ready:
            self._end("no UAV is airborne", now_s)
        elif self._planned_for != ready:
            # Somebody is missing: the sequence must be one of those who fly.
            missing = sorted(set(uavs) - set(ready))
            self._actions.append(Note("starting without", {"uavs": ", ".join(missing)}))
            self._make_plan(ready)
        elif self.plan is not None:
            self._zero_s, self._start_by_s = now_s, None
            self._say_epoch(1, EpochPhase.RUNNING, "every UAV is airborne or given up", now_s)

    def _phase_of(self, uav: str) -> ClaimPhase | None:
        """Phase of its claim; None while it is absent or has none."""
        claim = self.replica.claims.get(uav)
        return None if claim is None or uav not in self._membership.present else claim.phase

    def _end_if_over(self, now_s: float) -> None:
        phases = {self._phase_of(uav.id) for uav in self._mission.uavs} - {None, ClaimPhase.OUT}
        if doable(self._board, self._membership.present) or (self._unposted() and phases):
            self._end_if_stale(phases == {ClaimPhase.IDLE} and not self._unposted(), now_s)
            return
        left = TaskState.OPEN in self._board.states.values() or self._unposted()
        reason = "nobody is left who could go on" if left else "every task has ended"
        self._end(reason, now_s)

    def _end_if_stale(self, stalemate: bool, now_s: float) -> None:
        """Tasks may be open that every UAV refuses for reasons of its own, such as a geofence."""
        if not stalemate:
            self._stalemate_at_s = None
        elif self._stalemate_at_s is None:
            self._stalemate_at_s = now_s + self._timing.stalemate_s
        elif self._stalemate_at_s <= now_s:
            self._end("nobody takes what is left", now_s)

    def _end(self, reason: str, now_s: float) -> None:
        if self._ended:
            return
        self._start_by_s = self._stalemate_at_s = None
        number = 1 if self.replica.epoch is None else self.replica.epoch.number + 1
        self._say_epoch(number, EpochPhase.ENDED, reason, now_s)
        self._actions.append(Note("mission ends", {"reason": reason}))
        self._leave_at_s = now_s + self._timing.linger_s

    def _leave_when_empty(self, now_s: float) -> None:
        """Stay until all agents have left, so that each has heard of the end."""
        if self._finished or self._leave_at_s is None or now_s < self._leave_at_s:
            return
        if self._membership.present - {COORDINATOR}:
            self._leave_at_s = now_s + self._timing.linger_s
            return
        self._finished, self._leave_at_s = True, None
        states = self._board.states.values()
        done = all(s in (TaskState.DONE, TaskState.WITHDRAWN) for s in states)
        self._actions.append(Finish(0 if done and not self._unposted() else 1))

    # -- board and plan ---------------------------------------------------------------

    def _unposted(self) -> list[Task]:
        return [task for task in self._mission.tasks if task.id not in self.replica.board]

    def _post(self, now_s: float) -> None:
        """Post what is due; before the start, what has been there all along."""
        numbers = {task.id: number for number, task in enumerate(self._mission.tasks)}
        for task in self._unposted():
            popped_up = self._zero_s is not None and self._zero_s + task.appears_s <= now_s
            if task.appears_s == 0.0 or popped_up:
                self._say(
                    Board(
                        task=task.id,
                        number=numbers[task.id],
                        position_enu_m=task.position_enu_m,
                        value=task.value,
                        service_s=task.service_s,
                        kind=task.kind,
                        withdrawn=False,
                    )
                )
                if task.appears_s > 0.0:
                    self._actions.append(Note("pop-up posted", {"task": task.id}))

    def _make_plan(self, uavs: tuple[UavId, ...]) -> None:
        self._request += 1
        self._planned_for, self.plan = uavs, None
        fleet = tuple(uav for uav in self._mission.uavs if uav.id in uavs)
        mission = replace(self._mission.known_at_start(), uavs=fleet)
        self._actions.append(MakePlan(self._request, mission, self._method, self._seed))

    # -- saying -----------------------------------------------------------------------

    def _say(self, body: Body) -> None:
        message = self._voice.say(body)
        self.replica.join(message)
        self._actions.append(Publish(message))

    def _say_epoch(self, number: int, phase: EpochPhase, reason: str, now_s: float) -> None:
        sequence = () if self.plan is None else self.plan.sequence or ()
        mission_s = 0.0 if self._zero_s is None else now_s - self._zero_s
        plan = {} if self.plan is None else self.plan.routes
        routes = {str(uav): tuple(map(str, tasks)) for uav, tasks in plan.items()}
        self._say(
            Epoch(number, phase, self._method, tuple(sequence), mission_s, reason[:200], routes)
        )

    def _announce(self, now_s: float) -> None:
        """Repeat the epoch with the mission time of now, the brief and some of the board.

        Whoever joins asks by itself; this is for what got lost on the way, so a few
        entries at a time are enough and the bus stays quiet on large boards.
        """
        self._announce_at_s = now_s + self._timing.announce_s
        epoch = self.replica.epoch
        if epoch is not None:
            mission_s = 0.0 if self._zero_s is None else now_s - self._zero_s
            self._say(replace(epoch, mission_s=mission_s))
        own = list(self.replica.messages({COORDINATOR}))
        rest = [message for message in own if not isinstance(message.body, Epoch)]
        turn = [rest[(self._announced + k) % len(rest)] for k in range(min(8, len(rest)))]
        self._announced += len(turn)
        self._actions += [Publish(message) for message in turn]

    def _drain(self) -> list[Action]:
        actions, self._actions = self._actions, []
        return actions


def _brief(mission: Mission, layers: FlightLayers, run: int) -> Brief:
    origin: Origin = mission.origin or DEFAULT_ORIGIN
    return Brief(
        horizon_s=mission.horizon_s,
        success_default=mission.success_default,
        survival_default=mission.survival_default,
        reattempt_failed=mission.reattempt_failed,
        run=run,
        origin=(origin.lat_deg, origin.lon_deg, origin.alt_m),
        uavs=tuple(
            Fleet(
                id=uav.id,
                position_enu_m=uav.position_enu_m,
                speed_m_s=uav.speed_m_s,
                success=dict(uav.success),
                survival=dict(uav.survival),
                kind=uav.kind,
                layer_m=layers.layer_m(index),
            )
            for index, uav in enumerate(mission.uavs)
        ),
    )
