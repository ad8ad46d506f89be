"""A mission of real processes whose router controls nobody, beside one that lies about them all.

Keys are made for the flight, everything is encrypted and signed, and the liar has the keys of
a UAV that does not fly. Its router lets it write whatever it likes, as a broken one would, so
all of its lies arrive, and each process has to see through them by itself. Leaves out: what
the lies are (tests.chaos.insider), and floods (sim.fleet.faults.torrent).
"""

from __future__ import annotations

import asyncio
import contextlib
import secrets
import tempfile
from collections import Counter
from collections.abc import AsyncIterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from coordinator.mission_view.results import MissionResult
from sim.fleet.faults.flood import STATUS, hold_back, let_go, long_mission, watched
from sim.fleet.keys import RunKeys, fresh_keys
from sim.fleet.layout import BusKind, LaunchOptions, default_position_rate_hz
from sim.fleet.run import Run, open_run
from swarm.bus.port import Bus, Sample
from swarm.bus.tls import secure
from swarm.bus.zenoh_bus import open_zenoh_bus
from swarm.bus.zenoh_session import lay_over, session_config
from swarm.identity import load_identity
from swarm.identity.shared_secrets import door_dictionary
from swarm.model import Mission, UavId
from swarm.protocol.key_space import KeySpace
from swarm.protocol.sync import NONCE_BYTES, encode_question
from swarm.protocol.timing import LinkKind, preset
from swarm.runtime.errors import SwarmError
from swarm.scenario.write import format_scenario
from tests.chaos.insider import Insider, Trick

LIAR = "stolen"
"""Name of the UAV whose keys the liar has."""
LIES_HZ, QUESTIONS_HZ = 100.0, 30.0
READY_S = 60.0
ANSWER_S = 0.5
SETTLE_S = 1.0
"""Until what was said last has been counted and told [wall s]."""


@dataclass(frozen=True, slots=True)
class Unguarded:
    """What came of the flight."""

    result: MissionResult
    planned: Mapping[UavId, tuple[str, ...]]
    lies: Mapping[Trick, int]
    questions: int
    dropped: Mapping[str, Mapping[str, int]]
    """What each UAV has dropped by reason, as `swarm status` tells after the last lie."""
    fates: tuple[str, ...]
    """How processes ended that should not have."""


async def fly_unguarded(times: float, *, speedup: float = 1.0, seed: int = 0) -> Unguarded:
    """Fly a mission of some ``3 times`` seconds beside a liar; see `long_mission`.

    Args:
        times: how long the mission is.
        speedup: mission seconds per wall second.
        seed: of the lies.

    Raises:
        SwarmError: something did not start.
        TimeoutError: the mission did not get on.
    """
    mission = long_mission(times)
    with tempfile.TemporaryDirectory() as folder, fresh_keys(mission, strangers=[LIAR]) as keys:
        scenario = Path(folder) / "unguarded.toml"
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
            keys=keys,
            router_file=_router_file(Path(folder), keys),
        )
        async with open_run(mission, options, observers=(LIAR, STATUS)) as run:
            hold_back(run)
            async with watched(run, mission.name) as watch:
                async with _liar(run, mission, seed) as liar:
                    let_go(run)
                    await run.until(
                        lambda: len(run.mission_state.result().done) >= len(mission.tasks) - 2,
                        limit_s=READY_S + 10.0 * times,
                        what="all tasks but two done",
                    )
                await asyncio.sleep(SETTLE_S)
                status = await watch.told()
            await run.finish()
        flight = run.flight()
    if flight.plan is None:
        raise SwarmError("the coordinator has told no plan")
    return Unguarded(
        result=flight.result,
        planned={uav: tuple(route) for uav, route in flight.plan.routes.items()},
        lies=dict(liar.lies),
        questions=liar.questions,
        dropped={uav["id"]: uav["dropped"] for uav in status["uavs"]},
        fates=flight.fates,
    )


def _router_file(folder: Path, keys: RunKeys) -> Path:
    """A configuration of the router with certificates and a door, by which all may say all."""
    identity = load_identity(keys.of_router(0))
    config = session_config(
        "router", listen=[], connect=[], lease_s=preset(LinkKind.NORMAL).lease_s
    )
    door = folder / "door"
    passwords = door_dictionary(identity.roster, identity.door_secret or b"")
    door.write_text("".join(f"{user}:{word}\n" for user, word in passwords.items()))
    secure(config, identity, "router", identity.roster, door)
    lay_over(
        config,
        {"access_control": {"enabled": False}, "downsampling": [], "low_pass_filter": []},
    )
    file = folder / "router.json5"
    file.write_text(str(config), encoding="utf-8")
    return file


class _Liar:
    """Has a seat, and says what is not so."""

    def __init__(self, bus: Bus, mission: Mission, insider: Insider) -> None:
        self.lies: Counter[Trick] = Counter()
        self.questions = 0
        self._bus = bus
        self._insider = insider
        self._keys = KeySpace(mission.name)
        bus.subscribe(f"{self._keys.root}/uav/**")
        bus.subscribe(self._keys.plan)
        bus.declare_token(self._keys.alive(LIAR))

    async def lie(self) -> None:
        """Lie until cancelled, and hear meanwhile what can be replayed."""
        while True:
            for event in self._bus.inbox.take():
                if isinstance(event, Sample):
                    self._insider.overhear(event.key, event.payload)
            told = self._insider.lie()
            self._bus.publish(told.key, told.payload)
            self.lies[told.trick] += 1
            await asyncio.sleep(1.0 / LIES_HZ)

    async def ask(self) -> None:
        """Ask everybody until cancelled, whatever they answer."""
        while True:
            question = encode_question({}, secrets.token_bytes(NONCE_BYTES), self._bus.seal)
            asking = self._bus.query(self._keys.state("*"), question, timeout_s=ANSWER_S)
            self.questions += 1
            await asyncio.gather(asking, asyncio.sleep(1.0 / QUESTIONS_HZ))


@contextlib.asynccontextmanager
async def _liar(run: Run, mission: Mission, seed: int) -> AsyncIterator[_Liar]:
    """A liar at work, once all agents are there, until the context is left."""
    # Its seat is open by then, or else a busy machine would leave it no time to lie.
    bus = await open_zenoh_bus(run.launch.layout.observer_seat(LIAR))
    try:
        await run.until(
            lambda: len(run.mission_state.statuses) == len(mission.uavs),
            limit_s=READY_S,
            what="all agents there",
        )
        if bus.seal is None:
            raise SwarmError("a liar needs keys")
        uavs, tasks = [uav.id for uav in mission.uavs], [task.id for task in mission.tasks]
        rng = np.random.default_rng(seed)
        liar = _Liar(bus, mission, Insider(mission.name, bus.seal, uavs, tasks, rng))
        work = [asyncio.ensure_future(each) for each in (liar.lie(), liar.ask())]
        try:
            yield liar
        finally:
            for task in work:
                task.cancel()
            await asyncio.gather(*work, return_exceptions=True)
    finally:
        bus.close()
