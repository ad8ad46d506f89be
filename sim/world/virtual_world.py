"""A whole fleet in virtual time: the real cores, their vehicles, and what joins them.

Everything follows from the mission and one seed. By itself the world is ideal: messages arrive
after a constant delay, in order, and UAVs may be lost at given times. `WorldSettings` give it a
network on which more goes wrong, and clocks that disagree.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection
from dataclasses import replace
from functools import partial
from typing import Any

from agent.core.agent_core import AgentCore
from agent.core.interface import Action as AgentAction
from agent.core.interface import (
    GoTo,
    OrderVehicle,
    Refused,
    VehicleOrder,
    VehicleReady,
    VehicleReport,
)
from coordinator.core.active import CoordinatorCore
from coordinator.core.lifecycle import (
    CoordinatorAction,
    MakePlan,
    PlanMade,
    Replan,
    Replanned,
    TakeSeat,
    Withdraw,
)
from coordinator.core.standby import StandbyCore
from coordinator.mission_view.approaches import Approach
from coordinator.mission_view.mission_state import MissionState
from coordinator.operator.commands import CommandRequest
from coordinator.operator.requests import OperatorClient, OperatorRequest
from sim.world.closest_approach import closest_approach
from sim.world.engine import EventQueue, LocalClock, Process
from sim.world.flight_log import FlightLog, LastSeen
from sim.world.ground_clearance import lowest_clearance
from sim.world.network import IdealNetwork
from sim.world.settings import (
    QUIET,
    Planner,
    RestartMemory,
    ScheduledLosses,
    WorldListener,
    WorldSettings,
)
from sim.world.track import Track
from sim.world.vehicles import IdealVehicle, SimulatedVehicle, TracedVehicle, as_flown
from swarm.model import Mission
from swarm.model.ids import COORDINATOR, FLEET, OPERATOR
from swarm.model.layers import FlightLayers
from swarm.model.plan import Schedule
from swarm.protocol.events import Ask, Finish, LogLine, Publish, PublishLast, Save, TuneIn
from swarm.protocol.messages import CommandKind, Message, MissionPhase, PlanEpoch, Snapshot
from swarm.protocol.timing import Timing
from swarm.protocol.uav_messages import BaseStage, Claim, Outcome, Status
from swarm.runtime.shell import Core

ONLOOKER = "onlooker"
"""Name of the process that only watches."""
STANDBY = "standby"
"""Name of the process that takes the coordinator's place when it is lost."""
OPERATOR_PATIENCE_S = 60.0
"""How long an operator repeats a command that is not seen to take effect."""
WRITE_S = 0.02
"""Until what a process wants kept is on its disk."""


class World:
    """One mission in virtual time.

    Args:
        mission: the scenario, pop-ups included.
        make_plan: plans a mission by method and seed.
        method: planning method.
        seed: of the planner.
        faults: what is lost.
        timing: timers [virtual s].
        latency_s: delay of every message [s], unless the setting has a network of its own.
        setting: what makes the world less than ideal.
        watch: is told all that happens.
    """

    def __init__(
        self,
        mission: Mission,
        make_plan: Planner,
        *,
        method: str,
        seed: int,
        faults: ScheduledLosses | None = None,
        timing: Timing = QUIET,
        latency_s: float = 0.0,
        setting: WorldSettings | None = None,
        watch: WorldListener | None = None,
    ) -> None:
        self.mission = mission
        self.mission_state = MissionState(mission, timing)
        self.finished: dict[str, int] = {}
        """Exit status of every process that ended by itself."""
        self.queue = EventQueue()
        self.zero_s: float | None = None
        """Virtual time at which the mission began."""
        self.steps = 0
        """Of all processes so far."""
        self.refuses: set[tuple[str, str | None]] = set()
        """UAV and task, where the vehicle will not go."""
        self._make_plan = make_plan
        self._method = method
        self._seed = seed
        self.timing = timing
        """Of all processes [virtual s]."""
        self._faults = faults or ScheduledLosses()
        self._setting = setting or WorldSettings(lambda queue: IdealNetwork(queue, latency_s))
        self.network = self._setting.network(self.queue)
        self._watch = watch
        self._disks: dict[str, tuple[float, Snapshot]] = {}
        self._writing: dict[str, list[tuple[float, Snapshot]]] = {}
        names = [ONLOOKER, COORDINATOR, *(uav.id for uav in mission.uavs)]
        names += [STANDBY] if self._setting.standby else []
        self._clocks = {name: self._setting.clocks.get(name, LocalClock()) for name in names}
        self.operators: list[OperatorClient] = []
        """Every command given so far, and what has come of it."""
        self.fallen_s: dict[str, float] = {}
        """UAVs that fell out of the sky with an empty battery, and when [s virtual time]."""
        self.when_fallen: Callable[[str], None] = lambda _: None
        """Is told of each of them."""
        self.tracks: dict[str, Track] = {}
        """Where vehicles truly were, those that are lost included; bridged ones have none."""
        self.flight_log = FlightLog(mission, self.tracks)
        """What they did."""
        self._vehicles = {str(uav.id): self._vehicle(uav.id) for uav in mission.uavs}
        self.processes = {name: self._process(name, 1_000_000) for name in names}
        """The latest life of every process, by name."""
        self._commanders: dict[str, Process] = {}

    def run(self, limit_s: float = math.inf) -> bool:
        """Fly the mission; False if it was not over by ``limit_s`` of virtual time."""
        for process in self.processes.values():
            self.network.join(process)
        for process in self.processes.values():
            process.start()
        self.queue.run(limit_s)
        return not self.alive

    @property
    def alive(self) -> list[str]:
        """Processes that neither ended nor were lost."""
        return [n for n, process in self.processes.items() if n != ONLOOKER and not process.over]

    @property
    def agents(self) -> dict[str, AgentCore]:
        """The latest core of every UAV."""
        cores = {name: process.core for name, process in self.processes.items()}
        return {name: core for name, core in cores.items() if isinstance(core, AgentCore)}

    def seen(self, uav: str) -> LastSeen | None:
        """Where the vehicle of ``uav`` is now; None before its first lift-off, and once lost."""
        vehicle, track = self._vehicles.get(uav), self.tracks.get(uav)
        told = None if vehicle is None else vehicle.telemetry()
        if told is None:
            return None
        flies, now_s = track is None or track.airborne, self.queue.now_s()
        return LastSeen(now_s, told.position_enu_m, told.battery_frac, flies)

    def executed_schedule(self) -> Schedule:
        """Where UAVs went, when, and what they did there, in mission time."""
        return self.flight_log.executed_schedule(self.zero_s)

    def closest_approach_m(self) -> float | None:
        """Least distance of two UAVs while both were in the air [m]; None if never two were."""
        nearest = self.closest_approach()
        return None if nearest is None else nearest.distance_m

    def closest_approach(self) -> Approach | None:
        """The nearest that two UAVs in the air truly came to each other; None if never two were."""
        nearest = closest_approach(self.tracks)
        if nearest is None:
            return None
        at_s = None
        if self.zero_s is not None and nearest.at_s >= self.zero_s:
            at_s = nearest.at_s - self.zero_s
        return Approach(nearest.distance_m, at_s, nearest.uavs, nearest.places_enu_m)

    def lowest_clearance_m(self) -> float | None:
        """Least height of a UAV in flight above the ground [m]; None where there is no terrain."""
        return lowest_clearance(self.tracks, self.mission.terrain)

    # -- what befalls processes -------------------------------------------------------

    def lose(self, name: str) -> None:
        """A process disappears, and with it the vehicle it flies."""
        self.crash(name)
        if self._vehicles.pop(name, None) is not None and name in self.tracks:
            self.tracks[name].touch_down(self.queue.now_s())

    def crash(self, name: str) -> None:
        """A process dies; its vehicle flies on."""
        process = self.processes[name]
        if not process.over:
            self._settle_disk(name)
            self._writing.pop(name, None)
            self._end(process)

    def restart(self, name: str, memory: RestartMemory) -> bool:
        """Start a process anew that died; False if it did not, or for good."""
        if not self.processes[name].over or name in self.finished:
            return False
        if name not in (COORDINATOR, STANDBY) and name not in self._vehicles:
            return False
        wall_ms = 0 if memory is RestartMemory.PAST else 1_000_000
        kept = None if memory is RestartMemory.NONE else self._disks.get(name)
        self._begin(self._process(name, wall_ms + round(1e3 * self.queue.now_s()), kept, memory))
        return True

    def slow(self, uav: str, speed_frac: float) -> None:
        """Let a simulated vehicle fly at that share of its speed, from its next order on."""
        vehicle = self._vehicles.get(uav)
        if isinstance(vehicle, TracedVehicle):
            vehicle.speed_frac = speed_frac

    def drain(self, uav: str, drain: float) -> None:
        """Let the battery of a simulated vehicle drain so much faster than planned."""
        vehicle = self._vehicles.get(uav)
        if isinstance(vehicle, TracedVehicle):
            vehicle.drain_by(drain)

    def withdraw(self, task: str) -> None:
        """Take a task off the board, as an operator would ask every coordinator there is."""
        for name in (COORDINATOR, STANDBY):
            process = self.processes.get(name)
            if process is not None and not process.held:
                process.step(Withdraw(task))

    def command(self, kind: CommandKind, uav: str = FLEET, reason: str = "") -> OperatorClient:
        """Let an operator take a seat and give a command; gives that seat.

        They leave it once the command has been seen to take effect, or `OPERATOR_PATIENCE_S`
        after they gave it.
        """
        return self.operate(CommandRequest(kind, uav, reason))

    def operate(self, wish: OperatorRequest) -> OperatorClient:
        """Let an operator take a seat and say what they want; see `command`."""
        seat = OperatorClient(
            self.mission.name,
            wish,
            incarnation=1_000_000 + round(1e3 * self.queue.now_s()),
            timing=self.timing,
            patience_s=OPERATOR_PATIENCE_S,
        )
        self.operators.append(seat)
        self.admit(f"{OPERATOR}-{len(self.operators)}", seat)
        return seat

    def admit(self, name: str, core: Core[Any, Any]) -> None:
        """Let somebody take a seat on the bus who flies nothing and shows no token."""
        process = Process(name, None, core, self.queue, self, clock=LocalClock())
        self.network.join(process)
        process.start()

    def skew(self, name: str, by_s: float) -> None:
        """Let the clock of a process jump forward."""
        self._clocks[name].offset_s += by_s

    # -- what processes want ----------------------------------------------------------

    def execute(self, process: Process, action: AgentAction | CoordinatorAction) -> None:
        """Carry out an action of a core; one whose life has just ended wants nothing more."""
        if process.over:
            return
        match action:
            case Publish(message, to):
                self._publish(process, message, to)
            case PublishLast(make):
                self._publish(process, make())
            case OrderVehicle(order):
                self._order(process, order)
            case Ask(of):
                self.network.ask(process, of)
            case TuneIn(cells):
                process.cells = cells
            case MakePlan(request, mission, method, seed):
                plan = self._make_plan(mission, method, seed)
                if self.mission_state.plan is None or self.zero_s is None:
                    self.mission_state.plan = plan
                made = partial(process.step, PlanMade(request, plan))
                self.queue.after(self._setting.plan_s, made)
            case Replan(request=request) as wanted:
                answer = partial(process.step, Replanned(request, self._setting.replan(wanted)))
                self.queue.after(self._setting.plan_s, answer)
            case Save() if process.name in self._setting.kept:
                self._settle_disk(process.name)
                memory: Snapshot = process.core.memory(process.now_s())  # type: ignore[attr-defined]  # who saves has one
                self._writing.setdefault(process.name, []).append((self.queue.now_s(), memory))
            case TakeSeat():
                self.network.seat(process, COORDINATOR)
            case Finish(status):
                self._end(process)
                if process.name == STANDBY and process.core.stood_down is not None:  # type: ignore[attr-defined]  # a StandbyCore
                    self._stand_by_again(process)
                elif process.name in self.processes:
                    self.finished[process.name] = status
            case LogLine() if self._watch is not None:
                self._watch.noted(process, action)
            case _:
                pass

    def stepped(self, process: Process) -> None:
        """A step with all its actions is over."""
        self.steps += 1
        if self._watch is not None:
            self._watch.stepped(process)

    def raised(self, process: Process, fault: Exception) -> None:
        """A core has raised.

        Raises:
            Exception: ``fault``, when nobody watches.
        """
        if self._watch is None:
            raise fault
        self._end(process)
        self._watch.raised(process, fault)

    def _publish(
        self, process: Process, message: Message, to: Collection[str] | None = None
    ) -> None:
        running = isinstance(message.body, PlanEpoch) and message.body.phase is MissionPhase.RUNNING
        if running and self.zero_s is None:
            self.zero_s = self.queue.now_s()
            for vehicle in self._vehicles.values():
                if isinstance(vehicle, TracedVehicle):
                    vehicle.begin_mission()
            self._schedule_faults(self.zero_s)
        if isinstance(message.body, Claim) and message.body.stage is BaseStage.PARKED:
            self.flight_log.made_room(process.name, self.queue.now_s())
        elif isinstance(message.body, Outcome) and message.writer == process.name:
            times_s = self.queue.now_s(), self.zero_s or 0.0
            self.flight_log.attempt_ended(process.name, message.body, *times_s)
        elif isinstance(message.body, Status):
            message = replace(message, body=self._as_flown(process.name, message.body))
        self.network.publish(process, message, to)
        if self._watch is not None:
            self._watch.said(process, message)

    def _order(self, process: Process, order: VehicleOrder) -> None:
        vehicle = self._vehicles[process.name]
        if isinstance(order, GoTo) and (process.name, order.task) in self.refuses:
            if self._watch is not None:
                self._watch.refused(process, order)
            refused = Refused(order, "will not go there")
            self.queue.after(0.0, lambda: process.step(refused))
            return
        self._commanders[process.name] = process
        self.flight_log.ordered(process.name, order, vehicle.telemetry(), self.queue.now_s())
        vehicle.order(order, VehicleReady())

    def _vehicle(self, uav: str) -> SimulatedVehicle:
        def report(news: VehicleReport) -> None:
            self.flight_log.reported(uav, news, self.queue.now_s())
            # A process that starts anew knows nothing of what an earlier one had ordered.
            commander = self._commanders.get(uav)
            if uav in self._vehicles and commander is self.processes[uav]:
                commander.step(news)

        vehicle = self._setting.vehicle(self.queue, uav, report)
        if isinstance(vehicle, TracedVehicle):
            self.tracks[uav] = vehicle.track
            vehicle.when_empty = partial(self._fall, uav)
        return vehicle

    def _fall(self, uav: str) -> None:
        """Its battery is empty in the air: it is lost, unless it was already."""
        if uav not in self._vehicles:
            return
        self.fallen_s[uav] = self.queue.now_s()
        self.when_fallen(uav)
        self.lose(uav)

    def _as_flown(self, uav: str, status: Status) -> Status:
        vehicle, brief = self._vehicles.get(uav), self.mission_state.replica.brief
        if vehicle is None or brief is None:
            return status
        return as_flown(uav, status, vehicle.telemetry(), brief)

    # -- processes --------------------------------------------------------------------

    def _process(
        self,
        name: str,
        incarnation: int,
        kept: tuple[float, Snapshot] | None = None,
        memory: RestartMemory = RestartMemory.NONE,
    ) -> Process:
        new = partial(Process, name, clock=self._clocks[name], queue=self.queue, owner=self)
        if name == ONLOOKER:
            return new(None, self._setting.observer(self.mission_state))
        age_s, known = self._recall(kept, memory)
        if name == COORDINATOR:
            coordinator = self._coordinator(incarnation, known, age_s)
            return new(name, coordinator, snapshot=coordinator.snapshot)
        if name == STANDBY:
            begun_s = self.queue.now_s()

            def make_coordinator(memory: Snapshot | None, memory_age_s: float) -> CoordinatorCore:
                later_ms = round(1e3 * (self.queue.now_s() - begun_s))
                return self._coordinator(incarnation + later_ms, memory, memory_age_s)

            core = StandbyCore(self.mission, make_coordinator, self.timing, known, age_s)
            return new(None, core, snapshot=core.snapshot)
        agent = self._setting.agent(
            self.mission.name,
            name,
            incarnation,
            self.timing,
            memory=known,
            memory_age_s=age_s,
            without_bus_s=self._setting.without_bus_s,
        )
        vehicle = self._vehicles[name]
        is_watched = type(agent).step is not AgentCore.step  # who times steps wants all of them
        return new(
            name,
            agent,
            snapshot=agent.snapshot,
            whole=agent.whole,
            telemetry=vehicle.telemetry,
            telemetry_s=self._setting.telemetry_s,
            together=True,
            attention=None if is_watched else agent.attention,
            telemetry_at=vehicle.telemetry_at if isinstance(vehicle, IdealVehicle) else None,
        )

    def _coordinator(
        self, incarnation: int, memory: Snapshot | None, memory_age_s: float
    ) -> CoordinatorCore:
        return CoordinatorCore(
            self.mission,
            method=self._method,
            seed=self._seed,
            incarnation=incarnation,
            timing=self.timing,
            start_timeout_s=self._setting.start_timeout_s,
            layers=FlightLayers(),
            memory=memory,
            memory_age_s=memory_age_s,
        )

    def _stand_by_again(self, process: Process) -> None:
        """Who has left the coordinator's seat to another one watches anew, from a new seat."""
        memory: Snapshot = process.core.memory(process.now_s())  # type: ignore[attr-defined]  # a StandbyCore
        kept = self.queue.now_s(), memory
        incarnation = 1_000_000 + round(1e3 * self.queue.now_s())
        self._begin(self._process(process.name, incarnation, kept, RestartMemory.DISK))

    def _begin(self, process: Process) -> None:
        self.processes[process.name] = process
        self.network.join(process)
        process.start()

    def _recall(
        self, kept: tuple[float, Snapshot] | None, memory: RestartMemory
    ) -> tuple[float, Snapshot | None]:
        """Age of what was kept, and the memory brought to now, as far as a clock can tell."""
        if kept is None:
            return 0.0, None
        saved_s, snapshot = kept
        if memory is RestartMemory.PAST:
            return math.inf, replace(snapshot, mission_s=None)
        age_s, mission_s = self.queue.now_s() - saved_s, snapshot.mission_s
        return age_s, replace(snapshot, mission_s=None if mission_s is None else mission_s + age_s)

    def _settle_disk(self, name: str) -> None:
        """Whatever has been written long enough ago is on the disk."""
        written_s, writing = self.queue.now_s() - WRITE_S, self._writing.get(name, [])
        while writing and writing[0][0] <= written_s:
            self._disks[name] = writing.pop(0)

    def _end(self, process: Process) -> None:
        process.over = True
        self.network.leave(process)
        vehicle = self._vehicles.get(process.name)
        if vehicle is not None:
            vehicle.leave()

    def _schedule_faults(self, zero_s: float) -> None:
        """Mission time has begun: from now on things may go wrong."""
        for uav, lost_at_s in self._faults.lost_at_s.items():
            self.queue.at(zero_s + lost_at_s, partial(self.lose, uav))
        if (lost_at := self._faults.coordinator_lost_at_s) is not None:
            self.queue.at(zero_s + lost_at, partial(self.lose, COORDINATOR))
