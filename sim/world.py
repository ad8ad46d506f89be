"""A whole fleet in virtual time: the real cores, ideal vehicles, an ideal bus.

Everything follows from the mission and one seed. Messages arrive after a constant
delay, in order; UAVs may be lost at given times. Leaves out: sockets, processes and
autopilots (sim.launch), and how plans are made (passed in).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial

from agent.core import AgentCore
from agent.events import Action as AgentAction
from agent.events import Order
from agent.vehicle import Report, VehicleReady
from coordinator.core import CoordinatorCore, FlightLayers
from coordinator.events import Action as CoordinatorAction
from coordinator.events import MakePlan, PlanMade
from coordinator.observer import Observer
from sim.event_queue import EventQueue
from sim.virtual_vehicle import VirtualVehicle
from swarm.config import Timing
from swarm.events import (
    Ask,
    BusFact,
    Finish,
    Heard,
    Learned,
    Note,
    PeerGone,
    PeerSeen,
    Publish,
    Save,
    Tick,
    Wish,
)
from swarm.model import Mission, Plan, UavId
from swarm.model.ids import COORDINATOR
from swarm.wire.messages import Epoch, EpochPhase, Message, Status

__all__ = ["QUIET", "Faults", "World"]

QUIET = Timing(announce_s=60.0, status_s=60.0, silence_s=150.0)
"""Timers for an ideal bus, on which nothing need be said twice."""


@dataclass(frozen=True, slots=True)
class Faults:
    """What goes wrong, and when.

    Raises:
        ValueError: a time is negative.
    """

    lost_at_s: Mapping[UavId, float] = field(default_factory=dict)
    """Mission time at which a UAV disappears with its agent [s]."""
    coordinator_lost_at_s: float | None = None
    """Mission time at which the coordinator dies [s]."""

    def __post_init__(self) -> None:
        times = [*self.lost_at_s.values(), self.coordinator_lost_at_s or 0.0]
        if not all(time_s >= 0.0 for time_s in times):
            raise ValueError(f"faults happen at mission times >= 0, not {times}")


class World:
    """One mission in virtual time.

    Args:
        mission: the scenario, pop-ups included.
        make_plan: plans a mission by method and seed.
        method: planning method.
        seed: of the planner.
        faults: what goes wrong.
        timing: timers [virtual s].
        latency_s: delay of every message [s].
    """

    def __init__(
        self,
        mission: Mission,
        make_plan: Callable[[Mission, str, int], Plan],
        *,
        method: str,
        seed: int,
        faults: Faults | None = None,
        timing: Timing = QUIET,
        latency_s: float = 0.0,
    ) -> None:
        self.mission = mission
        self.observer = Observer(mission, timing)
        self.finished: dict[str, int] = {}
        """Exit status of every process that ended by itself."""
        self._make_plan = make_plan
        self._faults = faults or Faults()
        self._latency_s = latency_s
        self._queue = EventQueue()
        self._wakes: dict[str, float] = {}
        self._faults_scheduled = False
        self._observer_wakes_s: float | None = None
        self._coordinator = CoordinatorCore(
            mission,
            method=method,
            seed=seed,
            incarnation=1,
            timing=timing,
            start_timeout_s=60.0,
            layers=FlightLayers(),
        )
        self._agents: dict[str, AgentCore] = {
            uav.id: AgentCore(mission.name, uav.id, 1, timing) for uav in mission.uavs
        }
        self._vehicles = {uav: self._vehicle(uav) for uav in self._agents}
        self._alive = {COORDINATOR, *self._agents}

    def run(self, limit_s: float = math.inf) -> bool:
        """Fly the mission; False if it was not over by ``limit_s`` of virtual time."""
        self._execute_coordinator(self._coordinator.start(0.0))
        for uav, agent in self._agents.items():
            self._execute_agent(uav, agent.start(0.0))
        for name in (COORDINATOR, *self._agents):  # a set would have another order in each process
            self._tell_everyone(PeerSeen(name), sender=None)
        return self._queue.run(limit_s) and not self._alive

    # -- processes --------------------------------------------------------------------

    def _step(self, name: str, event: BusFact | Report | PlanMade) -> None:
        if name not in self._alive:
            return
        now_s = self._queue.now_s()
        if name == COORDINATOR:
            if not isinstance(event, Report):
                self._execute_coordinator(self._coordinator.step(event, now_s))
            return
        if isinstance(event, PlanMade):
            return
        agent = self._agents[name]
        telemetry = self._vehicles[name].telemetry()
        if isinstance(event, Heard) and telemetry is not None:
            self._execute_agent(name, agent.step(telemetry, now_s))
        self._execute_agent(name, agent.step(event, now_s))

    def _execute_coordinator(self, actions: list[CoordinatorAction]) -> None:
        for action in actions:
            if isinstance(action, MakePlan):
                plan = self._make_plan(action.mission, action.method, action.seed)
                self.observer.plan = plan
                made = PlanMade(action.request, plan)
                self._queue.at(self._queue.now_s(), partial(self._step, COORDINATOR, made))
            else:
                self._execute_common(COORDINATOR, action)
        self._wake(COORDINATOR, self._coordinator.next_deadline_s())

    def _execute_agent(self, uav: str, actions: list[AgentAction]) -> None:
        for action in actions:
            if isinstance(action, Order):
                self._vehicles[uav].order(action.order, VehicleReady())
            else:
                self._execute_common(uav, action)
        self._wake(uav, self._agents[uav].next_deadline_s())

    def _execute_common(self, name: str, action: Wish) -> None:
        match action:
            case Publish(message):
                self._publish(name, message)
            case Ask():
                self._later(self._latency_s, lambda: self._answer(name))
            case Note() | Save():
                pass
            case Finish(status):
                self.finished[name] = status
                self._leave(name)

    def _wake(self, name: str, deadline_s: float | None) -> None:
        """Tick at the deadline, unless an earlier tick is already under way."""
        if deadline_s is None or deadline_s >= self._wakes.get(name, math.inf):
            return
        self._wakes[name] = deadline_s

        def tick() -> None:
            if self._wakes.get(name) == deadline_s:
                del self._wakes[name]
                self._step(name, Tick())
                core = self._coordinator if name == COORDINATOR else self._agents[name]
                if name in self._alive:
                    self._wake(name, core.next_deadline_s())

        self._queue.at(deadline_s, tick)

    def _schedule_faults(self, zero_s: float) -> None:
        """Mission time has begun: from now on things may go wrong."""
        if self._faults_scheduled:
            return
        self._faults_scheduled = True
        for uav, lost_at_s in self._faults.lost_at_s.items():
            self._queue.at(zero_s + lost_at_s, partial(self._lose, uav))
        if (lost_at := self._faults.coordinator_lost_at_s) is not None:
            self._queue.at(zero_s + lost_at, lambda: self._lose(COORDINATOR))

    def _lose(self, name: str) -> None:
        if name in self._alive:
            self._leave(name)

    def _leave(self, name: str) -> None:
        self._alive.discard(name)
        self._tell_everyone(PeerGone(name), sender=name)

    def _vehicle(self, uav: str) -> VirtualVehicle:
        return VirtualVehicle(self._queue, lambda report: self._step(uav, report))

    # -- bus ----------------------------------------------------------------------------

    def _publish(self, sender: str, message: Message) -> None:
        if isinstance(message.body, Epoch) and message.body.phase is EpochPhase.RUNNING:
            self._schedule_faults(self._queue.now_s() - message.body.mission_s)
        if isinstance(message.body, Status):
            self._later(self._latency_s, lambda: self._observe(Heard(message)))
            return
        self._tell_everyone(Heard(message), sender=sender)

    def _tell_everyone(self, fact: BusFact, sender: str | None) -> None:
        def tell() -> None:
            self._observe(fact)
            for name in (COORDINATOR, *self._agents):
                if name != sender:
                    self._step(name, fact)

        self._later(self._latency_s, tell)

    def _answer(self, asker: str) -> None:
        now_s = self._queue.now_s()
        cores: dict[str, CoordinatorCore | AgentCore] = {
            COORDINATOR: self._coordinator,
            **self._agents,
        }
        snapshots = tuple(
            core.snapshot(now_s)
            for name, core in cores.items()
            if name in self._alive and name != asker
        )
        self._later(self._latency_s, lambda: self._step(asker, Learned(snapshots)))

    def _observe(self, fact: BusFact) -> None:
        self.observer.step(fact, self._queue.now_s())
        deadline_s = self.observer.next_deadline_s()
        if deadline_s is not None and self._observer_wakes_s != deadline_s:
            self._observer_wakes_s = deadline_s
            self._queue.at(deadline_s, lambda: self._observe(Tick()))

    def _later(self, delay_s: float, callback: Callable[[], None]) -> None:
        self._queue.at(self._queue.now_s() + delay_s, callback)
