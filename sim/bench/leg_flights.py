"""Fly one mission in every way that this machine has, and judge how long legs and missions take.

A way is an autopilot, simulated or real firmware in software-in-the-loop, and how it is commanded.
Leaves out: what is judged of a flight (sim.bench.flown_legs).
"""

from __future__ import annotations

import asyncio
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from statistics import median
from typing import Any, Final

from rich.console import RenderableType

from agent.links.mavlink_vehicle import CLOCK
from agent.vehicle.config import CommandStyle
from sim.bench.command_line import launch_options
from sim.bench.flown_legs import FlownLeg, JudgedFlight, judge_flight
from sim.bench.machine import this_machine
from sim.bench.results import BenchResult, Progress, table_of, unheard
from sim.fleet.autopilots import parse_autopilots
from sim.fleet.firmware import FirmwareKind
from sim.fleet.launcher import OnLog
from sim.fleet.layout import BusKind, LaunchOptions, defaults_for
from sim.fleet.passthrough import PassthroughOptions, fence_around
from sim.fleet.run import fly
from swarm.model import Mission
from swarm.model.mission import kinds_of
from swarm.runtime.table import Column

SIMULATED: Final = ("sim", "sim-px4")
"""Autopilots that every machine has, as `swarm run` calls them."""


@dataclass(frozen=True, slots=True)
class FlightWay:
    """What flies, and how it is commanded."""

    autopilot: str
    """As `swarm run` calls it."""
    command: CommandStyle
    speedup: float

    @property
    def real(self) -> bool:
        """Whether it is real firmware."""
        return self.autopilot not in SIMULATED


def autopilots_here(environment: Mapping[str, str]) -> tuple[str, ...]:
    """What this machine can fly with: firmware only where a variable says where it is."""
    return (*SIMULATED, *(kind for kind in FirmwareKind if environment.get(kind.variable)))


def ways(
    autopilots: Iterable[str], commands: Sequence[CommandStyle], speedup: float
) -> list[FlightWay]:
    """Each autopilot commanded in each way; real firmware flies at wall speed."""
    return [
        FlightWay(each, command, speedup if each in SIMULATED else 1.0)
        for each in autopilots
        for command in commands
    ]


@dataclass(frozen=True, slots=True)
class LegFlight:
    """One flight."""

    way: FlightWay
    judged: JudgedFlight
    clock_frac: float | None
    """Seconds of the vehicles' clocks in one of the mission's, their median; None: not told."""

    @property
    def flown_by(self) -> str:
        """What flew it, for people."""
        return f"{self.way.autopilot}, {self.way.command}"

    @property
    def spread(self) -> str | None:
        """Least and greatest of flown over planned, for people."""
        times = self.judged.times
        return None if times is None else f"{times.least_frac:.2f}–{times.greatest_frac:.2f}"

    @property
    def own_legs_frac(self) -> float | None:
        """Median of flown over planned by the vehicles' own clocks."""
        legs_frac = self.judged.legs_frac
        if legs_frac is None or self.clock_frac is None:
            return None
        return legs_frac * self.clock_frac

    @property
    def done(self) -> str:
        """Tasks, for people."""
        return f"{self.judged.limits.done}/{self.judged.limits.tasks}"


@dataclass(frozen=True, slots=True)
class _LegRow:
    flown_by: str
    leg: FlownLeg


@dataclass(frozen=True, slots=True)
class LegFlights(BenchResult):
    """Everything measured in one run."""

    scenario: str
    seed: int
    flights: tuple[LegFlight, ...]
    not_here: tuple[str, ...] = ()
    """Firmware that was not flown, as nothing says where it is."""

    @property
    def kept(self) -> bool:
        """Whether every flight had legs, and kept its limits."""
        return all(each.judged.kept for each in self.flights)

    def as_json(self) -> dict[str, Any]:
        """Everything, ready for `json.dumps`."""
        flights = [
            {
                **asdict(each.way),
                "real": each.way.real,
                "clock_frac": each.clock_frac,
                **each.judged.as_json(),
            }
            for each in self.flights
        ]
        machine, head = asdict(self.machine), {"scenario": self.scenario, "seed": self.seed}
        return {"machine": machine, **head, "flights": flights, "not_here": list(self.not_here)}

    def parts(self) -> Iterable[RenderableType]:
        """See `BenchResult`."""
        limits = self.flights[0].judged.limits if self.flights else None
        yield f"{self.scenario}: flown beside planned by the kinematic model, seed {self.seed}:"
        yield table_of(
            self.flights,
            Column("flown by", words=True, key="flown_by"),
            Column("legs", ".2f", key="judged.legs_frac"),
            Column("spread", key="spread"),
            Column("own clock", ".2f", key="own_legs_frac"),
            Column("mission", ".2f", key="judged.makespan_frac"),
            Column("as listed", ".2f", key="judged.flown_lists_frac"),
            Column("done", key="done"),
            Column("zone", ".1f", "m", key="judged.limits.nearest_zone_m"),
            Column("charge", ".0f", "%", 100.0, key="judged.limits.charge_frac"),
        )
        yield (
            "legs: median of flown over planned, and its spread; own clock: the same by the "
            "vehicles' clocks, which lag where a simulator does not keep up; mission: makespan "
            "over the plan's; as listed: over the model's for the lists that were flown."
        )
        if limits is not None:
            yield (
                f"No nearer to a zone than {limits.margin_m:g} m and no charge below "
                f"{limits.reserve_frac:.0%} keeps the limits."
            )
        if self.not_here:
            variables = ", ".join(FirmwareKind(kind).variable for kind in self.not_here)
            yield f"Not flown: {', '.join(self.not_here)}; not set: {variables}."

    def leg_table(self) -> RenderableType:
        """Every leg of every flight."""
        return table_of(
            [_LegRow(each.flown_by, leg) for each in self.flights for leg in each.judged.legs],
            Column("flown by", words=True, key="flown_by"),
            Column("UAV", words=True, key="leg.uav"),
            Column("task", words=True, key="leg.task"),
            Column("length", ".0f", "m", key="leg.length_m"),
            Column("planned", ".1f", "s", key="leg.planned_s"),
            Column("flown", ".1f", "s", key="leg.flown_s"),
            Column("ratio", ".2f", key="leg.flown_frac"),
        )


def measure_legs(
    scenario: Path,
    mission: Mission,
    each_way: Sequence[FlightWay],
    environment: Mapping[str, str],
    *,
    seed: int = 0,
    acceleration_m_s2: float | None = None,
    tell: Progress = unheard,
) -> LegFlights:
    """Fly ``mission``, of that file, once in each of these ways, one after the other.

    Args:
        scenario: the file.
        mission: what it says.
        each_way: how.
        environment: says where firmware is.
        seed: of the planner.
        acceleration_m_s2: of the vehicles; None: not known.
        tell: told what is flown.

    Raises:
        InputError: the firmware of one of them is not there.
        ChildFailedError: a process did not start.
    """
    planned = [(way, _options(scenario, mission, way, environment, seed)) for way in each_way]
    flights = []
    for way, options in planned:
        tell(f"{way.autopilot}, {way.command}, {way.speedup:g} times wall speed")
        clocks: list[float] = []
        flown = asyncio.run(fly(mission, options, on_log=_clock_reader(clocks)))
        # As a program reads it that is given what `swarm run --json` prints.
        told = json.loads(json.dumps(flown.report(way.speedup).as_json()))
        source = f"{way.autopilot}, {way.command}"
        judged = judge_flight(mission, told, source, acceleration_m_s2)
        flights.append(LegFlight(way, judged, median(clocks) if clocks else None))
    flown_with = {way.autopilot for way in each_way}
    lacking = set(FirmwareKind) - set(autopilots_here(environment)) - flown_with
    not_here = tuple(kind.value for kind in FirmwareKind if kind in lacking)
    return LegFlights(this_machine(), mission.name, seed, tuple(flights), not_here)


def _clock_reader(clocks: list[float]) -> OnLog:
    """Gathers what agents log of their vehicles' clocks."""

    def on_log(_name: str, line: str) -> None:
        if CLOCK in line:
            clocks.append(float(json.loads(line)["clock_frac"]))

    return on_log


def _options(
    scenario: Path, mission: Mission, way: FlightWay, environment: Mapping[str, str], seed: int
) -> LaunchOptions:
    """As `swarm run` flies it, with nobody beside the vehicles."""
    uavs = [uav.id for uav in mission.uavs]
    autopilots = parse_autopilots(way.autopilot, uavs, None, environment, kinds_of(mission))
    options = launch_options(
        scenario,
        len(uavs),
        autopilots,
        BusKind.AUTO,
        seed=seed,
        speedup=way.speedup,
        position_rate_hz=defaults_for(autopilots, len(uavs)).position_rate_hz,
    )
    passthrough = PassthroughOptions(
        command=dict.fromkeys(uavs, way.command),
        fence=fence_around(mission),
        accept_no_failsafe=way.real,
        ready_by_itself=True,
    )
    return replace(options, passthrough=passthrough)
