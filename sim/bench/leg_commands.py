"""The command `swarm bench legs`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Annotated

import typer

from sim.bench.command_line import each, progress, show
from swarm.runtime.errors import Fault, InputError, remedy_for_name
from swarm.runtime.options import JsonOption, SeedOption, SpeedupOption
from swarm.scenario.files import resolve_scenario

if TYPE_CHECKING:
    from agent.vehicle.config import CommandStyle
    from sim.bench.flown_legs import KeptLimits, LegTimes
    from sim.bench.leg_flights import FlightWay
    from swarm.model import Mission

_SPEEDUP = 4.0
"""More, and a UAV is told of by so few places that nobody can judge it by them."""


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
        list[Path] | None,
        typer.Argument(
            metavar="[RUN]...",
            help="What swarm run --json printed; without any SCENARIO is flown.",
            show_default=False,
        ),
    ] = None,
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
    autopilot: Annotated[
        str | None,
        typer.Option(
            "--autopilot",
            metavar="sim|sim-px4|ardupilot|px4,…",
            help="What flies. Default: the simulated ones, and firmware where "
            "SWARM_SITL_ARDUCOPTER and SWARM_SITL_PX4 say where it is.",
            show_default=False,
        ),
    ] = None,
    command: Annotated[
        str | None,
        typer.Option(
            "--command",
            metavar="reposition|mission,…",
            help="How vehicles are commanded. Default: in both ways.",
            show_default=False,
        ),
    ] = None,
    speedup: SpeedupOption = _SPEEDUP,
    seed: SeedOption = 0,
    each_leg: Annotated[
        bool, typer.Option("--each-leg", help="Also show every leg that was flown here.")
    ] = False,
    json: JsonOption = False,
) -> int:
    """Times of legs and missions flown, beside those planned, and which limits were kept.

    Flies SCENARIO once with every autopilot that this machine has, commanded in every way;
    the speed-up is of simulated ones, firmware flies at wall speed. RUN is what swarm run
    --json printed of a flight of SCENARIO: then nothing is flown, and several are counted
    together.
    Legs go from rest to rest in the air, to tasks; planned is what plans reckon with, so
    scenarios that give no acceleration plan with length / cruise speed. Zones and batteries are
    judged by what UAVs told of themselves. Exit status 1 if no leg was flown, a task was not
    done, a UAV came nearer to a zone than the margin, or its charge fell below the reserve.

    Examples:
        swarm bench legs vineyard
        SWARM_SITL_PX4=~/PX4-Autopilot/build/px4_sitl_default swarm bench legs vineyard --each-leg
        swarm bench legs vineyard --autopilot sim-px4 --command mission --speedup 2 --json
        swarm run vineyard --autopilot ardupilot --json > flight.json
        swarm bench legs vineyard flight.json
        swarm bench legs vineyard flight.json --acceleration-m-s2 2.5 --json
    """
    from swarm.scenario import load_scenario

    mission = load_scenario(scenario)
    if runs:
        for flag, text in (("--autopilot", autopilot), ("--command", command)):
            if text is not None:
                problem = f"nothing is flown, as {runs[0]} is read"
                raise InputError(Fault(flag, text, problem, "leave one of them out"))
        return _read(mission, runs, acceleration_m_s2, json=json)
    return _fly(
        scenario,
        mission,
        _ways(autopilot, command, speedup),
        acceleration_m_s2,
        seed=seed,
        each_leg=each_leg,
        json=json,
    )


def _ways(autopilot: str | None, command: str | None, speedup: float) -> list[FlightWay]:
    """What is asked for, or all that this machine has."""
    from os import environ

    from agent.vehicle.config import CommandStyle
    from sim.bench.leg_flights import SIMULATED, autopilots_here, ways
    from sim.fleet.firmware import FirmwareKind

    known = (*SIMULATED, *FirmwareKind)

    def named(flag: str, word: str) -> str:
        if word not in known:
            raise InputError(Fault(flag, word, "no such autopilot", remedy_for_name(word, known)))
        return word

    def style(flag: str, word: str) -> CommandStyle:
        if word not in tuple(CommandStyle):
            remedy = remedy_for_name(word, CommandStyle)
            raise InputError(Fault(flag, word, "no such way to command", remedy))
        return CommandStyle(word)

    here = autopilots_here(environ)
    chosen = here if autopilot is None else each("--autopilot", autopilot, named)
    styles = list(CommandStyle) if command is None else each("--command", command, style)
    return ways(chosen, styles, speedup)


def _fly(
    scenario: Path,
    mission: Mission,
    flown: Sequence[FlightWay],
    acceleration_m_s2: float | None,
    *,
    seed: int,
    each_leg: bool,
    json: bool,
) -> int:
    """Fly it, tell of it; the exit status."""
    from os import environ

    from rich.console import Console

    from sim.bench.leg_flights import measure_legs

    with progress() as tell:
        done = measure_legs(
            scenario,
            mission,
            flown,
            environ,
            seed=seed,
            acceleration_m_s2=acceleration_m_s2,
            tell=tell,
        )
    show(done, json=json)
    if each_leg and not json:
        Console(highlight=False).print(done.leg_table())
    return 0 if done.kept else 1


def _read(
    mission: Mission, runs: Sequence[Path], acceleration_m_s2: float | None, *, json: bool
) -> int:
    """Judge flights that have been flown, together; the exit status."""
    from dataclasses import asdict
    from json import dumps

    from sim.bench.flown_legs import judge_flight, leg_times, load_run

    told = [load_run(path) for path in runs]
    named = zip(told, runs, strict=True)
    judged = [judge_flight(mission, run, str(path), acceleration_m_s2) for run, path in named]
    flown = [leg for flight in judged for leg in flight.legs]
    times = leg_times(flown, acceleration_m_s2)
    makespans = [flight.makespan_frac for flight in judged if flight.makespan_frac is not None]
    of_lists = [flight.flown_lists_frac for flight in judged if flight.flown_lists_frac is not None]
    limits = [flight.limits for flight in judged]
    if json:
        found: dict[str, object] = {
            "scenario": mission.name,
            "legs": [leg.as_json() for leg in flown],
            "times": None if times is None else asdict(times),
            "makespan_frac": makespans,
            "flown_lists_frac": of_lists,
            "limits": [limit.as_json() for limit in limits],
        }
        typer.echo(dumps(found))
    else:
        fracs = {"": makespans, ", of the lists as flown": of_lists}
        typer.echo("\n  ".join(_lines(mission.name, times, fracs, limits)))
    return 0 if times is not None and all(limit.kept for limit in limits) else 1


def _lines(
    name: str,
    times: LegTimes | None,
    makespans: Mapping[str, Sequence[float]],
    limits: Sequence[KeptLimits],
) -> Iterator[str]:
    """What is found, for people."""
    if times is None:
        yield f"{name}: no leg was flown"
    else:
        yield f"{name}: {times.legs} legs"
        spread = f"({times.least_frac:.2f} to {times.greatest_frac:.2f})"
        yield f"flown / planned: median {times.flown_frac:.2f} {spread}"
        spread = f"({times.least_s:.2f} to {times.greatest_s:.2f})"
        beyond_s = times.beyond_ramps_s
        ramps = "" if beyond_s is None else f", v/a {beyond_s:+.2f} s"
        yield f"beyond length / speed: median {times.median_s:.2f} s {spread}{ramps}"
    for of, fracs in makespans.items():
        if fracs:
            yield f"makespan flown / planned{of}: {median(fracs):.2f}"
    for limit in limits:
        said = [f"{limit.done} of {limit.tasks} tasks done"]
        if limit.nearest_zone_m is not None:
            said.append(f"{limit.nearest_zone_m:.1f} m from a zone (margin {limit.margin_m:g} m)")
        if limit.charge_frac is not None:
            said.append(f"{limit.charge_frac:.0%} charge left (reserve {limit.reserve_frac:.0%})")
        yield ", ".join(said) + ("" if limit.kept else ": not kept")
