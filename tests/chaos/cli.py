"""The command ``python -m tests.chaos``.

Leaves out: what it does (tests.chaos.kills).
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from swarm.runtime.options import JsonOption, SeedOption, SpeedupOption
from swarm.scenario.files import resolve_scenario
from tests.chaos.kills import KillTarget


def chaos(
    what: Annotated[
        list[KillTarget] | None,
        typer.Option("--what", help="What to kill; may be repeated. Default: each in turn."),
    ] = None,
    scenario: Annotated[
        Path | None,
        typer.Option(
            "--scenario",
            metavar="SCENARIO",
            parser=resolve_scenario,
            help="Scenario file or name of a shipped one. Default: valley-survey.",
            show_default=False,
        ),
    ] = None,
    trials: Annotated[
        int, typer.Option("--trials", min=1, metavar="N", help="Flights for each.")
    ] = 20,
    routers: Annotated[
        int, typer.Option("--routers", min=1, max=8, metavar="N", help="Routers of the fleet.")
    ] = 1,
    jobs: Annotated[
        int, typer.Option("--jobs", min=1, metavar="N", help="Flights at the same time.")
    ] = 1,
    seed: SeedOption = 0,
    speedup: SpeedupOption = 30.0,
    json: JsonOption = False,
) -> int:
    """Kill a process of a flying fleet at a random moment and start it anew, flight by flight.

    Exit status 0: every task was done in every flight, and every invariant of the recorded
    messages held.

    Examples:
        python -m tests.chaos
        python -m tests.chaos --what agent --trials 20 --seed 7
    """
    import asyncio
    import sys
    from dataclasses import asdict
    from json import dumps

    from rich.console import Console
    from rich.table import Table

    from sim.fleet.layout import BusKind, LaunchOptions
    from swarm.runtime.log import LogLevel, configure_logging
    from swarm.runtime.process import run_until_stopped
    from swarm.scenario import load_scenario
    from tests.chaos.kills import KillTrial, PlannedKill, draw_kills, fly_kill_trials

    configure_logging(LogLevel.WARNING)
    scenario = scenario or resolve_scenario("valley-survey")
    mission = load_scenario(scenario)
    options = LaunchOptions(
        scenario=scenario,
        method="guided",
        seed=seed,
        speedup=speedup,
        bus=BusKind.ROUTER,
        position_rate_hz=30.0,
        acceptance_radius_m=1.0,
        start_timeout_s=120.0,
        routers=routers,
    )
    told: dict[KillTarget, list[KillTrial]] = {}

    def blows_on(kind: KillTarget) -> list[PlannedKill]:
        uavs = tuple(uav.id for uav in mission.uavs)
        return draw_kills(kind, uavs, routers, trials, seed)

    async def work() -> int:
        for kind in what or list(KillTarget):

            def on_trial(number: int, trial: KillTrial, kind: KillTarget = kind) -> None:
                verdict = "all done" if trial.passed else f"FAILED: {'; '.join(trial.faults)}"
                print(
                    f"{kind} {number + 1}/{trials}: {trial.blow.name} killed at {trial.at_s:.0f} s,"
                    f" gone for {trial.blow.gone_s:.1f} s; {trial.done}/{trial.n_task} done,"
                    f" {trial.duplicates} duplicates, {trial.wall_s:.0f} s: {verdict}",
                    file=sys.stderr,
                )

            blows = blows_on(kind)
            told[kind] = await fly_kill_trials(
                mission, options, blows, jobs=jobs, on_trial=on_trial
            )
        return 0 if all(t.passed for trials_of in told.values() for t in trials_of) else 1

    status = asyncio.run(run_until_stopped(work()))
    if json:
        print(dumps({kind: [asdict(trial) for trial in ended] for kind, ended in told.items()}))
        return status
    table = Table(
        "killed", "flights", "all done", "duplicates", "slowest agreement [s]", "wall [s]"
    )
    for kind, ended in told.items():
        table.add_row(
            kind,
            str(len(ended)),
            str(sum(trial.passed for trial in ended)),
            str(sum(trial.duplicates for trial in ended)),
            f"{max(trial.agreement_s for trial in ended):.2f}",
            f"{sum(trial.wall_s for trial in ended) / jobs:.0f}",
        )
    Console().print(table)
    return status
