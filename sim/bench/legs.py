"""How much longer vehicles take from task to task than straight line ÷ cruise speed.

Holds the command `swarm bench legs`, too.
"""

from __future__ import annotations

import json
import math
import statistics
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import typer

from swarm.model import Mission
from swarm.runtime.errors import Fault, InputError
from swarm.runtime.options import JsonOption
from swarm.scenario.files import resolve_scenario

_REMEDY = "name what swarm run SCENARIO --json printed of a flight of that scenario"


@dataclass(frozen=True, slots=True)
class FlownLeg:
    """One leg, from rest to rest."""

    uav: str
    task: str
    length_m: float
    speed_m_s: float
    """Cruise speed that the UAV was told."""
    flown_s: float

    @property
    def excess_s(self) -> float:
        """Beyond length ÷ speed."""
        return self.flown_s - self.length_m / self.speed_m_s


@dataclass(frozen=True, slots=True)
class LegTimes:
    """What legs took beyond length ÷ speed [s]."""

    legs: int
    median_s: float
    least_s: float
    greatest_s: float
    beyond_ramps_s: float | None
    """Median of what they took beyond length ÷ speed + speed ÷ acceleration; None where no
    acceleration is known."""


def load_run(path: Path) -> Mapping[str, Any]:
    """What `swarm run --json` printed.

    Raises:
        InputError: it cannot be read, or is something else.
    """
    try:
        told = json.loads(path.read_text(encoding="utf-8"))
    except OSError as fault:
        raise InputError(Fault(str(path), "", fault.strerror or str(fault), _REMEDY)) from fault
    except ValueError as fault:
        raise InputError(Fault(str(path), "", "it is not JSON", _REMEDY)) from fault
    keys = ("scenario", "executed_routes", "executed_completion_s")
    lacks = [key for key in keys if not isinstance(told, dict) or key not in told]
    if lacks:
        raise InputError(Fault(str(path), lacks[0], "is missing", _REMEDY))
    found: Mapping[str, Any] = told
    return found


def legs_flown(mission: Mission, run: Mapping[str, Any], source: str) -> list[FlownLeg]:
    """The legs of one flight, of which `swarm run --json` said ``run``; ``source`` is for people.

    Raises:
        InputError: it flew another scenario.
    """
    uavs = {uav.id: uav for uav in mission.uavs}
    tasks = {task.id: task for task in mission.tasks}
    ended_s = run["executed_completion_s"]
    legs = []
    for name, route in run["executed_routes"].items():
        strangers = [] if name in uavs else [name]
        strangers += [task for task in route if task not in tasks]
        if strangers:
            problem = f"{strangers[0]!r} is not in the scenario {mission.name}"
            raise InputError(Fault(source, "executed_routes", problem, _REMEDY))
        uav, at_s = uavs[name], 0.0
        place_enu_m = uav.position_enu_m
        for task in (tasks[each] for each in route if each in ended_s):
            length_m = math.dist(place_enu_m, task.position_enu_m)
            flown_s = ended_s[task.id] - task.service_s - at_s
            legs.append(FlownLeg(name, task.id, length_m, uav.speed_m_s, flown_s))
            place_enu_m, at_s = task.position_enu_m, ended_s[task.id]
    return legs


def leg_times(legs: Sequence[FlownLeg], acceleration_m_s2: float | None) -> LegTimes | None:
    """Median and spread; None without any leg. The acceleration is None if it is not known."""
    if not legs:
        return None
    excess_s = sorted(leg.excess_s for leg in legs)
    beyond_s = None
    if acceleration_m_s2 is not None:
        ramps_s = (leg.excess_s - leg.speed_m_s / acceleration_m_s2 for leg in legs)
        beyond_s = statistics.median(ramps_s)
    return LegTimes(len(legs), statistics.median(excess_s), excess_s[0], excess_s[-1], beyond_s)


def legs(
    scenario: Annotated[
        Path,
        typer.Argument(
            metavar="SCENARIO",
            help="Scenario file, or the name of a shipped one.",
            parser=resolve_scenario,
        ),
    ],
    runs: Annotated[
        list[Path], typer.Argument(metavar="RUN...", help="What swarm run --json printed.")
    ],
    acceleration_m_s2: Annotated[
        float | None,
        typer.Option(
            "--acceleration-m-s2",
            min=0.01,
            max=100.0,
            metavar="A",
            help="Of the vehicles, such as WP_ACC or MPC_ACC_HOR; tells what is lost beyond v/a.",
            show_default=False,
        ),
    ] = None,
    json: JsonOption = False,
) -> int:
    """Time of legs flown, beyond length ÷ cruise speed.

    RUN is what swarm run --json printed of a flight of SCENARIO; several are counted together.
    Legs go from rest to rest: a vehicle with the acceleration a takes v/a longer at best.

    Examples:
        swarm run orchard --autopilot ardupilot --json > flight.json
        swarm bench legs orchard flight.json --acceleration-m-s2 2.5
        swarm bench legs orchard flight.json --json
    """
    from dataclasses import asdict
    from json import dumps

    from swarm.scenario import load_scenario, require_plain

    mission = load_scenario(scenario)
    require_plain(mission, "swarm bench legs")
    flown = [leg for path in runs for leg in legs_flown(mission, load_run(path), str(path))]
    times = leg_times(flown, acceleration_m_s2)
    if json:
        told = {
            "scenario": mission.name,
            "legs": [{**asdict(leg), "excess_s": leg.excess_s} for leg in flown],
            "times": None if times is None else asdict(times),
        }
        typer.echo(dumps(told))
    elif times is None:
        typer.echo(f"{mission.name}: no leg was flown")
    else:
        beyond_s = times.beyond_ramps_s
        typer.echo(
            f"{mission.name}: {times.legs} legs, beyond length / speed: "
            f"median {times.median_s:.2f} s ({times.least_s:.2f} to {times.greatest_s:.2f})"
            + ("" if beyond_s is None else f", v/a {beyond_s:+.2f} s")
        )
    return 0 if times is not None else 1
