"""The command `swarm doctor`."""

from __future__ import annotations

import sys
from collections.abc import AsyncIterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from swarm.bus.connection import DEFAULT_CONNECTION, ConnectionOptions
from swarm.runtime.option_groups import with_options
from swarm.runtime.options import JsonOption, OptionalScenarioArgument

if TYPE_CHECKING:
    from agent.vehicle.signing import SigningKey
    from sim.fleet.doctor.finding import CheckFinding
    from swarm.identity import Identity

_LEAST_PYTHON = (3, 11)
_DEFAULT_UAVS = 3
"""Fleet for which the machine is judged without a scenario."""


@with_options
def doctor(
    scenario: OptionalScenarioArgument = None,
    mission: Annotated[
        str | None,
        typer.Option("--mission", metavar="NAME", help="Mission that should be there on the bus."),
    ] = None,
    seat: ConnectionOptions = DEFAULT_CONNECTION,
    mavlink: Annotated[
        list[str] | None,
        typer.Option(
            "--mavlink",
            metavar="URL[#SYSID]",
            help="Autopilot to listen to, as for swarm agent, such as udpin:0.0.0.0:14550#1; may "
            "be repeated. It is asked for messages and never commanded.",
        ),
    ] = None,
    signing_key: Annotated[
        Path | None,
        typer.Option("--signing-key", metavar="FILE", help="Key that the autopilots sign with."),
    ] = None,
    state: Annotated[
        Path | None,
        typer.Option(
            "--state", metavar="DIR", help="Folder in which processes shall keep what they know."
        ),
    ] = None,
    port: Annotated[
        list[int] | None,
        typer.Option(
            "--port",
            min=1,
            max=65535,
            metavar="P",
            help="TCP port that must be free, such as a dashboard's or a router's; may be "
            "repeated.",
        ),
    ] = None,
    timeout_s: Annotated[
        float,
        typer.Option(
            "--timeout-s",
            min=0.1,
            max=600.0,
            metavar="S",
            help="How long to wait for each autopilot's heartbeat, and once it is heard for it to "
            "have booted and be ready.",
        ),
    ] = 5.0,
    json: JsonOption = False,
) -> int:
    """Check all that a flight leans on, and say what to do.

    Looks at Python and its packages, the compiled kernels, the machine's clock and limits and
    Zenoh; at the scenario, ports, keys, bus, autopilots, signing key and state folder that are
    named. One line per check: ok, warning or fails, what was found, and what to do.
    Exit status 0: nothing fails.

    Examples:
        swarm doctor
        swarm doctor valley-survey --port 8080 --state /var/lib/peckorder
        swarm doctor --keys keys/uav1 --connect tls/192.168.1.2:7447
        swarm doctor --mavlink udpin:0.0.0.0:14550 --mavlink serial:/dev/ttyUSB0:57600#7
        swarm doctor --mavlink tcp:127.0.0.1:5760 --signing-key uav1.key --json
    """
    import asyncio
    from json import dumps

    from rich.console import Console

    from coordinator.joining import check_mission
    from sim.fleet.doctor.bus import check_bus, check_zenoh
    from sim.fleet.doctor.finding import CheckState, as_json, print_findings
    from sim.fleet.doctor.host import check_clock, check_limits, check_state
    from sim.fleet.doctor.inputs import check_roster, check_scenario, read_keys
    from sim.fleet.doctor.link import check_vehicle, parse_vehicle
    from sim.fleet.doctor.probes import look_at_port, read_clock, read_folder, read_limits
    from swarm.runtime.clock import unix_s
    from swarm.runtime.log import LogLevel, configure_logging
    from swarm.runtime.process import run_until_stopped

    configure_logging(LogLevel.ERROR)
    check_mission(mission)
    identity: Identity | None = None
    keyed: list[CheckFinding] = []
    if seat.keys is not None:
        identity, keyed = read_keys(seat.keys, mission, unix_s())
    usable = seat.keys is None or identity is not None
    config = seat.config(mission=mission) if usable else None
    vehicles = [parse_vehicle(text) for text in mavlink or ()]
    found: list[CheckFinding] = []
    console = Console(highlight=False)

    async def checks() -> AsyncIterator[Sequence[CheckFinding]]:
        yield _software()
        yield [check_clock(read_clock())]
        flown = None
        if scenario is not None:
            flown, findings = check_scenario(scenario)
            yield findings
        n_uav = len(flown.uavs) if flown else _DEFAULT_UAVS
        apart = flown is not None and flown.separation_m is not None
        yield check_limits(read_limits(), n_uav, keeps_apart=apart)
        if state is not None:
            yield [check_state(read_folder(state))]
        for each in port or ():
            yield [look_at_port("port", str(each), "0.0.0.0", each)]  # noqa: S104 - tried, not kept
        yield [await check_zenoh()]
        yield keyed
        if config is not None:  # else the keys say what is wrong
            if config.identity is not None:
                uavs = [uav.id for uav in flown.uavs] if flown else []
                yield [check_roster(config.identity, uavs, unix_s())]
            yield await check_bus(config, mission, asked_for=seat.is_named)
        key = None
        if signing_key is not None:
            key, finding = _key(signing_key)
            yield [finding]
        for heard in await asyncio.gather(
            *(check_vehicle(each, key, timeout_s) for each in vehicles)
        ):
            yield heard

    async def work() -> int:
        async for findings in checks():
            found.extend(findings)
            if not json:
                print_findings(findings, console)
        if json:
            print(dumps(as_json(found)))
        return 1 if any(each.state is CheckState.FAILS for each in found) else 0

    return asyncio.run(run_until_stopped(work()))


def _software() -> list[CheckFinding]:
    from importlib.metadata import PackageNotFoundError, requires, version

    from sim.fleet.doctor.host import check_kernels, check_packages, check_python

    def installed(name: str) -> str | None:
        try:
            return version(name)
        except PackageNotFoundError:
            return None

    return [
        check_python(sys.version_info[:3], _LEAST_PYTHON),
        check_packages(requires("peckorder") or (), installed),
        check_kernels(_planned),
    ]


def _planned() -> Mapping[str, float]:
    """J of plans of table-1 by method."""
    from coordinator.planner.plan import make_plan
    from swarm.runtime.clock import SystemClock
    from swarm.scenario import load_scenario, shipped_scenarios

    mission = load_scenario(shipped_scenarios()["table-1"])
    methods = ("greedy", "exact")
    return {m: make_plan(mission, m, clock=SystemClock(), seed=0).objective for m in methods}


def _key(path: Path) -> tuple[SigningKey | None, CheckFinding]:
    from agent.vehicle.signing import load_signing_key
    from sim.fleet.doctor.host import check_key
    from sim.fleet.doctor.probes import file_mode
    from swarm.runtime.errors import InputError

    try:
        key, problem = load_signing_key(path), None
    except InputError as error:
        key, problem = None, str(error)
    return key, check_key(path, problem, file_mode(path))
