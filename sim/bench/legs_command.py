"""The command `swarm bench legs`.

Leaves out: where the figures come from (`sim.bench.legs`).
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from swarm.options import JsonOption
from swarm.scenario.shipped import resolve_scenario

__all__ = ["LEGS_HELP", "legs"]

LEGS_HELP = """Time of legs flown, beyond length ÷ cruise speed.

RUN is what swarm run --json printed of a flight of SCENARIO; several are counted together.
Legs go from rest to rest: a vehicle with the acceleration a takes v/a longer at best.

\b
Examples:
    swarm run orchard --autopilot ardupilot --json > flight.json
    swarm bench legs orchard flight.json --acceleration-m-s2 2.5
    swarm bench legs orchard flight.json --json
"""


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
    """See `LEGS_HELP`."""
    from dataclasses import asdict
    from json import dumps

    from sim.bench.legs import leg_times, legs_flown, load_run
    from swarm.scenario import load_scenario

    mission = load_scenario(scenario)
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
