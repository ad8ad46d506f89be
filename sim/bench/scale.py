"""`swarm bench scale`: what each UAV more costs a machine, in fleets of real processes.

The same kind of survey is flown by fleets of several sizes, one after the other, at wall speed and
with the same rate of position reports, each watched for a while in the middle of its mission and
ended. What processes use is read from the kernel: processor time, and memory as the proportional
share of pages, since a fleet's processes share what they have imported. What is said is counted by
an observer on the bus. Decisions are timed by the agents, to the next target, where that waits for
no way, and by that observer, to the next claim. Linux alone tells all of it.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
from collections import Counter
from collections.abc import AsyncIterator, Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

from rich.console import RenderableType

from coordinator.mission_view.mission_state import MissionState
from coordinator.recording.recorder import RecordedCore
from coordinator.recording.records import RecordableFact
from sim.bench.claim_delays import ClaimDelays
from sim.bench.fleets import BAND_M, SPACING_M, options_for, survey_mission
from sim.bench.machine import cpu_s, share_bytes, this_machine
from sim.bench.results import BenchResult, Progress, quantile, unheard
from sim.bench.turnaround import told_turnarounds
from sim.fleet.child_process import ChildProcess
from sim.fleet.layout import BusKind
from sim.fleet.run import Run, open_run
from swarm.bus.port import Inbox
from swarm.bus.zenoh_bus import open_zenoh_bus
from swarm.model.ids import COORDINATOR
from swarm.protocol.encoding import NAMES
from swarm.protocol.events import CommonAction, CommonEvent, MessageReceived
from swarm.protocol.key_space import KeySpace
from swarm.protocol.messages import MissionPhase, Stamp
from swarm.protocol.timing import LinkKind
from swarm.protocol.uav_messages import Choice, Claim, Outcome, Status
from swarm.runtime.clock import SystemClock
from swarm.runtime.log import LogFormat
from swarm.runtime.shell import Core
from swarm.runtime.table import Column, ResultTable

POSITION_RATE_HZ = 5.0
"""Of every vehicle's reports, in every fleet."""
AGENTS, AUTOPILOTS, ROUTERS, LAUNCHER = "agents", "autopilots", "routers", "launcher"
START_TARGET_S, SHARE_TARGET_BYTES, LATENCY_TARGET_MS = 60.0, 40e6, 100.0


@dataclass(frozen=True, slots=True)
class ScaleSettings:
    """What is flown, and how long it is watched."""

    sizes: tuple[int, ...] = (10, 50, 100, 200)
    """UAVs of each fleet."""
    tasks_per_uav: int = 6
    spacing_m: float = SPACING_M
    """There is one task on each square of that side, on average [m]."""
    watch_s: float = 30.0
    """Wall time of a mission over which is counted."""
    start_limit_s: float = 300.0
    """Wall time after which a fleet that is not in the air is given up."""
    method: str = "greedy"
    link: LinkKind = LinkKind.NORMAL
    routers: int = 1
    agents_per_process: int = 1
    separation_m: float | None = None
    """What the fleet keeps apart, in layers that it shares [m]; None: each has its own layer."""
    seed: int = 0

    @property
    def density_per_km2(self) -> float:
        """UAVs on each square kilometre of the survey, in every fleet."""
        return 1e6 / (self.tasks_per_uav * self.spacing_m**2)


@dataclass(frozen=True, slots=True)
class ScaleRun:
    """One fleet."""

    uavs: int
    tasks: int
    up_s: float | None
    """Wall time from the first process until every agent has told its status; None: never."""
    airborne_s: float | None
    """Until the mission ran, with every vehicle at its start in the air."""
    watched_s: float
    cpu_frac: Mapping[str, float]
    """By kind of process, processors in use while it was watched."""
    agent_share_bytes: tuple[int, ...]
    """Proportional share of memory of every agent; its part of that of its process."""
    published_hz: Mapping[str, float]
    """By kind, messages of each UAV."""
    received_hz: Mapping[str, float]
    """By kind, messages that each agent hears."""
    latency_ms: tuple[float, ...]
    """From each arrival, or end of service, until the next target was sent; of UAVs that keep apart
    nobody times it."""
    told_ms: tuple[float, ...]
    """From each end of service until what the UAV claims next has come to an observer's process."""
    lost: int
    """UAVs that the observer took for lost, though no process had ended."""
    ended: int
    """Agents that ended before they were told to."""
    load: float
    """Processes that wanted to run during the last minute of it."""
    nearest_m: float | None = None
    """The nearest that two in flight came to each other until then; None: never two were."""
    nearest_error_m: float | None = None
    """How far that may be off: large fleets tell where they are every second or less often."""
    new_claims_hz: float = 0.0
    """Claims of each UAV that say anything new."""

    @property
    def agent_cpu_frac(self) -> float:
        """Of each agent, a share of one processor."""
        return self.cpu_frac[AGENTS] / self.uavs

    @property
    def agent_share_mean_bytes(self) -> float:
        """Mean of all agents."""
        return sum(self.agent_share_bytes) / max(1, len(self.agent_share_bytes))

    @property
    def said_hz(self) -> float:
        """All that a UAV publishes."""
        return sum(self.published_hz.values())

    @property
    def heard_hz(self) -> float:
        """All that an agent hears but answers."""
        return sum(self.received_hz.values())

    @property
    def claims_per_decision(self) -> float | None:
        """Claims that UAVs published for each of their decisions, repetitions included.

        None: nobody decided while it was watched.
        """
        return self._for_each_decision(self.published_hz.get(NAMES[Claim], 0.0))

    @property
    def new_claims_per_decision(self) -> float | None:
        """Those of them that said anything new."""
        return self._for_each_decision(self.new_claims_hz)

    def _for_each_decision(self, hz: float) -> float | None:
        decisions_hz = self.published_hz.get(NAMES[Choice], 0.0)
        return hz / decisions_hz if decisions_hz else None

    @property
    def besides_hz(self) -> float:
        """What an agent hears but claims and outcomes, which follow decisions."""
        of_decisions = (NAMES[Claim], NAMES[Outcome])
        return sum(hz for kind, hz in self.received_hz.items() if kind not in of_decisions)

    def latency_quantile_ms(self, share: float) -> float | None:
        """The smallest time that is not exceeded in that share of all decisions."""
        return quantile(self.latency_ms, share)

    def as_json(self) -> dict[str, Any]:
        """Everything, with what follows from it."""
        derived = (
            *("agent_cpu_frac", "agent_share_mean_bytes", "said_hz", "heard_hz"),
            *("besides_hz", "claims_per_decision", "new_claims_per_decision"),
        )
        return {
            **asdict(self),
            **{name: getattr(self, name) for name in derived},
            "latency_p50_ms": self.latency_quantile_ms(0.5),
            "latency_p99_ms": self.latency_quantile_ms(0.99),
            "told_p50_ms": quantile(self.told_ms, 0.5),
            "told_p99_ms": quantile(self.told_ms, 0.99),
        }


@dataclass(frozen=True, slots=True)
class ScaleBench(BenchResult):
    """Fleets of several sizes, the first the measure of the others."""

    settings: ScaleSettings
    runs: tuple[ScaleRun, ...]

    def as_json(self) -> dict[str, Any]:
        """Everything, ready for `json.dumps`."""
        return {
            "machine": asdict(self.machine),
            "settings": asdict(self.settings),
            "runs": [run.as_json() for run in self.runs],
        }

    def tables(self) -> Iterator[ResultTable]:
        """What people read, also in a document."""
        yield ResultTable(
            (
                Column("UAVs", key="uavs"),
                Column("up", ".1f", "s", none="never"),
                Column("airborne", ".1f", "s", none="never"),
                Column("memory per agent", ".1f", "MB", 1e-6),
                Column("most", ".1f", "MB", 1e-6),
                Column("agent's CPU", ".2f", "%", 100.0),
                Column("all CPU", ".0f", "%", 100.0),
                Column("nearest", ".1f", "m", none="-"),
                Column("±", ".1f", "m", none="-"),
                Column("lost"),
                Column("load", ".1f"),
            ),
            [
                (
                    run.uavs,
                    run.up_s,
                    run.airborne_s,
                    run.agent_share_mean_bytes,
                    max(run.agent_share_bytes, default=0),
                    run.agent_cpu_frac,
                    sum(run.cpu_frac.values()),
                    run.nearest_m,
                    run.nearest_error_m,
                    run.lost + run.ended,
                    run.load,
                )
                for run in self.runs
            ],
            "What fleets take",
        )
        yield self._decisions()
        yield self._messages("Published by each UAV [1/s]", [run.published_hz for run in self.runs])
        yield self._messages("Heard by each agent [1/s]", [run.received_hz for run in self.runs])

    def _decisions(self) -> ResultTable:
        columns = (
            *(Column("UAVs", key="uavs"), Column("decisions")),
            *(Column("p50", ".1f", "ms"), Column("p99", ".1f", "ms")),
            *(Column("told p50", ".1f", "ms"), Column("told p99", ".1f", "ms")),
            Column("claims each", ".1f", none="-"),
            Column("new", ".1f", none="-"),
            Column("heard besides", ".1f", "/s"),
        )
        rows = [
            (
                *(run.uavs, max(len(run.latency_ms), len(run.told_ms))),
                *(run.latency_quantile_ms(share) for share in (0.5, 0.99)),
                *(quantile(run.told_ms, share) for share in (0.5, 0.99)),
                *(run.claims_per_decision, run.new_claims_per_decision, run.besides_hz),
            )
            for run in self.runs
        ]
        title = "Decisions: from the end of a service to the next target, and until they are told"
        return ResultTable(columns, rows, title)

    def _messages(self, title: str, of: Sequence[Mapping[str, float]]) -> ResultTable:
        """By kind, side by side, and the sum over that of the first fleet."""
        kinds = sorted({kind for each in of for kind in each})
        sums = [sum(each.values()) for each in of]
        rows = [
            (run.uavs, *(each.get(kind, 0.0) for kind in kinds), total, total / sums[0])
            for run, each, total in zip(self.runs, of, sums, strict=True)
            if sums[0] > 0.0
        ]
        columns = [Column("UAVs"), *(Column(kind, ".2f") for kind in kinds)]
        return ResultTable((*columns, Column("all", ".2f"), Column("ratio", ".2f")), rows, title)

    def parts(self) -> Iterable[RenderableType]:
        """See `BenchResult`."""
        settings = self.settings
        yield (
            f"survey of {settings.tasks_per_uav} tasks for each UAV, "
            f"{settings.spacing_m:g} m apart ({settings.density_per_km2:.3g} UAVs/km²), "
            f"{settings.method}, "
            f"{settings.routers} router(s), {settings.agents_per_process} agent(s) in a process, "
            f"{POSITION_RATE_HZ:g} position reports a second, "
            f"{self._apart()}, watched for {settings.watch_s:g} s; seed {settings.seed}"
        )
        for table in self.tables():
            yield from ("", table)
        yield ""
        yield (
            f"wanted: up within {START_TARGET_S:g} s, {SHARE_TARGET_BYTES / 1e6:g} MB an agent, "
            f"p99 below {LATENCY_TARGET_MS:g} ms, ratios of what is published 1"
        )

    def _apart(self) -> str:
        if (separation_m := self.settings.separation_m) is None:
            return "a layer for each"
        return f"{separation_m:g} m apart within {BAND_M[0]:g} to {BAND_M[1]:g} m"

    def as_markdown(self) -> str:
        """For a document."""
        return "\n\n".join([str(self.machine), *(t.as_markdown() for t in self.tables())]) + "\n"


class MessageCount:
    """Counts what the observer of a run hears; see `sim.fleet.run.RunRecorder`."""

    def __init__(self) -> None:
        self.heard: Counter[tuple[bool, str]] = Counter()
        """By whether a UAV has said so, and by kind."""
        self.new_claims = 0
        """Claims that tell all of anything new: not repetitions, nor what was granted, which those
        whom it concerns have been told before."""
        self._claimed: dict[str, tuple[Stamp, Claim]] = {}
        """By UAV, the newest of its claims, but for grants."""
        self.there: set[str] = set()
        """UAVs that have told their status."""
        self.latency_ms: list[float] = []
        self.claim_delays = ClaimDelays()
        self._mission_state: MissionState | None = None

    def around(
        self, core: Core[CommonEvent, CommonAction], mission_state: MissionState
    ) -> Core[CommonEvent, CommonAction]:
        """``core``, with what it hears counted."""
        self._mission_state = mission_state
        return RecordedCore(core, self, mission_state)

    def note(self, what: RecordableFact, now_s: float) -> None:
        """Count it, if it is a message."""
        if isinstance(what, MessageReceived):
            said, state = what.message, self._mission_state
            came_s = now_s if what.arrived_s is None else what.arrived_s  # it is looked at later
            self.claim_delays.hear(said, None if state is None else state.mission_s(came_s))
            self.heard[said.writer != COORDINATOR, NAMES[type(said.body)]] += 1
            if isinstance(said.body, Status):
                self.there.add(said.writer)
            elif isinstance(said.body, Claim):
                self._hear_claim(said.writer, said.stamp, said.body)

    def _hear_claim(self, uav: str, stamp: Stamp, claim: Claim) -> None:
        if claim.way is not None:
            claim = replace(claim, way=replace(claim.way, grants={}))
        before = self._claimed.get(uav)
        if before is None or before[0] < stamp:
            self.new_claims += before is None or before[1] != claim
            self._claimed[uav] = stamp, claim

    def log(self, name: str, line: str, now_s: float) -> None:
        """Take from a line of a log what it tells of decisions."""
        del name, now_s
        for told in told_turnarounds(line):
            self.latency_ms += told["target_ms"]


def measure_scale(settings: ScaleSettings, tell: Progress = unheard) -> ScaleBench:
    """Fly all fleets, one after the other.

    Raises:
        ChildFailedError: a process did not start.
    """
    machine = this_machine()
    runs = [asyncio.run(_fly(n_uav, settings, tell)) for n_uav in settings.sizes]
    return ScaleBench(machine, settings, tuple(runs))


async def _fly(n_uav: int, settings: ScaleSettings, tell: Progress) -> ScaleRun:
    mission = survey_mission(
        n_uav,
        settings.tasks_per_uav * n_uav,
        settings.seed,
        separation_m=settings.separation_m,
        spacing_m=settings.spacing_m,
    )
    count, clock = MessageCount(), SystemClock()
    tell(f"{n_uav} UAVs: starting")
    begun_s = clock.now_s()
    with options_for(
        mission, link=settings.link, bus=BusKind.ROUTER, method=settings.method
    ) as usual:
        options = replace(
            usual,
            routers=settings.routers,
            agents_per_process=settings.agents_per_process,
            position_rate_hz=POSITION_RATE_HZ,
            log_format=LogFormat.JSON,
            start_timeout_s=settings.start_limit_s,
        )
        async with open_run(mission, options, recorder=count) as run, _addressed(run) as to_some:
            left_s = settings.start_limit_s - (clock.now_s() - begun_s)
            up = await _happens(run, lambda: len(count.there) == n_uav, left_s, "all agents")
            up_s = clock.now_s() - begun_s if up else None
            tell(f"{n_uav} UAVs: taking off")
            state, left_s = run.mission_state, settings.start_limit_s - (clock.now_s() - begun_s)
            runs = await _happens(
                run, lambda: state.phase is MissionPhase.RUNNING, left_s, "the start"
            )
            airborne_s = clock.now_s() - begun_s if runs else None
            tell(f"{n_uav} UAVs: flying")
            heard, new, used = count.heard.copy(), count.new_claims, _used_s(run)
            to_some.take()
            at_s = clock.now_s()
            await asyncio.sleep(settings.watch_s)  # what one does that never takes off is told, too
            watched_s = clock.now_s() - at_s
            said, new_claims = count.heard - heard, count.new_claims - new
            said[True, TO_SOME] = len(to_some.take())
            shares = tuple(
                share_bytes(child.pid) // agents
                for child in _living(run)
                for agents in (_agents_in(child),)
                for _ in range(agents)
            )
            cpu_frac = {
                kind: (seconds - used[kind]) / watched_s for kind, seconds in _used_s(run).items()
            }
            lost, ended, near = len(state.lost), n_uav - len(shares), state.nearest
    return ScaleRun(
        uavs=n_uav,
        tasks=len(mission.tasks),
        up_s=up_s,
        airborne_s=airborne_s,
        watched_s=watched_s,
        cpu_frac=cpu_frac,
        agent_share_bytes=shares,
        published_hz=published_hz(said, n_uav, watched_s),
        received_hz=received_hz(said, n_uav, watched_s),
        latency_ms=tuple(count.latency_ms),
        told_ms=tuple(count.claim_delays.told_ms),
        lost=lost,
        ended=ended,
        load=os.getloadavg()[0],
        nearest_m=None if near is None else near.distance_m,
        nearest_error_m=None if near is None else near.error_m,
        new_claims_hz=new_claims / n_uav / watched_s,
    )


def published_hz(
    said: Mapping[tuple[bool, str], int], n_uav: int, watched_s: float
) -> dict[str, float]:
    """By kind, messages of each UAV a second."""
    return {kind: n / n_uav / watched_s for (by_uav, kind), n in said.items() if by_uav}


def received_hz(
    said: Mapping[tuple[bool, str], int], n_uav: int, watched_s: float
) -> dict[str, float]:
    """By kind, messages that an agent hears a second: of all others, but not for onlookers."""
    return {
        kind: n * (1.0 / n_uav if kind == TO_SOME else 1.0 - by_uav / n_uav) / watched_s
        for (by_uav, kind), n in said.items()
        if kind not in _FOR_ONLOOKERS
    }


TO_SOME = "claim to some"
"""Claims that are said to one UAV alone, each of which is one message."""
_FOR_ONLOOKERS = frozenset({NAMES[Status], NAMES[Choice]})


@contextlib.asynccontextmanager
async def _addressed(run: Run) -> AsyncIterator[Inbox]:
    """Where all arrives that UAVs claim and say to one of them alone."""
    bus = await open_zenoh_bus(run.launch.layout.observer_seat(), inbox_capacity=1 << 18)
    try:
        bus.subscribe(KeySpace(run.launch.mission.name).claim_to("*", "*"))
        yield bus.inbox
    finally:
        bus.close()


async def _happens(run: Run, condition: Callable[[], bool], limit_s: float, what: str) -> bool:
    """Whether it does within that time."""
    try:
        await run.until(condition, limit_s=max(0.0, limit_s), what=what)
    except TimeoutError:
        return False
    return True


def _living(run: Run) -> list[ChildProcess]:
    return [child for child in run.launch.lives if child.returncode is None]


def _agents_in(child: ChildProcess) -> int:
    return child.arguments.count("--uav") if child.arguments[0] == "agent" else 0


def _used_s(run: Run) -> dict[str, float]:
    """By kind, processor time that the living processes of a run have used so far [s]."""
    kinds = {"agent": AGENTS, "autopilot": AUTOPILOTS, "router": ROUTERS, COORDINATOR: COORDINATOR}
    used = dict.fromkeys(kinds.values(), 0.0)
    for child in _living(run):
        used[kinds[child.arguments[0]]] += cpu_s(child.pid)
    return {**used, LAUNCHER: cpu_s(os.getpid())}
