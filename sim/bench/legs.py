"""The command `swarm bench legs`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from swarm.runtime.options import JsonOption
from swarm.scenario.files import resolve_scenario


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
    """Times of legs and missions flown, beside those planned.

    RUN is what swarm run --json printed of a flight of SCENARIO; several are counted together.
    Legs go from rest to rest in the air, to tasks; planned is what plans reckon with, so
    scenarios that give no acceleration plan with length / cruise speed.

    Examples:
        swarm run orchard --autopilot ardupilot --json > flight.json
        swarm bench legs orchard flight.json --acceleration-m-s2 2.5
        swarm bench legs orchard flight.json --json
    """
    from dataclasses import asdict
    from json import dumps
    from statistics import median

    from sim.bench.flown_legs import leg_times, legs_flown, load_run, makespan_frac
    from swarm.scenario import load_scenario

    mission = load_scenario(scenario)
    told = [load_run(path) for path in runs]
    named = zip(told, runs, strict=True)
    flown = [leg for run, path in named for leg in legs_flown(mission, run, str(path))]
    times = leg_times(flown, acceleration_m_s2)
    makespans = [frac for frac in map(makespan_frac, told) if frac is not None]
    if json:
        legs = [
            {**asdict(leg), "excess_s": leg.excess_s, "flown_frac": leg.flown_frac} for leg in flown
        ]
        times_json = None if times is None else asdict(times)
        found = {"scenario": mission.name, "legs": legs, "times": times_json}
        typer.echo(dumps({**found, "makespan_frac": makespans}))
    elif times is None:
        typer.echo(f"{mission.name}: no leg was flown")
    else:
        beyond_s = times.beyond_ramps_s
        typer.echo(
            f"{mission.name}: {times.legs} legs\n"
            f"  flown / planned: median {times.flown_frac:.2f} "
            f"({times.least_frac:.2f} to {times.greatest_frac:.2f})\n"
            f"  beyond length / speed: "
            f"median {times.median_s:.2f} s ({times.least_s:.2f} to {times.greatest_s:.2f})"
            + ("" if beyond_s is None else f", v/a {beyond_s:+.2f} s")
            + (f"\n  makespan flown / planned: {median(makespans):.2f}" * bool(makespans))
        )
    return 0 if times is not None else 1
