"""How long until another UAV holds the task of one that was killed, hangs or is cut off.

Three UAVs, two tasks so far away that none is ever reached: two fly, one is idle. Whoever flies is
struck; the idle one takes over, the struck one comes back, and one of them is idle again. Times are
taken by a recorder that hears the bus directly.
"""

from __future__ import annotations

import asyncio
import contextlib
import math
import os
import signal
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

import numpy as np

from sim.bench.fleets import far_mission, flying
from sim.bench.results import Progress, quantile, unheard
from sim.fleet.faults.flight import ChaosFlight
from sim.fleet.layout import BusKind
from swarm.model import Mission
from swarm.protocol.messages import Message
from swarm.protocol.timing import LinkKind
from swarm.protocol.uav_messages import Claim, ClaimPhase
from swarm.runtime.clock import SystemClock

START_S = 90.0
"""Until the whole fleet flies [wall s]."""
SETTLE_S = 60.0
"""Until one is idle again after a blow [wall s]."""
MISSED_S = 40.0
"""A task that nobody holds by then counts as missed [wall s]."""
CALM_S = 1.0
"""Least time between two blows in which nothing changes; up to twice that, at random [wall s]."""
LOOK_S = 0.02

_STUCK = """
import signal, time

stuck = False

def hang(*_):
    global stuck
    stuck = True
    while stuck:
        time.sleep(0.01)

def go_on(*_):
    global stuck
    stuck = False

signal.signal(signal.SIGUSR1, hang)
signal.signal(signal.SIGUSR2, go_on)
"""
"""Blocks a Python program between two of its steps while its other threads, and so its
connections, live on: what a deadlock or an endless loop does."""


class FailureMode(StrEnum):
    """What happens to an agent."""

    KILL = "kill"
    """SIGKILL; started again afterwards."""
    HANG = "hang"
    """SIGSTOP; nothing of it runs, its connections stay open."""
    CUT = "cut"
    """Its link swallows everything; nobody is told."""
    DEADLOCK = "deadlock"
    """Its program stands still, its connections live."""


@dataclass(frozen=True, slots=True)
class Takeovers:
    """Times of one kind of blow."""

    blow: FailureMode
    link: LinkKind
    bus: BusKind
    times_s: tuple[float, ...]
    """From each blow to another's held claim on the task, as heard on the bus [s]."""
    missed: int
    """Blows after which nobody held the task in time."""

    def quantile_s(self, share: float) -> float | None:
        """The smallest time that is not exceeded in that share of all trials, missed included."""
        return quantile([*self.times_s, *[math.inf] * self.missed], share)


async def measure_takeovers(
    blow: FailureMode,
    trials: int,
    *,
    link: LinkKind = LinkKind.NORMAL,
    bus: BusKind = BusKind.ROUTER,
    seed: int = 0,
    tell: Progress = unheard,
) -> Takeovers:
    """Strike ``trials`` times, and wait each time until another UAV holds the task.

    The seed says who is struck, and when.

    Raises:
        ChildFailedError: a process did not start.
        TimeoutError: the fleet was not complete again in time after a blow.
    """
    rng, clock = np.random.default_rng(seed), SystemClock()
    times_s: list[float] = []
    missed = 0
    mission = far_mission(n_uav=3, n_task=2)
    with stuck_on_demand() if blow is FailureMode.DEADLOCK else contextlib.nullcontext():
        async with flying(mission, link=link, bus=bus, relayed=blow is FailureMode.CUT) as flight:
            for trial in range(trials):
                tell(f"{blow}: {trial} of {trials}")
                busy = await _calm(flight, mission, CALM_S * (1.0 + rng.random()))
                victim, task = sorted(busy.items())[int(rng.integers(len(busy)))]
                begin = len(flight.recorder.entries)
                struck_s = clock.now_s()
                await _strike(flight, blow, victim)
                held_s = await _held_by_another(flight, begin, victim, task)
                if held_s is None:
                    missed += 1
                else:
                    times_s.append(held_s - struck_s)
                await _revive(flight, blow, victim)
    return Takeovers(blow, link, bus, tuple(times_s), missed)


async def _calm(flight: ChaosFlight, mission: Mission, calm_s: float) -> dict[str, str]:
    """Wait until all are there, two hold tasks and the third is idle, for ``calm_s``.

    Returns:
        Task by UAV that holds it.
    """
    mission_state, clock = flight.run.mission_state, SystemClock()
    fleet = {uav.id for uav in mission.uavs}
    limit_s = SETTLE_S if mission_state.replica.claims else START_S
    begin_s = since_s = clock.now_s()
    before: dict[str, str] = {}
    while True:
        claims = mission_state.replica.claims
        held = {u: c.task for u, c in claims.items() if c.task and c.phase is ClaimPhase.HELD}
        idle = {uav for uav, claim in claims.items() if claim.phase is ClaimPhase.IDLE}
        complete = fleet <= mission_state.present and len(held) == 2 and len(idle) == 1
        now_s = clock.now_s()
        if not complete or held != before or len(set(held.values())) < 2:
            since_s, before = now_s, held
        elif now_s - since_s >= calm_s:
            return held
        if now_s - begin_s > limit_s:
            story = "; ".join(each.text for each in mission_state.story[-5:])
            raise TimeoutError(f"the fleet was not complete within {limit_s:g} s: {story}")
        await asyncio.sleep(LOOK_S)


async def _held_by_another(flight: ChaosFlight, begin: int, victim: str, task: str) -> float | None:
    """When another UAV first said that it holds ``task``; None if nobody has in time."""
    entries, clock = flight.recorder.entries, SystemClock()
    limit_s = clock.now_s() + MISSED_S
    while clock.now_s() < limit_s:
        for entry in entries[begin:]:
            match entry.what:
                case Message(writer=uav, body=Claim(phase=ClaimPhase.HELD, task=held)):
                    if uav != victim and held == task:
                        return entry.at_s
        await asyncio.sleep(LOOK_S)
    return None


async def _strike(flight: ChaosFlight, blow: FailureMode, victim: str) -> None:
    match blow:
        case FailureMode.KILL:
            await flight.kill(victim)
        case FailureMode.HANG:
            flight.pause(victim)
        case FailureMode.CUT:
            flight.isolate({victim})
        case FailureMode.DEADLOCK:
            os.kill(flight.run.launch.child(victim).pid, signal.SIGUSR1)


async def _revive(flight: ChaosFlight, blow: FailureMode, victim: str) -> None:
    match blow:
        case FailureMode.KILL:
            await flight.restart(victim)
        case FailureMode.HANG:
            flight.resume(victim)
        case FailureMode.CUT:
            flight.heal()
        case FailureMode.DEADLOCK:
            os.kill(flight.run.launch.child(victim).pid, signal.SIGUSR2)


@contextlib.contextmanager
def stuck_on_demand() -> Iterator[None]:
    """Let Python programs started meanwhile stand still on SIGUSR1, until SIGUSR2."""
    before = os.environ.get("PYTHONPATH")
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "sitecustomize.py").write_text(_STUCK, encoding="utf-8")
        os.environ["PYTHONPATH"] = folder if before is None else f"{folder}{os.pathsep}{before}"
        try:
            yield
        finally:
            if before is None:
                del os.environ["PYTHONPATH"]
            else:
                os.environ["PYTHONPATH"] = before
