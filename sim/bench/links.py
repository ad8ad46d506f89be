"""A fleet on bad links, parted in two, and the traffic of one in good health."""

from __future__ import annotations

import asyncio
import contextlib
import re
from collections import Counter
from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context

import numpy as np

from coordinator.recording.records import body_name
from sim.bench.fleets import far_mission, flying, options_for, survey_mission
from sim.bench.results import Progress, unheard
from sim.fleet.faults.recorder import BusEntry
from sim.fleet.faults.relay import RelayNetwork, RelayQuality
from sim.fleet.faults.tun import HERE, THERE, TunPath, TunUnavailableError, enter_own_network
from sim.fleet.launcher import Through
from sim.fleet.layout import BusKind, DialedLink
from sim.fleet.run import open_run
from swarm.protocol.messages import Message, MissionPhase
from swarm.protocol.timing import LinkKind
from swarm.protocol.uav_messages import ClaimPhase
from swarm.runtime.clock import SystemClock
from swarm.runtime.log import LogLevel, configure_logging

START_S = 150.0
"""Until the whole fleet flies, on whatever links [wall s]."""
END_S = 400.0
_LOST = re.compile(r"event=lost\b")


@dataclass(frozen=True, slots=True)
class BadLink:
    """A kind of bad link, and the preset that is meant for it."""

    quality: RelayQuality
    link: LinkKind


BAD_LINKS = (
    BadLink(RelayQuality(delay_s=0.03, loss_frac=0.05), LinkKind.NORMAL),
    BadLink(RelayQuality(delay_s=0.05, loss_frac=0.10), LinkKind.BAD),
    BadLink(RelayQuality(delay_s=0.10, loss_frac=0.20), LinkKind.BAD),
)


@dataclass(frozen=True, slots=True)
class FalseLosses:
    """A fleet of which nobody was lost, watched on bad links."""

    bad: BadLink
    uavs: int
    watched_s: float
    path: str
    """How links were made bad: ``tun``, real packets lost, or ``relay``, an imitation."""
    losses: int
    """How often some process took another for lost."""
    packets: int
    """Packets carried and lost on the way, of a TUN path; 0 with relays."""
    dropped: int


@dataclass(frozen=True, slots=True)
class PartitionResult:
    """One fleet parted in two for a while."""

    uavs: int
    tasks: int
    parted_s: float
    duplicates: int
    """Visits to tasks that had been done."""
    agreement_s: float
    """From the healing until no task was claimed by two [s]."""
    done: int
    faults: tuple[str, ...]
    """Invariants that did not hold, in words."""


@dataclass(frozen=True, slots=True)
class Traffic:
    """What a fleet says, as heard on the bus."""

    uavs: int
    watched_s: float
    messages: Mapping[str, int]
    """By kind."""
    payload_bytes: Mapping[str, int]
    """By kind; without what Zenoh and TCP add."""

    @property
    def messages_per_uav_s(self) -> float:
        """Messages said per UAV and second, all processes together."""
        return sum(self.messages.values()) / self.uavs / self.watched_s

    @property
    def status_per_uav_s(self) -> float:
        """Those of them that are statuses."""
        return self.messages.get("Status", 0) / self.uavs / self.watched_s

    @property
    def bytes_per_uav_s(self) -> float:
        """Payload said per UAV and second, all processes together [bytes/s]."""
        return sum(self.payload_bytes.values()) / self.uavs / self.watched_s

    @property
    def received_bytes_per_uav_s(self) -> float:
        """Payload that each agent hears: everything but status and choices [bytes/s]."""
        unheard = ("Status", "Choice")
        heard = sum(size for kind, size in self.payload_bytes.items() if kind not in unheard)
        return heard / self.watched_s


# -- bad links --------------------------------------------------------------------------


def measure_false_losses(
    bad: BadLink, watch_s: float, *, uavs: int = 5, seed: int = 0, relay: bool = False
) -> FalseLosses:
    """Fly on bad links for a while, and count who was taken for lost.

    Every agent and the coordinator is linked to one router by a bad link of its own, so what
    one says to another passes two. Where the system lets us, real packets are lost, unless
    losses are to be imitated by a ``relay``. The watch begins once all fly [wall s].
    """
    if not relay:
        # A network namespace is entered by a process, and not left again.
        with ProcessPoolExecutor(1, get_context("spawn")) as own_process:
            found = own_process.submit(_in_own_network, bad, watch_s, uavs, seed).result()
        if found is not None:
            return found
    return asyncio.run(_watch_relayed(bad, watch_s, uavs, seed))


def _in_own_network(bad: BadLink, watch_s: float, uavs: int, seed: int) -> FalseLosses | None:
    configure_logging(LogLevel.ERROR)
    try:
        enter_own_network()
        return asyncio.run(_watch_on_tun(bad, watch_s, uavs, seed))
    except TunUnavailableError:
        return None


async def _watch_on_tun(bad: BadLink, watch_s: float, uavs: int, seed: int) -> FalseLosses:
    async def through(_link: DialedLink, endpoint: str) -> str:
        return endpoint.replace(HERE, THERE)

    with TunPath(bad.quality, np.random.default_rng(seed)) as path:
        losses = await _watch(bad, watch_s, uavs, through, HERE)
        return FalseLosses(bad, uavs, watch_s, "tun", losses, path.carried + path.lost, path.lost)


async def _watch_relayed(bad: BadLink, watch_s: float, uavs: int, seed: int) -> FalseLosses:
    async with RelayNetwork(seed=seed) as network:
        network.degrade(bad.quality)
        losses = await _watch(bad, watch_s, uavs, network.through)
    return FalseLosses(bad, uavs, watch_s, "relay", losses, 0, 0)


async def _watch(
    bad: BadLink, watch_s: float, uavs: int, through: Through, address: str = "127.0.0.1"
) -> int:
    """Fly until all hold their tasks, and count losses from then on."""
    mission = far_mission(uavs, uavs)
    lines: list[str] = []
    with options_for(mission, link=bad.link, bus=BusKind.ROUTER, address=address) as options:
        async with open_run(
            mission, options, through=through, on_log=lambda _, line: lines.append(line)
        ) as run:
            replica = run.mission_state.replica

            def all_hold() -> bool:
                held = [each.phase is ClaimPhase.HELD for each in replica.claims.values()]
                return sum(held) == uavs

            await run.until(all_hold, limit_s=START_S, what="everyone on the way")
            before = len(lines)
            await asyncio.sleep(watch_s)
            return sum(bool(_LOST.search(line)) for line in lines[before:])


# -- partitions -------------------------------------------------------------------------


async def measure_partition(
    parted_s: float,
    *,
    uavs: int = 10,
    tasks: int = 120,
    seed: int = 0,
    tell: Progress = unheard,
) -> PartitionResult:
    """Part a mesh of agents in two halves for a while, and let it finish.

    Raises:
        TimeoutError: the mission did not get on.
    """
    mission = survey_mission(uavs, tasks, seed)
    far = {uav.id for number, uav in enumerate(mission.uavs) if number % 2}
    async with flying(
        mission, link=LinkKind.NORMAL, bus=BusKind.MESH, relayed=True, method="guided", seed=seed
    ) as flight:
        await flight.until(lambda: flight.done >= uavs // 2, "the first tasks done", START_S)
        tell(f"parted for {parted_s:g} s")
        flight.isolate(far)
        await asyncio.sleep(parted_s)
        flight.heal()
        tell("healed")
        async with asyncio.timeout(END_S):
            await flight.run.finish()
    verdict = flight.verdict()
    return PartitionResult(
        uavs=uavs,
        tasks=tasks,
        parted_s=parted_s,
        duplicates=verdict.flight.result.duplicate_visits,
        agreement_s=verdict.agreement_s,
        done=len(verdict.flight.result.done),
        faults=verdict.faults,
    )


# -- traffic ----------------------------------------------------------------------------


async def measure_traffic(uavs: int, watch_s: float, *, seed: int = 0) -> Traffic:
    """Count what a fleet says while it surveys, all processes healthy.

    Raises:
        TimeoutError: the mission did not begin.
    """
    mission = survey_mission(uavs, 6 * uavs, seed)
    clock = SystemClock()
    async with flying(mission, link=LinkKind.NORMAL, bus=BusKind.ROUTER) as flight:
        mission_state = flight.run.mission_state
        await flight.until(
            lambda: mission_state.phase is MissionPhase.RUNNING, "the start", START_S
        )
        begin, begin_s = len(flight.recorder.entries), clock.now_s()
        with contextlib.suppress(TimeoutError):  # a mission still running is as it should be
            await flight.until(
                lambda: mission_state.phase is not MissionPhase.RUNNING, "the end", watch_s
            )
        return _traffic(flight.recorder.entries[begin:], uavs, clock.now_s() - begin_s)


def _traffic(entries: list[BusEntry], uavs: int, watched_s: float) -> Traffic:
    messages: Counter[str] = Counter()
    sizes: Counter[str] = Counter()
    for entry in entries:
        if isinstance(entry.what, Message):
            kind = body_name(entry.what.body)
            messages[kind] += 1
            sizes[kind] += entry.size_bytes
    return Traffic(uavs, watched_s, dict(messages), dict(sizes))
