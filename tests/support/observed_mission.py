"""Observers for tests: fed by hand, or watching a whole mission in virtual time."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from coordinator.mission_view.mission_state import MissionState
from coordinator.planner.plan import make_plan
from sim.world.settings import ScheduledLosses
from sim.world.virtual_world import World
from swarm.model import Mission, Plan, Task, TaskId, Uav, UavId
from swarm.model.ids import COORDINATOR
from swarm.protocol.events import MessageReceived, PeerGone, PeerSeen, Tick
from swarm.protocol.messages import Body, Message, MissionPhase, PlanEpoch, Stamp, TaskEntry
from swarm.protocol.timing import Timing
from swarm.protocol.uav_messages import (
    AttemptResult,
    Claim,
    ClaimPhase,
    Outcome,
    Status,
    StatusPhase,
)
from swarm.runtime.clock import SystemClock
from swarm.scenario import load_scenario
from swarm.scenario.files import shipped_scenarios


def shipped(name: str) -> Mission:
    """A shipped scenario."""
    return load_scenario(shipped_scenarios()[name])


def random_mission(n_uav: int, n_task: int, seed: int) -> Mission:
    """Tasks uniform over a square kilometre."""
    rng = np.random.default_rng(seed)

    def place() -> tuple[float, float, float]:
        return float(rng.uniform(0.0, 1000.0)), float(rng.uniform(0.0, 1000.0)), 0.0

    return Mission(
        name="random",
        horizon_s=1000.0,
        uavs=tuple(Uav(UavId(f"uav{i}"), place(), 10.0) for i in range(n_uav)),
        tasks=tuple(Task(TaskId(f"t{i}"), place(), 1.0) for i in range(n_task)),
    )


def watch(
    mission: Mission,
    *,
    step_s: float | None = None,
    see: Callable[[MissionState, float], None] | None = None,
    lost_at_s: Mapping[UavId, float] | None = None,
) -> MissionState:
    """Fly ``mission`` by the greedy rule in virtual time; ``see`` is called every ``step_s``."""

    def plan(what: Mission, method: str, seed: int) -> Plan:
        return make_plan(what, method, clock=SystemClock(), seed=seed)

    world = World(
        mission,
        plan,
        method="greedy",
        seed=0,
        faults=ScheduledLosses(lost_at_s=lost_at_s or {}),
        timing=Timing(status_s=0.1 if step_s is None else step_s / 2.0),
    )

    def frame() -> None:
        if see is not None:
            see(world.mission_state, world.queue.now_s())
        if step_s is not None and world.alive:
            world.queue.at(world.queue.now_s() + step_s, frame)

    if step_s is not None:
        world.queue.at(step_s / 10.0, frame)
    assert world.run(limit_s=100_000.0)
    frame()
    return world.mission_state


class Teller:
    """Tells an observer what its writers say."""

    def __init__(self, mission: Mission) -> None:
        self.mission_state = MissionState(mission, Timing())
        self._mission = mission
        self._counter = 0

    def say(self, writer: str, body: Body, now_s: float = 0.0) -> None:
        self._counter += 1
        message = Message(self._mission.name, writer, Stamp(1, self._counter), body)
        self.mission_state.step(MessageReceived(message), now_s)

    def begin(self, now_s: float = 0.0) -> None:
        """Post every task, show every UAV and start the mission."""
        for number, task in enumerate(self._mission.known_at_start().tasks):
            self.post(task, number, now_s=now_s)
        for name in (COORDINATOR, *(uav.id for uav in self._mission.uavs)):
            self.mission_state.step(PeerSeen(name), now_s)
        self.epoch(MissionPhase.RUNNING, now_s)

    def post(self, task: Task, number: int, *, withdrawn: bool = False, now_s: float = 0.0) -> None:
        entry = TaskEntry(task.id, number, task.position_enu_m, task.value, 0.0, None, withdrawn)
        self.say(COORDINATOR, entry, now_s)

    def epoch(self, phase: MissionPhase, now_s: float = 0.0, number: int = 1) -> None:
        sequence = tuple(uav.id for uav in self._mission.uavs)
        epoch = PlanEpoch(number, phase, "greedy", sequence, now_s, "as told", {})
        self.say(COORDINATOR, epoch, now_s)

    def claim(self, uav: str, task: str, completion_s: float, now_s: float = 0.0) -> None:
        self.say(uav, Claim(ClaimPhase.HELD, task, now_s, 0, completion_s), now_s)

    def end(
        self, uav: str, task: str, now_s: float, result: AttemptResult = AttemptResult.DONE
    ) -> None:
        self.say(uav, Outcome(task, result, 1, now_s), now_s)

    def status(
        self,
        uav: str,
        phase: StatusPhase,
        now_s: float = 0.0,
        *,
        position_enu_m: tuple[float, float, float] | None = None,
        battery_frac: float | None = None,
        note: str = "",
    ) -> None:
        body = Status(phase, None, position_enu_m, None, battery_frac, now_s, {}, note)
        self.say(uav, body, now_s)

    def lose(self, writer: str, now_s: float) -> None:
        self.mission_state.step(PeerGone(writer), now_s)
        self.mission_state.step(Tick(), now_s + Timing().loss_delay_s)
