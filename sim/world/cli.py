"""The command `swarm simulate`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from coordinator.recording.options import RecordOption
from sim.options import (
    ChanceOptions,
    CoordinatorLostOption,
    MethodOption,
    ReportOption,
    check_flight,
    print_report,
    with_reattempts,
)
from swarm.runtime.errors import Fault, InputError
from swarm.runtime.option_groups import with_options
from swarm.runtime.options import JsonOption, OptionalScenarioArgument, SeedOption

if TYPE_CHECKING:
    from coordinator.terminal.report import MissionReport
    from sim.world.uncertainty import Uncertainty
    from swarm.model import Mission


@with_options
def simulate(
    ctx: typer.Context,
    *,
    scenario: OptionalScenarioArgument = None,
    recording: Annotated[
        Path | None,
        typer.Option(
            "--from",
            metavar="FILE.mcap",
            help="Instead of flying a scenario, make every decision in that recording again from "
            "the same inputs, and tell of those that come out otherwise.",
            show_default=False,
        ),
    ] = None,
    method: MethodOption = "greedy",
    seed: SeedOption = 0,
    chance: ChanceOptions,
    coordinator_lost_s: CoordinatorLostOption = None,
    faults: Annotated[
        str | None,
        typer.Option(
            "--faults",
            metavar="KINDS|FILE",
            help="Let more go wrong: kinds of fault with commas between, all, or a file with a "
            "schedule of them.",
            show_default=False,
        ),
    ] = None,
    report: ReportOption = None,
    record: RecordOption = None,
    json: JsonOption = False,
) -> int:
    """Fly a mission in virtual time, by the agents' real code.

    The coordinator's code is the real one as well; there are no sockets. Unless told otherwise
    nothing is uncertain: vehicles and network are ideal, and the lists flown are exactly those
    planned. Each kind of uncertainty is drawn from the seed by itself, so asking for one leaves
    what the others draw as it was. With --faults the network and the clocks are like real ones,
    what goes wrong is told on standard error in lines that a file may hold, and the invariants of
    a fleet are watched. Exit status 0: every task
    was done that has to be and can be, and no invariant broken. With --from
    FILE.mcap, which takes no scenario and no other option but --json, decisions that were recorded
    are made again; exit status 0: none came out otherwise.

    Examples:
        swarm simulate table-1
        swarm simulate reservoir-inspection --method guided
        swarm simulate valley-survey --loss 0.3 --popup 0.3 --seed 7
        swarm simulate valley-survey --method guided --loss 0.3 --coordinator-lost-s 0
        swarm simulate table-1 --outcomes --reattempt --seed 1
        swarm simulate valley-survey --speed-sd 0.1 --leg-sd 0.1 --wind 5
        swarm simulate reservoir-inspection --speed-frac 0.8 --drain-frac 1.25
        swarm simulate valley-survey --message-loss 0.2 --delay-s 0.05 --jitter-s 0.05
        swarm simulate valley-survey --faults cut,crash --seed 7
        swarm simulate valley-survey --loss 0.3 --record flight.mcap
        swarm simulate --from flight.mcap
    """
    if recording is not None:
        _refuse_all_but(ctx, "recording", "json")
        return _redecide(recording, json=json)
    if scenario is None:
        remedy = "name a scenario, such as table-1, or a recording with --from"
        raise InputError(Fault("swarm simulate", "", "nothing to simulate", remedy))

    from coordinator.core.heights import height_warnings
    from coordinator.core.publication import unsayable
    from coordinator.terminal.report import MissionReport
    from sim.world.simulation import recording_simulation, simulate_mission
    from sim.world.uncertainty import Uncertainty
    from swarm.model.layers import FlightLayers, layers_over
    from swarm.scenario import load_scenario

    check_flight(method, report, record)
    uncertainty = chance.changed(Uncertainty())
    mission = with_reattempts(load_scenario(scenario), reattempt=chance.reattempt)
    remedy = "leave some out, or make several of it"
    lines = unsayable(mission, FlightLayers())
    if complaints := [Fault(str(scenario), "", what, remedy) for what in lines]:
        raise InputError(*complaints)
    for warning in height_warnings(mission, layers_over(mission.terrain)):
        typer.echo(f"warning: {warning}", err=True)
    if faults is not None:
        if record is not None:
            problem, remedy = "does not go with --faults", "leave one of them out"
            raise InputError(Fault("--record", str(record), problem, remedy))
        if coordinator_lost_s is not None:
            raise _refused_beside(faults)
        told, broken = _fly_with_faults(mission, method, seed, uncertainty, faults)
        status = print_report(told, json=json, report=report)
        return 1 if broken else status
    with recording_simulation(mission.name, str(scenario), record) as looks_on:
        flown = simulate_mission(
            mission,
            method=method,
            seed=seed,
            uncertainty=uncertainty,
            coordinator_lost_s=coordinator_lost_s,
            make_observer=looks_on,
        )
        if not flown.in_time:
            typer.echo("broken off: somebody would have waited for ever", err=True)
        told = MissionReport(
            mission=flown.world.mission,
            plan=flown.world.mission_state.plan,
            result=flown.result,
            story=tuple(flown.world.mission_state.story),
            lost_because=flown.lost_because,
            value=flown.value,
            executed_schedule=flown.world.executed_schedule(),
            closest_approach=flown.world.closest_approach(),
            left_out=flown.world.mission_state.left_out,
            lowest_clearance_m=flown.world.lowest_clearance_m(),
        )
        return print_report(told, json=json, report=report)


def _fly_with_faults(
    mission: Mission, method: str, seed: int, uncertainty: Uncertainty, faults: str
) -> tuple[MissionReport, bool]:
    """Fly it, and tell what goes wrong; its report, and whether an invariant was broken."""
    from coordinator.terminal.report import MissionReport
    from sim.faults.generator import fly_with_faults
    from sim.faults.schedule import format_schedule
    from sim.world.uncertainty import Uncertainty

    beside_faults = Uncertainty(
        loss=uncertainty.loss,
        popup=uncertainty.popup,
        popups_per_min=uncertainty.popups_per_min,
    )
    if uncertainty != beside_faults:
        raise _refused_beside(faults)
    verdict = fly_with_faults(
        mission, method=method, seed=seed, uncertainty=uncertainty, faults=faults
    )
    typer.echo(format_schedule(verdict.case.schedule), nl=False, err=True)
    if verdict.broken is not None:
        typer.echo(f"broken: {verdict.broken}", err=True)
    state = verdict.world.mission_state
    told = MissionReport(
        mission=state.mission,
        plan=state.plan,
        result=state.result(),
        story=tuple(state.story),
        executed_schedule=verdict.world.executed_schedule(),
        closest_approach=verdict.world.closest_approach(),
        left_out=state.left_out,
        lowest_clearance_m=verdict.world.lowest_clearance_m(),
    )
    return told, verdict.broken is not None


def _refused_beside(faults: str) -> InputError:
    problem = "goes with --loss, --popup and --popup-rate only"
    remedy = "leave the others out, or ask for kinds of fault such as weather, cut or slow"
    return InputError(Fault("--faults", faults, problem, remedy))


def _refuse_all_but(ctx: typer.Context, *names: str) -> None:
    """What is said on the command line beside these parameters would have no effect."""
    for parameter in ctx.command.params:
        source = ctx.get_parameter_source(parameter.name or "")
        if parameter.name in names or source is None or source.name != "COMMANDLINE":
            continue
        said = max(parameter.opts, key=len) if parameter.param_type_name == "option" else "SCENARIO"
        problem, remedy = "has no meaning with --from, which flies nothing", "leave it out"
        raise InputError(Fault(said, "", problem, remedy))


def _redecide(path: Path, *, json: bool) -> int:
    """Decide again what is recorded in ``path``; the exit status of the command."""
    from json import dumps

    from coordinator.recording.reader import read_recording
    from sim.world.redecision import redecide, redecided_as_json, redecided_lines

    recording = read_recording(path)
    if recording.torn is not None:
        typer.echo(recording.torn, err=True)
    found = redecide(entry.fact for entry in recording.entries)
    if json:
        typer.echo(dumps(redecided_as_json(recording.mission, found), allow_nan=False))
    else:
        for line in redecided_lines(recording.mission, found):
            typer.echo(line)
    return 0 if found.ok else 1
