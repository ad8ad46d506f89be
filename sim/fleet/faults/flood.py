"""A mission of real processes while a hostile peer floods its bus with malformed messages.

The mission is the paper's, drawn out so that it lasts: a larger map and a longer horizon make the
same decisions, none of which is nearly a tie.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import sys
import tempfile
from collections import Counter
from collections.abc import AsyncIterator, Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from coordinator.mission_view.results import MissionResult
from sim.fleet.child_process import ChildProcess
from sim.fleet.faults.forgery import REASONS, Malformation, MessageForger
from sim.fleet.layout import BusKind, LaunchOptions, default_position_rate_hz
from sim.fleet.run import Run, open_run
from swarm.bus.port import Bus, Query, Sample
from swarm.bus.zenoh_bus import open_zenoh_bus
from swarm.model import Mission, UavId
from swarm.protocol.codec import Codec
from swarm.protocol.key_space import KeySpace
from swarm.runtime.clock import Clock, SystemClock
from swarm.runtime.errors import SwarmError
from swarm.scenario import load_scenario
from swarm.scenario.files import shipped_scenarios
from swarm.scenario.write import format_scenario

RATE_HZ = 24.0
"""Messages of each kind per second, but for the longest."""
HUGE_EVERY = 8
"""One in so many is a megabyte long. If all were, a busy machine would shift 100 MB a second from
one process to the next, and a link that stands still for half a second is closed: what is lost
then cannot be counted."""
HOSTILE = "hostile"
STATUS = "status"
GHOSTS = 8
"""Liveliness tokens of processes that do not exist, shown one after the other."""
SETTLE_S = 0.6
"""Until what was sent last has been counted and told [wall s]; on a busy machine, much later."""
TAKE_OFF_S = 9.0
"""From the first agent that is there to the mission's beginning [s]."""
FLOODED_S = 1.9
"""When the paper's mission is done but for two tasks [s]."""
LONGEST_LINE = 1 << 22
"""Bytes in which `swarm status` tells how a mission stands."""
READY_S, LOOK_S, FLOOD_LIMIT_S = 60.0, 60.0, 300.0
"""Limits for the fleet to be there, for `swarm status` to tell and for the flood [wall s]."""


@dataclass(frozen=True, slots=True)
class Flood:
    """What came of a flooded mission."""

    result: MissionResult
    planned: dict[UavId, tuple[str, ...]]
    """The lists of the offline plan, which a mission without a flood flies."""
    sent: Mapping[Malformation, int]
    """Malformed messages sent, by kind."""
    answers: int
    """Malformed answers given to questions."""
    flood_s: float
    """How long the flood lasted [wall s]."""
    before: Mapping[str, Mapping[str, int]]
    """What each UAV had dropped before the flood, by reason."""
    after: Mapping[str, Mapping[str, int]]
    """What each UAV had dropped when the mission was over, by reason."""
    shown: Mapping[str, Any]
    """What `swarm status --watch --json` told next after the flood."""
    fates: tuple[str, ...]
    """How processes ended that should not have."""

    @property
    def expected(self) -> Mapping[str, int]:
        """What each UAV should have dropped of what was sent, by reason."""
        total: Counter[str] = Counter()
        for kind, count in self.sent.items():
            total[REASONS[kind]] += count
        return total

    @property
    def counted(self) -> Mapping[str, Mapping[str, int]]:
        """What each UAV says it has dropped since the flood began, by reason."""
        return {
            uav: {why: count - self.before[uav].get(why, 0) for why, count in dropped.items()}
            for uav, dropped in self.after.items()
        }

    @property
    def ok(self) -> bool:
        """Whether the flood has changed nothing and everyone has counted it."""
        counted = all(
            count.get(reason, 0) >= expected
            for count in self.counted.values()
            for reason, expected in self.expected.items()
        )
        return self.decisions_kept and not self.result.open and not self.fates and counted

    @property
    def decisions_kept(self) -> bool:
        """Whether every list flown is the one planned."""
        return self.result.executed_routes == self.planned


def _dropped(run: Run) -> dict[str, Mapping[str, int]]:
    """What each UAV has last said it has dropped, by reason."""
    return {uav: dict(status.dropped) for uav, status in run.mission_state.statuses.items()}


def long_mission(times: float) -> Mission:
    """The paper's mission, ``times`` as long: every way and the horizon are that much longer."""
    paper = load_scenario(shipped_scenarios()["table-1"])

    def away(point: tuple[float, float, float]) -> tuple[float, float, float]:
        return point[0] * times, point[1] * times, point[2]

    return replace(
        paper,
        name="flooded",
        horizon_s=paper.horizon_s * times,
        uavs=tuple(replace(uav, position_enu_m=away(uav.position_enu_m)) for uav in paper.uavs),
        tasks=tuple(replace(t, position_enu_m=away(t.position_enu_m)) for t in paper.tasks),
    )


def hold_back(run: Run) -> None:
    """Let the mission wait for its vehicles until `let_go`.

    However slowly others that take part start, they find the mission at its beginning.
    """
    for autopilot in _autopilots(run):
        autopilot.pause()


def let_go(run: Run) -> None:
    """Let the mission begin after `hold_back`."""
    for autopilot in _autopilots(run):
        autopilot.resume()


def _autopilots(run: Run) -> list[ChildProcess]:
    names = [name for name in run.launch.names if name.startswith("autopilot of ")]
    return [run.launch.child(name) for name in names]


def times_for(flood_s: float) -> float:
    """How long a mission, see `long_mission`, is flooded for about ``flood_s``."""
    return max(0.5, (flood_s - TAKE_OFF_S) / FLOODED_S)


async def fly_flooded(
    times: float,
    *,
    seed: int = 0,
    bus: BusKind = BusKind.ROUTER,
    on_progress: Callable[[str], None] | None = None,
) -> Flood:
    """Fly a mission of some ``3 times`` seconds (`long_mission`) under a flood almost to its end.

    The flood begins when all agents are there, before they take off, and ends when all tasks but
    the last two are done, so that `swarm status` can still tell of it.

    Raises:
        SwarmError: something did not start, or `swarm status` failed.
        TimeoutError: the mission did not get on.
    """
    tell = on_progress or (lambda _: None)
    mission = long_mission(times)
    rng = np.random.default_rng(seed)
    with tempfile.TemporaryDirectory() as folder:
        scenario = Path(folder) / "flooded.toml"
        scenario.write_text(format_scenario(mission), encoding="utf-8")
        options = LaunchOptions(
            scenario=scenario,
            method="greedy",
            seed=0,
            speedup=1.0,
            bus=bus,
            position_rate_hz=default_position_rate_hz(len(mission.uavs)),
            acceptance_radius_m=0.5,
            start_timeout_s=120.0,
        )
        async with open_run(mission, options, observers=(HOSTILE, STATUS)) as run:
            tell("waiting for the mission to begin")
            hold_back(run)
            async with (
                watched(run, mission.name) as watch,  # it starts while the agents do
                _hostile(run, mission, rng) as peer,
            ):
                await run.until(
                    lambda: (
                        run.mission_state.replica.brief is not None
                        and len(run.mission_state.statuses) == len(mission.uavs)
                    ),
                    limit_s=READY_S,
                    what="all agents there",
                )
                before = _dropped(run)
                tell("flooding")
                let_go(run)
                seconds = await peer.flood_until(
                    lambda: len(run.mission_state.result().done) >= len(mission.tasks) - 2,
                    limit_s=FLOOD_LIMIT_S,
                )
                await asyncio.sleep(SETTLE_S)
                shown = await watch.told()
                tell("waiting for the end")
                await run.finish()
                after = _dropped(run)
        flight = run.flight()
    if flight.plan is None:
        raise SwarmError("the coordinator has told no plan")
    return Flood(
        result=flight.result,
        planned={uav: tuple(route) for uav, route in flight.plan.routes.items()},
        sent=dict(peer.sent),
        answers=peer.answers,
        flood_s=seconds,
        before=before,
        after=after,
        shown=shown,
        fates=flight.fates,
    )


class _Peer:
    """The hostile peer: floods, shows ghosts, and answers whoever asks."""

    def __init__(self, bus: Bus, mission: Mission, clock: Clock, rng: np.random.Generator) -> None:
        uavs = [uav.id for uav in mission.uavs]
        self.sent: Counter[Malformation] = Counter()
        self.answers = 0
        self._bus = bus
        self._clock = clock
        self._keys = KeySpace(mission.name)
        self._codec = Codec(mission.name)
        self._forger = MessageForger(mission.name, uavs, [task.id for task in mission.tasks], rng)
        for key_expr in (self._keys.brief, self._keys.plan, self._keys.board("*")):
            bus.subscribe(key_expr)
        bus.subscribe(self._keys.claim("*"))
        bus.subscribe(self._keys.outcome("*", "*"))
        bus.serve(self._keys.state(HOSTILE))

    async def listen(self) -> None:
        """Note what is said, to replay it later, and answer questions, until cancelled."""
        while True:
            await self._bus.inbox.wait()
            for event in self._bus.inbox.take():
                match event:
                    case Sample(key, payload):
                        message = self._codec.decode(key, payload)
                        if message is not None:
                            self._forger.hear(message, self._clock.now_s())
                    case Query(reply=reply):
                        self.answers += 1
                        reply(self._forger.answer(HOSTILE))
                    case _:
                        pass

    async def flood_until(self, enough: Callable[[], bool], *, limit_s: float) -> float:
        """Say messages of each kind at those rates at most; how long it lasted [s]."""
        begin_s = due_s = self._clock.now_s()
        turn = 0
        while not enough():
            now_s = self._clock.now_s()
            if now_s - begin_s > limit_s:
                raise TimeoutError(f"the mission has not got on within {limit_s:g} s of flood")
            if turn % RATE_HZ == 0 and turn / RATE_HZ < GHOSTS:
                self._bus.declare_token(self._keys.alive(f"ghost{turn}"))
            for forged in self._forger.batch(now_s):
                if forged.kind is Malformation.HUGE and turn % HUGE_EVERY:
                    continue
                self._bus.publish(forged.key, forged.payload)
                self.sent[forged.kind] += 1
            turn += 1
            # What a busy machine was late for is not caught up at once: a link may drop that.
            due_s = max(due_s + 1.0 / RATE_HZ, self._clock.now_s())
            await asyncio.sleep(due_s - self._clock.now_s())
        return self._clock.now_s() - begin_s


@contextlib.asynccontextmanager
async def _hostile(run: Run, mission: Mission, rng: np.random.Generator) -> AsyncIterator[_Peer]:
    bus = await open_zenoh_bus(run.launch.layout.observer_seat(HOSTILE))
    with contextlib.closing(bus):
        peer = _Peer(bus, mission, SystemClock(), rng)
        listening = asyncio.get_running_loop().create_task(peer.listen())
        try:
            yield peer
        finally:
            listening.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await listening


class Watched:
    """What `swarm status --watch --json` tells, line by line.

    It is there before it is needed: one that is started when the flood is over may find the
    mission over, too.
    """

    def __init__(self, lines: asyncio.StreamReader) -> None:
        self._lines = lines
        self._newest: dict[str, Any] | None = None
        self._news = asyncio.Condition()
        self._ended = False

    async def read(self) -> None:
        """Take in what it tells, until it ends."""
        while line := await self._lines.readline():
            async with self._news:
                self._newest = json.loads(line)
                self._news.notify_all()
        async with self._news:
            self._ended = True
            self._news.notify_all()

    async def told(self) -> Mapping[str, Any]:
        """What it tells next, or has told last if it has ended.

        Raises:
            SwarmError: it has told nothing.
        """
        async with asyncio.timeout(LOOK_S), self._news:
            before = self._newest
            await self._news.wait_for(lambda: self._ended or self._newest is not before)
        if self._newest is None:
            raise SwarmError("swarm status has told nothing")
        return self._newest


@contextlib.asynccontextmanager
async def watched(run: Run, mission: str) -> AsyncIterator[Watched]:
    """Let `swarm status` watch the mission; it looks on already when the context begins."""
    words = ["status", "--watch", "--mission", mission, "--json"]
    words += run.launch.layout.seat_arguments(STATUS)
    process = await asyncio.create_subprocess_exec(
        sys.executable,
        *("-m", "swarm", *words),
        stdin=asyncio.subprocess.DEVNULL,
        stdout=asyncio.subprocess.PIPE,
        limit=LONGEST_LINE,
    )
    if process.stdout is None:
        raise SwarmError("swarm status has no output")
    watch = Watched(process.stdout)
    reading = asyncio.get_running_loop().create_task(watch.read())
    try:
        await watch.told()
        yield watch
    finally:
        if process.returncode is None:
            process.kill()
        await process.wait()
        await reading
