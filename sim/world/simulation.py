"""One mission in virtual time, from a scenario and one seed, and its recording."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from agent.core.agent_core import AgentCore
from coordinator.mission_view.mission_state import MissionState
from coordinator.mission_view.results import MissionResult
from coordinator.planner.plan import make_plan
from sim.world.outcome import value_of
from sim.world.settings import Planner
from sim.world.stochastic_world import ObserverMaker, StochasticWorld
from sim.world.uncertainty import Uncertainty
from sim.world.virtual_world import World
from swarm.model import Mission, Plan, UavId
from swarm.protocol.events import CommonAction
from swarm.protocol.timing import Timing
from swarm.runtime.clock import SystemClock
from swarm.runtime.errors import SwarmError


@dataclass(frozen=True, slots=True, eq=False)
class SimulatedMission:
    """A mission that is over."""

    world: World
    result: MissionResult
    """What was executed; the lost are those that really were."""
    lost_because: dict[UavId, str]
    """When and why, in the order of the losses."""
    value: float
    """Of what was flown: where outcomes are drawn only success counts [value·s]."""
    in_time: bool
    """Whether it ended by itself; else somebody would have waited for ever."""


def plan_once(make: Planner, made: Iterable[tuple[Mission, Plan]] = ()) -> Planner:
    """Plan by ``make``, and no mission twice that begins alike; some are ``made`` already."""
    plans = [(mission.known_at_start(), plan) for mission, plan in made]

    def planner(mission: Mission, method: str, seed: int) -> Plan:
        known = mission.known_at_start()
        for earlier, plan in plans:
            if earlier == known:
                return plan
        plan = make(known, method, seed)
        plans.append((known, plan))
        return plan

    return planner


def _plan_by_method(mission: Mission, method: str, seed: int) -> Plan:
    return make_plan(mission, method, clock=SystemClock(), seed=seed)


def simulate_mission(
    mission: Mission,
    *,
    method: str,
    seed: int,
    uncertainty: Uncertainty,
    coordinator_lost_s: float | None = None,
    make_observer: ObserverMaker | None = None,
    make_agent: Callable[..., AgentCore] = AgentCore,
    planner: Planner | None = None,
) -> SimulatedMission:
    """Fly ``mission``, pop-ups included, in virtual time to its end.

    Args:
        mission: the scenario.
        method: planning method whose rule the agents use.
        seed: of the planner and of all that is uncertain.
        uncertainty: what may go wrong; moments are spread over the time the scenario's plan takes.
        coordinator_lost_s: mission time at which the coordinator dies [s]; None if it lives.
        make_observer: makes the core that looks on; nothing that is flown depends on it.
        make_agent: makes the core of an agent.
        planner: makes every plan; `plan_once` with `make_plan` when None.
    """
    planner = plan_once(_plan_by_method) if planner is None else planner
    span_s = max(planner(mission, method, seed).completion_s.values(), default=0.0)
    fate = uncertainty.draw(mission, span_s, seed)
    flown = StochasticWorld(
        fate,
        planner,
        method=method,
        seed=seed,
        coordinator_lost_s=coordinator_lost_s,
        make_agent=make_agent,
        make_observer=make_observer,
    )
    in_time = flown.run()
    return SimulatedMission(
        world=flown.world,
        result=replace(flown.world.mission_state.result(), lost_uavs=tuple(flown.lost)),
        lost_because=dict(flown.lost),
        value=value_of(fate, flown.tally.visits),
        in_time=in_time,
    )


@contextlib.contextmanager
def recording_simulation(
    mission: str, scenario: str, path: Path | None
) -> Iterator[ObserverMaker | None]:
    """What makes an observer whose facts go into a new file; None if there is no path.

    Raises:
        SwarmError: in the end, if not everything could be written.
    """
    if path is None:
        yield None
        return
    from coordinator.recording.flight_recorder import recording_to, virtual_ns
    from coordinator.recording.recorder import RecordedCore, RecordingInfo

    faults: list[str] = []
    with contextlib.ExitStack() as open_files:

        def look_on(mission_state: MissionState, timing: Timing) -> RecordedCore[CommonAction]:
            about = RecordingInfo(mission, timing, scenario=scenario, virtual=True)
            recorder = open_files.enter_context(
                recording_to(path, about, virtual_ns, faults.append, patient=True)
            )
            return recorder.around(mission_state, mission_state)

        yield look_on
    if faults:
        raise SwarmError(faults[0])
