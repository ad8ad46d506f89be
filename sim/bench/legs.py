"""The command `swarm bench legs`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Annotated

import typer

from swarm.runtime.options import JsonOption
from swarm.scenario.files import resolve_scenario

if TYPE_CHECKING:
    from sim.bench.flown_legs import KeptLimits, LegTimes


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
    """Times of legs and missions flown, beside those planned, and which limits were kept.

    RUN is what swarm run --json printed of a flight of SCENARIO; several are counted together.
    Legs go from rest to rest in the air, to tasks; planned is what plans reckon with, so
    scenarios that give no acceleration plan with length / cruise speed. Zones and batteries are
    judged by what UAVs told of themselves. Exit status 1 if no leg was flown, a task was not
    done, a UAV came nearer to a zone than the margin, or its charge fell below the reserve.

    Examples:
        swarm run vineyard --autopilot ardupilot --json > flight.json
        swarm bench legs vineyard flight.json
        swarm bench legs vineyard flight.json --acceleration-m-s2 2.5 --json
    """
    from dataclasses import asdict
    from json import dumps

    from sim.bench.flown_legs import (
        leg_times,
        legs_flown,
        limits_kept,
        load_run,
        makespan_frac,
        reckoned_makespan_s,
    )
    from swarm.scenario import load_scenario

    mission = load_scenario(scenario)
    told = [load_run(path) for path in runs]
    named = zip(told, runs, strict=True)
    flown = [leg for run, path in named for leg in legs_flown(mission, run, str(path))]
    times = leg_times(flown, acceleration_m_s2)
    makespans = [frac for frac in map(makespan_frac, told) if frac is not None]
    reckoned = [(run["makespan_s"], reckoned_makespan_s(mission, run)) for run in told]
    reckoned_fracs = [flown_s / by_model_s for flown_s, by_model_s in reckoned if by_model_s]
    limits = [limits_kept(mission, run) for run in told]
    if json:
        legs = [
            {**asdict(leg), "excess_s": leg.excess_s, "flown_frac": leg.flown_frac} for leg in flown
        ]
        times_json = None if times is None else asdict(times)
        kept = [{**asdict(each), "kept": each.kept} for each in limits]
        found: dict[str, object] = {"scenario": mission.name, "legs": legs, "times": times_json}
        found |= {"makespan_frac": makespans, "flown_lists_frac": reckoned_fracs, "limits": kept}
        typer.echo(dumps(found))
    else:
        fracs = {"": makespans, ", of the lists as flown": reckoned_fracs}
        typer.echo("\n  ".join(_lines(mission.name, times, fracs, limits)))
    return 0 if times is not None and all(each.kept for each in limits) else 1


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
    for each in limits:
        said = [f"{each.done} of {each.tasks} tasks done"]
        if each.nearest_zone_m is not None:
            said.append(f"{each.nearest_zone_m:.1f} m from a zone (margin {each.margin_m:g} m)")
        if each.charge_frac is not None:
            said.append(f"{each.charge_frac:.0%} charge left (reserve {each.reserve_frac:.0%})")
        yield ", ".join(said) + ("" if each.kept else ": not kept")
