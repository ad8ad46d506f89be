"""A mission of real processes beside one with valid keys that floods them, from start to end.

With keys made for the flight, signed and encrypted. The flooder has the keys of a UAV that
does not fly; it is met by the routers' access control, or with that switched off by each
process alone. Measured is how long the agents take from an arrival to their next target.
Leaves out: what the flooder says (sim.chaos.flooder) and how it is shown
(sim.bench.insider_flood).
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import sys
import tempfile
from collections.abc import AsyncIterator, Callable, Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

from agent.mavlink.vehicle import TURNAROUNDS
from coordinator.observer import MissionResult
from sim.chaos.flood import long_mission
from sim.chaos.flooder import READY, Orders, Sent
from sim.launch.fleet import BusKind, LaunchOptions, default_position_rate_hz
from sim.launch.keys import RunKeys, fresh_keys
from sim.launch.run import Run, open_run
from swarm.bus.config import ClientTopology
from swarm.bus.secure import secure_settings
from swarm.bus.zenoh_session import lay_over, session_config
from swarm.config import Link, preset
from swarm.errors import SwarmError
from swarm.identity import load_identity
from swarm.identity.door import door_dictionary
from swarm.log import LogFormat
from swarm.model import Mission, UavId
from swarm.scenario.write import format_scenario

__all__ = [
    "FLOODER",
    "LIMIT_MS",
    "QUESTIONS_HZ",
    "RATE_HZ",
    "Flooding",
    "InsiderFlood",
    "flooded",
    "fly_beside_flooder",
]

FLOODER = "stolen"
"""Name of the UAV whose keys the flooder has."""
RATE_HZ = 10_000.0
QUESTIONS_HZ = 300.0
LIMIT_MS = 100.0
"""The decision latency of the others shall stay below this."""
READY_S = 60.0
ACCESS = ("access_control", "downsampling", "low_pass_filter")


@dataclass(frozen=True, slots=True)
class InsiderFlood:
    """What came of a flooded mission."""

    guarded: bool
    """Whether the routers controlled who writes what."""
    result: MissionResult
    planned: Mapping[UavId, tuple[str, ...]]
    sent: Sent | None
    """None where nobody flooded, to compare with."""
    target_ms: tuple[float, ...]
    """Wall times of all agents from an arrival to the next target sent."""
    dropped: Mapping[str, Mapping[str, int]]
    """What each UAV says it has dropped by the end of the flood, as `swarm status` shows it."""
    fates: tuple[str, ...]
    """How processes ended that should not have."""

    @property
    def decisions_kept(self) -> bool:
        """Whether every list flown is the one planned."""
        return self.result.executed_routes == self.planned


@dataclass(slots=True)
class _Heard:
    target_ms: list[float] = field(default_factory=list)

    def line(self, _name: str, line: str) -> None:
        if TURNAROUNDS in line:
            with contextlib.suppress(ValueError):
                said = json.loads(line)
                if said.get("event") == TURNAROUNDS:
                    self.target_ms += said["target_ms"]


async def fly_beside_flooder(
    times: float,
    *,
    guarded: bool = True,
    rate_hz: float = RATE_HZ,
    questions_hz: float = QUESTIONS_HZ,
    speedup: float = 1.0,
    seed: int = 0,
    on_progress: Callable[[str], None] | None = None,
) -> InsiderFlood:
    """Fly a mission of some ``3 times`` seconds beside a flooder; see `long_mission`.

    Args:
        times: how long the mission is.
        guarded: let the routers control who writes what.
        rate_hz: messages of the flooder; 0 for none, to compare with.
        questions_hz: questions of the flooder.
        speedup: mission seconds per wall second.
        seed: of what it says.
        on_progress: told what is being done.

    Raises:
        SwarmError: something did not start.
        TimeoutError: the mission did not get on.
    """
    tell = on_progress or (lambda _: None)
    mission, heard = long_mission(times), _Heard()
    with tempfile.TemporaryDirectory() as folder, fresh_keys(mission, strangers=[FLOODER]) as keys:
        scenario = Path(folder) / "flooded.toml"
        scenario.write_text(format_scenario(mission), encoding="utf-8")
        options = LaunchOptions(
            scenario=scenario,
            method="greedy",
            seed=0,
            speedup=speedup,
            bus=BusKind.ROUTER,
            position_rate_hz=default_position_rate_hz(len(mission.uavs)),
            acceptance_radius_m=0.5,
            start_timeout_s=120.0,
            log_format=LogFormat.JSON,
            keys=keys,
        )
        if not guarded:
            options = replace(options, router_file=_unguarded(Path(folder), keys))
        async with open_run(mission, options, on_log=heard.line) as run:
            tell("waiting for the agents")
            await run.until(
                lambda: len(run.observer.statuses) == len(mission.uavs),
                limit_s=READY_S,
                what="all agents there",
            )
            async with flooded(run, mission, keys, rate_hz, questions_hz, seed) as flooding:
                tell("flooding")
                await run.until(
                    lambda: len(run.observer.result().done) >= len(mission.tasks) - 1,
                    limit_s=READY_S + 10.0 * times,
                    what="all tasks but one done",
                )
                dropped = {uav: dict(count) for uav, count in run.observer.dropped.items()}
                tell("waiting for the end")
                await run.finish()
        flight = run.flight()
    if flight.plan is None:
        raise SwarmError("the coordinator has told no plan")
    return InsiderFlood(
        guarded=guarded,
        result=flight.result,
        planned={uav: tuple(route) for uav, route in flight.plan.routes.items()},
        sent=flooding.sent,
        target_ms=tuple(heard.target_ms),
        dropped=dropped,
        fates=flight.fates,
    )


def _unguarded(folder: Path, keys: RunKeys) -> Path:
    """A configuration of the router by which TLS alone decides, and lets all say all."""
    identity = load_identity(keys.of_router(0))
    config = session_config("router", listen=[], connect=[], lease_s=preset(Link.NORMAL).lease_s)
    door = folder / "door"
    passwords = door_dictionary(identity.roster, identity.door_secret or b"")
    door.write_text("".join(f"{user}:{word}\n" for user, word in passwords.items()))
    settings = secure_settings(identity, "router", identity.roster, door)
    lay_over(config, {path: value for path, value in settings.items() if path not in ACCESS})
    file = folder / "router.json5"
    file.write_text(str(config), encoding="utf-8")
    return file


@dataclass(slots=True)
class Flooding:
    """A flood that is going on."""

    sent: Sent | None = None
    """What the flooder has done; None until it is over."""


@contextlib.asynccontextmanager
async def flooded(
    run: Run, mission: Mission, keys: RunKeys, rate_hz: float, questions_hz: float, seed: int
) -> AsyncIterator[Flooding]:
    """A flooder at work until the context is left, if there is to be one.

    Args:
        run: has routers.
        mission: being flown.
        keys: of the run; `FLOODER` is among them.
        rate_hz: messages of the flooder; 0 for none.
        questions_hz: its questions.
        seed: of what it says.
    """
    flooding = Flooding()
    if not rate_hz:
        yield flooding
        return
    topology = run.launch.layout.seat_of_onlooker(FLOODER).topology
    if not isinstance(topology, ClientTopology):
        raise SwarmError("the flooder sits at a router")
    orders = Orders(
        keys=str(keys.of_seat(FLOODER)),
        routers=topology.routers,
        mission=mission.name,
        others=tuple(uav.id for uav in mission.uavs),
        tasks=tuple(task.id for task in mission.tasks),
        rate_hz=rate_hz,
        questions_hz=questions_hz,
        seed=seed,
    )
    process = await asyncio.create_subprocess_exec(
        sys.executable,
        *("-m", "sim.chaos.flooder", json.dumps(asdict(orders))),
        stdin=asyncio.subprocess.PIPE,
        stdout=asyncio.subprocess.PIPE,
    )
    if process.stdin is None or process.stdout is None:
        raise SwarmError("the flooder has no way to be told anything")
    try:
        async with asyncio.timeout(READY_S):
            if (await process.stdout.readline()).decode().strip() != READY:
                raise SwarmError("the flooder did not start")
        process.stdin.write(b"begin\n")
        yield flooding
        process.stdin.close()
        async with asyncio.timeout(READY_S):
            told: dict[str, Any] = json.loads(await process.stdout.readline())
            await process.wait()
        flooding.sent = Sent(**told)
    finally:
        if process.returncode is None:
            process.kill()
            await process.wait()
