"""A world in which a realization comes true: who is lost, what appears, how far messages get.

The agents and the coordinator are the real ones and know nothing of the realization; they meet it
when it happens. When the coordinator is lost, an operator keeps the task board from then on, so
tasks still appear and are withdrawn in time; the fleet stays out for as long as tasks may yet
appear. A task that is withdrawn before it appears never does.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from agent.core.agent_core import AgentCore
from agent.core.interface import GoTo, VehicleReport
from coordinator.mission_view.mission_state import MissionState
from coordinator.operator.readiness import ReadyRequest
from sim.world.engine import EventQueue, Process
from sim.world.motion import flown_s
from sim.world.network import IdealNetwork, Network, NetworkConditions, Topology
from sim.world.outcome import Tally
from sim.world.rough_network import RoughNetwork
from sim.world.scripted_operator import ScriptedOperator
from sim.world.settings import (
    QUIET,
    Planner,
    Replanner,
    WorldSettings,
    planned_anew,
    vehicles_of,
)
from sim.world.uncertainty import FleetPartition, Realization, Uncertainty
from sim.world.vehicles import (
    IdealVehicle,
    SimulatedVehicle,
    StochasticVehicle,
    VehicleFactory,
)
from sim.world.virtual_world import World
from swarm.model import Mission, Task, Uav, UavId
from swarm.model.ids import COORDINATOR, OPERATOR
from swarm.protocol.events import CommonAction, CommonEvent, LogLine
from swarm.protocol.messages import Message, MissionPhase, PlanEpoch
from swarm.protocol.timing import PRESETS, LinkKind, LinkPreset, Timing
from swarm.protocol.uav_messages import Outcome
from swarm.runtime.shell import Core

_HEARD_S = 0.1
"""How often it is looked whether the start of the mission has been heard of."""
_OPERATOR_SITS_DOWN_S = 1.0
"""After the loss of a coordinator; until then everyone has noticed it."""
_START_S = 600.0
"""Until a mission starts whose UAVs do not all get airborne, be it because nobody tells them."""
_REPEATS = 10
"""How often an operator says each change of the board again."""
_TAKEOFF_S = 20.0
"""While the vehicles take off, the processes of a real fleet find each other."""
_WIRED = replace(
    PRESETS[LinkKind.CLEAN],
    timing=replace(PRESETS[LinkKind.CLEAN].timing, announce_s=20.0, silence_s=60.0),
)
"""Where nothing is lost nothing need be said twice: who was cut off asks when it is back."""
_STATUS_S = 60.0
"""Nobody looks on while a mission is flown in virtual time..."""
_WATCHED_STATUS_S = 0.5
"""...unless it is recorded."""

ObserverMaker = Callable[[MissionState, Timing], Core[CommonEvent, CommonAction]]
"""Makes the core of an observer."""


class StochasticWorld:
    """One mission in virtual time, and all that befalls it.

    The coordinator dies at the mission time ``coordinator_lost_s``, unless that is None. A UAV that
    is lost on a slot of a base is carried away after ``clears_slots_s``, as an operator tells all
    then; with None it stands there for good. The coordinator plans anew at least
    ``replan_interval_s`` after it last did, by default as real ones do. See `World` for the others.
    """

    def __init__(
        self,
        fate: Realization,
        make_plan: Planner,
        *,
        method: str,
        seed: int,
        coordinator_lost_s: float | None = None,
        make_agent: Callable[..., AgentCore] = AgentCore,
        make_observer: ObserverMaker | None = None,
        clears_slots_s: float | None = None,
        replan: Replanner = planned_anew,
        replan_interval_s: float | None = None,
    ) -> None:
        self.fate = fate
        self._clears_slots_s = clears_slots_s
        self.lost: dict[UavId, str] = {}
        """UAVs lost on their mission, in that order, and why."""
        self.tally = Tally()
        """What has been flown and said."""
        self._coordinator_lost_s = coordinator_lost_s
        self._uavs: dict[str, Uav] = {str(uav.id): uav for uav in fate.mission.uavs}
        self._tasks: dict[str, Task] = {str(task.id): task for task in fate.mission.tasks}
        self._mission = _without_never_seen(fate)
        self._told_s = 0.0
        """How long an operator repeats what they say."""
        self._timing = self._timing_of(fate.uncertainty)
        if make_observer is not None and fate.uncertainty.ideal_communication:
            # There nobody's decision hangs on it, and nothing is drawn for each message.
            self._timing = replace(self._timing, status_s=_WATCHED_STATUS_S)
        if replan_interval_s is not None:
            self._timing = replace(self._timing, replan_interval_s=replan_interval_s)
        timing = self._timing
        self._outcomes: set[tuple[str, str, int]] = set()
        self._begun = False
        self.world = World(
            self._mission,
            make_plan,
            method=method,
            seed=seed,
            timing=self._timing,
            setting=WorldSettings(
                network=partial(_network, fate),
                replan=replan,
                start_timeout_s=_START_S,
                vehicle=_vehicles(fate),
                agent=make_agent,
                observer=lambda mission_state: (
                    mission_state if make_observer is None else make_observer(mission_state, timing)
                ),
            ),
            watch=self,
        )
        self.world.when_fallen = self._fall

    def run(self) -> bool:
        """Fly the mission; False if it had to be broken off, since somebody waits for ever."""
        return self.world.run(_limit_s(self.fate, self._timing))

    # -- what the world tells -----------------------------------------------------------

    def said(self, process: Process, message: Message) -> None:
        """A mission may have begun, or an attempt ended that its UAV does not survive."""
        self.tally.said(process, message)
        match message.body:
            case Outcome() as outcome:
                self._survive(process, outcome)
            case PlanEpoch(phase=MissionPhase.RUNNING) if not self._begun:
                self._begun = True
                self._begin(self.world.queue.now_s())
            case _:
                pass

    def stepped(self, process: Process) -> None:
        """Nothing follows from a step."""

    def raised(self, process: Process, fault: Exception) -> None:
        """A core has raised.

        Raises:
            RuntimeError: always; a flight with a broken process is none to count.
        """
        raise RuntimeError(f"{process.name} has broken down") from fault

    def refused(self, process: Process, order: GoTo) -> None:
        """No vehicle refuses anything here."""

    def noted(self, process: Process, note: LogLine) -> None:
        """A task may have been given up on the way."""
        self.tally.noted(process, note)

    # -- what happens -------------------------------------------------------------------

    def _begin(self, zero_s: float) -> None:
        """Mission time has begun: schedule all that happens whatever anybody does."""
        world, fate = self.world, self.fate
        for uav, lost_s in fate.lost_at_s.items():
            world.queue.at(zero_s + lost_s, partial(self._lose, uav, f"lost at {lost_s:.4g} s"))
        for task, withdrawn_s in fate.withdrawn_at_s.items():
            world.queue.at(zero_s + withdrawn_s, partial(world.withdraw, task))
        for partition in fate.partitions:
            if partition.group:
                world.queue.at(zero_s + partition.at_s, partial(self._cut, partition))
        if self._coordinator_lost_s is not None:
            world.queue.at(zero_s + self._coordinator_lost_s, self._lose_coordinator)

    def _lose(self, uav: UavId, why: str) -> None:
        if not self.world.processes[uav].over:
            self.lost[uav] = why
            self.world.lose(uav)
            if self._clears_slots_s is not None:
                self.world.queue.after(self._clears_slots_s, partial(self._clear_slot, uav))

    def _clear_slot(self, uav: UavId) -> None:
        world = self.world
        if world.alive and world.flight_log.stands(uav):
            world.flight_log.made_room(uav, world.queue.now_s())
            world.operate(ReadyRequest(uav, "is lost, and carried away"))

    def _fall(self, uav: str) -> None:
        at_s = self.world.queue.now_s() - (self.world.zero_s or 0.0)
        self.lost[UavId(uav)] = f"fell at {at_s:.4g} s with an empty battery"

    def _lose_coordinator(self) -> None:
        """It dies, but not before anybody has heard that the mission has begun."""
        world = self.world
        epochs = [agent.replica.epoch for agent in world.agents.values()]
        if not any(epoch is not None and epoch.phase is MissionPhase.RUNNING for epoch in epochs):
            if not world.processes[COORDINATOR].over:
                world.queue.after(_HEARD_S, self._lose_coordinator)
            return
        world.lose(COORDINATOR)
        if _last_change_s(self._mission, self.fate) > (self._coordinator_lost_s or 0.0):
            world.queue.after(_OPERATOR_SITS_DOWN_S, self._seat_operator)

    def _cut(self, partition: FleetPartition) -> None:
        network = self.world.network
        if isinstance(network, RoughNetwork):
            network.cut(partition.group)
            self.world.queue.after(partition.for_s, partial(network.heal, partition.group))

    def _seat_operator(self) -> None:
        world, timing = self.world, self._timing
        zero_s, now_s = world.zero_s or 0.0, world.queue.now_s()
        briefs = [agent.replica.brief for agent in world.agents.values()]
        seat = ScriptedOperator(
            self._mission,
            self.fate.withdrawn_at_s,
            since_s=self._coordinator_lost_s or 0.0,
            mission_s=now_s - zero_s,
            run=max((brief.run for brief in briefs if brief is not None), default=0),
            incarnation=2_000_000 + round(1e3 * now_s),
            timing=timing,
            patience_s=self._told_s,
        )
        world.admit(OPERATOR, seat)

    def _survive(self, process: Process, outcome: Outcome) -> None:
        attempt = process.name, outcome.task, outcome.attempt
        uav, task = self._uavs.get(process.name), self._tasks.get(outcome.task)
        if uav is None or task is None or attempt in self._outcomes:
            return  # said again
        self._outcomes.add(attempt)
        if not self.fate.survives(uav, task, outcome.attempt):
            at_s = outcome.completed_s
            self._lose(uav.id, f"did not survive {outcome.task} at {at_s:.4g} s")

    # -- what the runtime is set to -----------------------------------------------------

    def _timing_of(self, uncertainty: Uncertainty) -> Timing:
        """Timers that fit the network, and a fleet that stays out while tasks may yet appear."""
        timing = QUIET
        if not uncertainty.ideal_communication:
            timing = _preset(uncertainty).timing
            self._told_s = _REPEATS * timing.announce_s
        last_s = max((task.appears_s for task in self._mission.tasks), default=0.0)
        if self._coordinator_lost_s is None or last_s == 0.0:
            return timing
        return replace(timing, linger_s=max(timing.linger_s, last_s + self._told_s))


def _without_never_seen(fate: Realization) -> Mission:
    gone_s = fate.withdrawn_at_s
    tasks = fate.mission.tasks
    seen = tuple(t for t in tasks if t.appears_s <= gone_s.get(t.id, math.inf))
    return fate.mission if len(seen) == len(tasks) else replace(fate.mission, tasks=seen)


def _last_change_s(mission: Mission, fate: Realization) -> float:
    """When the last task appears or is withdrawn [s mission time]; -1 if none ever is."""
    appear_s = [task.appears_s for task in mission.tasks if task.appears_s > 0.0]
    return max([*appear_s, *fate.withdrawn_at_s.values()], default=-1.0)


def _vehicles(fate: Realization) -> VehicleFactory:
    if fate.mission.is_plain:
        return partial(_vehicle, fate)
    takeoff_s = 0.0 if fate.uncertainty.ideal_communication else _TAKEOFF_S
    return vehicles_of(fate.mission, takeoff_s, fate if _troubled(fate) else None)


def _troubled(fate: Realization) -> bool:
    """Whether anything can happen to a vehicle but its loss."""
    what = fate.uncertainty
    troubles = what.speed_sd_frac, what.leg_sd_frac, what.wind_m_s, what.position_error_m
    as_planned = what.speed_frac == what.drain_frac == 1.0
    return what.outcomes or any(troubles) or not as_planned


def _vehicle(
    fate: Realization, queue: EventQueue, uav: str, report: Callable[[VehicleReport], None]
) -> SimulatedVehicle:
    """An ideal one where nothing can happen to it."""
    takeoff_s = 0.0 if fate.uncertainty.ideal_communication else _TAKEOFF_S
    if not _troubled(fate):
        return IdealVehicle(queue, report, takeoff_s)
    return StochasticVehicle(queue, uav, report, fate, takeoff_s)


def _preset(uncertainty: Uncertainty) -> LinkPreset:
    """Settings for a network that loses and delays so much, as a user would choose them.

    Delays beyond those that any preset is for lengthen its timers in proportion.
    """
    delay_s = uncertainty.delay_s + uncertainty.jitter_s
    lost = uncertainty.message_loss
    longer = 1.0
    if lost == 0.0 and delay_s <= 0.01:
        chosen = _WIRED
    elif lost <= 0.05 and delay_s <= 0.03:
        chosen = PRESETS[LinkKind.NORMAL]
    else:
        chosen, longer = PRESETS[LinkKind.BAD], max(1.0, delay_s / 0.1)
    timing = replace(chosen.timing.scaled(longer), status_s=_STATUS_S)
    return LinkPreset(longer * chosen.lease_s, longer * chosen.answer_s, timing)


def _network(fate: Realization, queue: EventQueue) -> Network:
    what = fate.uncertainty
    if not (what.message_loss or what.jitter_s or what.partitions_per_min):
        return IdealNetwork(queue, what.delay_s)
    preset = _preset(what)
    conditions = NetworkConditions(
        topology=Topology.ROUTERS,  # so that each side of a partition goes on by itself
        latency_s=what.delay_s,
        spread_s=what.jitter_s,
        lease_s=preset.lease_s,
        answer_s=preset.answer_s,
        loss_frac=what.message_loss,
    )
    return RoughNetwork(queue, conditions, fate.seed)


def _limit_s(fate: Realization, timing: Timing) -> float:
    """Virtual time by which the slowest UAV alone would have done everything, and waited."""
    mission = fate.mission
    places = [uav.position_enu_m for uav in mission.uavs]
    places += [task.position_enu_m for task in mission.tasks]
    across_m = float(np.linalg.norm(np.ptp(np.array(places), axis=0))) if places else 0.0
    slowest_s = max(
        (flown_s(across_m, uav.speed_m_s, uav.acceleration_m_s2) for uav in mission.uavs),
        default=across_m,
    )
    work_s = sum(task.service_s + slowest_s for task in mission.tasks)
    appears_s = max((task.appears_s for task in mission.tasks), default=0.0)
    opens_s = max((task.opens_s for task in mission.tasks), default=0.0)
    swap_s = max((base.swap_s for base in mission.bases), default=0.0)
    work_s += len(mission.tasks) * len(mission.uavs) * swap_s + opens_s
    waits_s = timing.abandon_s + timing.stalemate_s + timing.linger_s + 2.0 * timing.silence_s
    if mission.bases:
        waits_s += timing.clear_s
    return _START_S + appears_s + 4.0 * work_s + 10.0 * waits_s
