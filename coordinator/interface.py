"""What ``import swarm`` offers of this package: planning, and reading recordings.

Found by entry points (swarm.interface, which documents it).
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from coordinator.mission_view.mission_state import MissionState
from coordinator.mission_view.results import MissionResult
from coordinator.planner.options import BOUND_S, after_time, bound_frac
from coordinator.planner.plan import METHODS, make_plan
from swarm.allocation.own_rule import DecisionRule, FunctionRule
from swarm.interface import Flight
from swarm.model import Mission, Plan
from swarm.protocol.events import CommonEvent
from swarm.runtime.clock import SystemClock
from swarm.runtime.errors import remedy_for_name


def plan(
    mission: Mission,
    method: str | DecisionRule = "guided",
    *,
    seed: int = 0,
    time_limit_s: float | None = None,
    bound: bool = True,
) -> Plan:
    """Plan a mission; see `swarm.interface.plan`."""
    if isinstance(method, str) and method not in METHODS:
        raise ValueError(f"no such method {method!r}; {remedy_for_name(method, METHODS)}")
    if seed < 0:
        raise ValueError(f"seed must be >= 0, not {seed}")
    if time_limit_s is not None and not time_limit_s > 0.0:
        raise ValueError(f"time_limit_s must be > 0, not {time_limit_s}")
    clock = SystemClock()
    return make_plan(
        mission,
        method if isinstance(method, str) else FunctionRule.of(method, mission),
        clock=clock,
        seed=seed,
        stop=None if time_limit_s is None else after_time(clock, time_limit_s),
        bound_s=BOUND_S if bound else None,
        bound_frac=bound_frac(time_limit_s, proves=method == "exact"),
    )


def read_recording(recording: str | os.PathLike[str]) -> Flight:
    """What became of a recorded mission; see `swarm.interface.read_recording`."""
    from coordinator.recording.playback import Playback
    from coordinator.recording.reader import read_recording as read

    found = read(Path(recording))
    playback = Playback(found)
    playback.seek(playback.duration_s)
    state = playback.mission_state
    result = state.result()
    return flight_of(
        state,
        result,
        value=result.executed_objective,
        facts=[(entry.now_s, entry.fact) for entry in found.entries],
        cut_short=found.torn,
    )


def flight_of(
    state: MissionState,
    result: MissionResult,
    *,
    value: float,
    mission: Mission | None = None,
    facts: Sequence[tuple[float, CommonEvent]] = (),
    cut_short: str | None = None,
) -> Flight:
    """What an observer has seen in the end, for the users of the interface.

    ``value`` is that of what was flown [value·s]; ``mission`` has all tasks that appeared, and is
    the observer's own when None; ``cut_short`` says why it ends before its time.
    """
    return Flight(
        mission=state.mission if mission is None else mission,
        plan=state.plan,
        routes=result.executed_routes,
        completion_s=result.executed_completion_s,
        objective=result.executed_objective,
        value=value,
        done=result.done,
        failed=result.failed,
        open=result.open,
        lost_uavs=result.lost_uavs,
        duplicate_visits=result.duplicate_visits,
        makespan_s=result.makespan_s,
        epochs=result.epochs,
        story=tuple((line.mission_s, line.text) for line in state.story),
        facts=facts,
        cut_short=cut_short,
    )
