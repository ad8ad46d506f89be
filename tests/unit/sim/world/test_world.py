"""The virtual-time world: what goes wrong when, and that a seed says it all."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from agent.core.agent_core import AgentCore
from agent.core.interface import Action, Event, Telemetry
from coordinator.planner.options import after_evaluations
from coordinator.planner.plan import make_plan
from sim.world.network import IdealNetwork
from sim.world.settings import QUIET, ScheduledLosses, WorldSettings
from sim.world.virtual_world import World
from swarm.model import Mission, Plan, UavId
from swarm.model.ids import COORDINATOR
from swarm.protocol.timing import Timing
from swarm.runtime.clock import SystemClock
from tests.support.builders import mission, random_mission, task, uav

CLOCK = SystemClock()


def planner(what: Mission, method: str, seed: int) -> Plan:
    return make_plan(what, method, clock=CLOCK, seed=seed, stop=after_evaluations(5))


def world_of(
    flown: Mission,
    *,
    lost: dict[str, float] | None = None,
    coordinator_lost_at_s: float | None = None,
    latency_s: float = 0.0,
    timing: Timing = QUIET,
) -> World:
    lost_at_s = {UavId(name): at_s for name, at_s in (lost or {}).items()}
    return World(
        flown,
        planner,
        method="greedy",
        seed=0,
        faults=ScheduledLosses(lost_at_s, coordinator_lost_at_s),
        latency_s=latency_s,
        timing=timing,
    )


def story(world: World) -> list[tuple[float | None, str]]:
    return [(told.mission_s, told.text) for told in world.mission_state.story]


PAIR = mission([uav("u0"), uav("u1", east_m=40.0)], [task("t0", 10.0), task("t1", 30.0)])


def rough(seed: int) -> World:
    rng = np.random.default_rng(seed)
    flown = random_mission(rng, max_uavs=6, max_tasks=15, popup_frac=0.3)
    lost = {str(u.id): float(rng.uniform(0.0, 40.0)) for u in flown.uavs[1:] if rng.random() < 0.5}
    return world_of(flown, lost=lost, latency_s=0.03)


def test_the_same_seed_gives_the_same_story() -> None:
    for seed in range(5):
        one, two = rough(seed), rough(seed)
        assert one.run(1e5)
        assert two.run(1e5)
        assert story(one) == story(two)
        assert one.mission_state.result() == two.mission_state.result()


def test_the_same_seed_gives_the_same_story_in_another_process() -> None:
    """Python orders sets of names anew in every process."""
    code = (
        "from tests.unit.sim.world.test_world import rough, story\n"
        "for seed in range(3):\n    world = rough(seed); world.run(1e5); print(story(world))"
    )

    def told(hash_seed: str) -> str:
        return subprocess.run(
            [sys.executable, "-c", code],
            cwd=Path(__file__).parents[4],
            env={**os.environ, "PYTHONHASHSEED": hash_seed},
            capture_output=True,
            check=True,
            text=True,
        ).stdout

    assert told("1") == told("2") != ""


def test_losses_are_at_mission_time_whatever_the_latency() -> None:
    for latency_s in (0.0, 0.05):
        world = world_of(PAIR, lost={"u0": 5.0}, latency_s=latency_s)
        assert world.run(1e4)

        (lost_s,) = [at_s for at_s, text in story(world) if "lost" in text]
        assert lost_s == pytest.approx(5.0 + QUIET.loss_delay_s, abs=2 * latency_s + 1e-9)
        assert world.mission_state.result().lost_uavs == ("u0",)
        assert world.mission_state.result().done == ("t0", "t1")


def test_nothing_goes_wrong_before_the_mission_begins() -> None:
    world = world_of(PAIR, lost={"u0": 0.0}, coordinator_lost_at_s=0.0)
    assert world.run(1e4)

    assert story(world)[0] == (0.0, "epoch 1: greedy, u0 > u1")
    assert set(world.finished) == {"u1"}
    assert world.mission_state.result().done == ("t0", "t1")


def test_the_story_tells_the_loss_of_everyone() -> None:
    world = world_of(PAIR, lost={"u0": 5.0, "u1": 6.0}, coordinator_lost_at_s=6.0)
    assert world.run(1e4)

    told = " ".join(text for _, text in story(world))
    assert all(f"{name} lost" in told for name in ("u0", "u1", COORDINATOR))
    assert world.mission_state.result().open == ("t0", "t1")
    assert world.finished == {}


def test_when_nobody_is_left_the_coordinator_ends_the_mission() -> None:
    world = world_of(PAIR, lost={"u0": 5.0, "u1": 6.0})
    assert world.run(1e4)

    assert world.finished == {COORDINATOR: 1}


def test_whoever_is_left_without_a_coordinator_goes_home_though_tasks_are_open() -> None:
    flown = mission([uav("u0", t1=0.0), uav("u1", t0=0.0)], [task("t0", 10.0), task("t1", 30.0)])
    world = world_of(flown, lost={"u1": 5.0}, coordinator_lost_at_s=1.0)
    assert world.run(1e4)

    assert world.finished == {"u0": 0}
    assert world.mission_state.result().open == ("t1",)


def test_a_run_that_is_not_over_in_time_says_so() -> None:
    assert not world_of(PAIR).run(3.0)


def test_repeating_everything_changes_nothing() -> None:
    quiet, busy = world_of(PAIR), world_of(PAIR, timing=Timing())
    assert quiet.run(1e4)
    assert busy.run(1e4)

    assert quiet.mission_state.result() == busy.mission_state.result()


def test_an_agent_hears_its_vehicle_while_nobody_says_anything() -> None:
    """It hovers for 20 s over a task of the only UAV, and no word comes from anybody."""
    heard_s: list[float] = []

    class Listening(AgentCore):
        def step(self, event: Event, now_s: float) -> list[Action]:
            if isinstance(event, Telemetry):
                heard_s.append(now_s)
            return super().step(event, now_s)

    flown = mission([uav("u0")], [task("t0", 10.0, service_s=20.0)])
    setting = WorldSettings(
        lambda queue: IdealNetwork(queue, 0.0), telemetry_s=0.2, agent=Listening
    )
    world = World(flown, planner, method="greedy", seed=0, setting=setting)
    assert world.run(1e4)

    assert heard_s[-1] - heard_s[0] > 20.0
    assert max(np.diff(heard_s)) < 0.2 + 1e-6


@pytest.mark.parametrize("faults", [{"lost_at_s": {"u0": -1.0}}, {"coordinator_lost_at_s": -1.0}])
def test_faults_before_mission_time_zero_are_refused(faults: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="mission times >= 0"):
        ScheduledLosses(**faults)  # type: ignore[arg-type]  # names and values vary together
