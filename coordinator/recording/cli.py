"""The commands `swarm record`, `swarm replay` and `swarm explain`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from swarm.bus.connection import DEFAULT_CONNECTION, ConnectionOptions
from swarm.runtime.errors import EXIT_INTERRUPTED, Fault, InputError
from swarm.runtime.option_groups import with_options
from swarm.runtime.options import JsonOption, SomeMissionOption, SpeedupOption

if TYPE_CHECKING:
    from coordinator.recording.flight_recorder import FlightRecorder
    from coordinator.recording.playback import Playback
    from coordinator.recording.reader import Recording

NewFileArgument = Annotated[
    Path, typer.Argument(metavar="FILE.mcap", help="File to be made.", show_default=False)
]
FileArgument = Annotated[
    Path, typer.Argument(metavar="FILE.mcap", help="A recording.", show_default=False)
]
LEFT_S = 5.0
"""Wall time after which a mission whose UAVs have all left is over."""


@with_options
def record(
    file: NewFileArgument,
    mission: SomeMissionOption = None,
    duration_s: Annotated[
        float | None,
        typer.Option(
            "--duration-s",
            min=0.1,
            metavar="S",
            help="Stop after so many wall seconds. Default: when the mission is over.",
            show_default=False,
        ),
    ] = None,
    timeout_s: Annotated[
        float,
        typer.Option(
            "--timeout-s",
            min=0.1,
            max=86400.0,
            metavar="S",
            help="How long to wait for the bus, and then for a mission; wall seconds.",
        ),
    ] = 60.0,
    seat: ConnectionOptions = DEFAULT_CONNECTION,
    speedup: SpeedupOption = 1.0,
) -> int:
    """Record a mission that is flown elsewhere.

    Joins as an observer, until the mission is over or Ctrl-C; nobody flies any differently for
    it. Everything that is said goes into the file, with a map, a scene and curves for Foxglove.
    After every second the file is whole, whatever happens then. Exit status 1: nobody flies a
    mission, or not everything could be written.

    Examples:
        swarm record flight.mcap
        swarm record flight.mcap --keys keys/dashboard --connect tls/192.168.1.2:7447
        swarm record ten-minutes.mcap --duration-s 600
    """
    import asyncio

    from coordinator.joining import check_mission, joined, observer_shell
    from coordinator.recording.flight_recorder import recording_to, wall_ns
    from coordinator.recording.options import check_new_recording
    from coordinator.recording.recorder import RecordingInfo, RecordingObserver
    from swarm.runtime.clock import ScaledClock
    from swarm.runtime.log import LogLevel, configure_logging
    from swarm.runtime.process import run_until_stopped

    configure_logging(LogLevel.ERROR)
    check_mission(mission)
    check_new_recording(file)
    seat = seat.found(mission)
    network = seat.network
    config = seat.config(mission=mission)
    timing = network.timing.scaled(speedup)
    begun: FlightRecorder | None = None

    async def work() -> int:
        nonlocal begun
        async with joined(mission, config, timeout_s) as (name, place):
            clock = ScaledClock(speedup)
            witness = RecordingObserver(
                name,
                timing,
                linger_s=LEFT_S * speedup,
                until_s=None if duration_s is None else duration_s * speedup,
            )
            about = RecordingInfo(name, timing, speedup)
            with recording_to(file, about, wall_ns(), _warn) as recorder:
                begun = recorder
                print(f"recording {name} in {file}", file=sys.stderr)
                mission_state = witness.observer.mission_state
                core = recorder.around(witness, mission_state)
                shell = observer_shell(
                    *(core, place, clock, name, "record", network.answer_s),
                    every_status=True,
                    known=mission_state.replica.digest,
                )
                try:
                    await shell.run()
                finally:
                    recorder.close()
                    if shell.dropped:
                        reasons = ", ".join(f"{n} {why}" for why, n in shell.dropped.items())
                        _warn(f"{file}: messages were dropped, and are missing: {reasons}")
                    print(f"{file}: {recorder.told}", file=sys.stderr)
        return 0

    status = asyncio.run(run_until_stopped(work()))
    if begun is None:
        return status
    if begun.fault is not None:
        return 1
    # Ctrl-C is how a recording is ended; before it began there is none.
    return 0 if status == EXIT_INTERRUPTED else status


def replay(
    file: FileArgument,
    speed: Annotated[
        float,
        typer.Option(
            "--speed",
            min=0.01,
            max=1000.0,
            metavar="X",
            help="Mission seconds per wall second; the page changes it at any time.",
        ),
    ] = 1.0,
    at_s: Annotated[
        float,
        typer.Option(
            "--at-s", min=0.0, metavar="T", help="Begin T seconds after the recording does."
        ),
    ] = 0.0,
    final: Annotated[
        bool,
        typer.Option(
            "--final", help="Only print how the mission stood in the end, as swarm status does."
        ),
    ] = False,
    plot: Annotated[
        Path | None,
        typer.Option(
            "--plot",
            metavar="FILE.png|svg|pdf",
            help="Only draw the flight over the map and the plan: ways flown, zones, areas and "
            "what is covered of them.",
            show_default=False,
        ),
    ] = None,
    json: JsonOption = False,
    port: Annotated[
        int,
        typer.Option("--port", min=0, max=65535, metavar="PORT", help="0: any that is free."),
    ] = 0,
    no_browser: Annotated[
        bool, typer.Option("--no-browser", help="Only print the page's address.")
    ] = False,
) -> int:
    """Play a recording in the dashboard, or print how it ended.

    At any speed, back and forth. The page is served on this machine alone, until Ctrl-C.

    Examples:
        swarm replay flight.mcap
        swarm replay flight.mcap --speed 20 --port 8080 --no-browser
        swarm replay flight.mcap --final
        swarm replay flight.mcap --final --json
        swarm replay flight.mcap --plot flight.png
    """
    from rich.console import Console

    from coordinator.mission_view.scene import scene_of
    from coordinator.recording.playback import Playback
    from coordinator.terminal.cli import print_status

    if plot is not None:
        _draw(file, plot)
        return 0
    playback = Playback(_read(file), speed)
    if final:
        playback.seek(playback.duration_s)
        found = scene_of(playback.mission_state, playback.now_s)
        print_status(found, Console(highlight=False), json=json)
        return 0
    playback.seek(at_s)
    return _play(playback, port, json=json, browser=not no_browser)


def explain(
    file: FileArgument,
    task: Annotated[
        str | None,
        typer.Option("--task", metavar="TASK", help="Tell its story.", show_default=False),
    ] = None,
    uav: Annotated[
        str | None,
        typer.Option("--uav", metavar="UAV", help="Tell its story.", show_default=False),
    ] = None,
    near_m: Annotated[
        float,
        typer.Option(
            "--near-m",
            min=0.0,
            metavar="M",
            help="Tell every time that another UAV came as near as this to it, or to who did the "
            "task on the way there.",
        ),
    ] = 20.0,
    json: JsonOption = False,
) -> int:
    """Tell a task's or a UAV's story from a recording.

    In sentences, event by event, with the reason of each choice, and with how near other UAVs
    came in flight.

    Examples:
        swarm explain flight.mcap --task t7
        swarm explain flight.mcap --uav uav3
        swarm explain flight.mcap --uav uav3 --near-m 50
        swarm explain flight.mcap --task t7 --json
    """
    from json import dumps

    from rich.console import Console

    from coordinator.recording.explanation import explain_task, explain_uav

    match task, uav:
        case str(), None:
            told = explain_task(_read(file), task, near_m)
        case None, str():
            told = explain_uav(_read(file), uav, near_m)
        case _:
            problem = "neither is given" if task is None else "both are given"
            remedy = "give one of them, such as --task t1"
            raise InputError(Fault("--task, --uav", "", problem, remedy))
    if json:
        print(dumps(told.as_json(), allow_nan=False))
    else:
        told.render(Console(highlight=False))
    return 0


def _read(file: Path) -> Recording:
    """The recording, with a word if it is not whole."""
    from coordinator.recording.reader import read_recording

    recording = read_recording(file)
    if recording.torn is not None:
        print(f"swarm: {recording.torn}; what comes before is whole", file=sys.stderr)
    return recording


def _draw(file: Path, picture: Path) -> None:
    """Draw the flight in ``file``."""
    from coordinator.plot import PLOT_SUFFIXES, draw_flight
    from coordinator.recording.flown_tracks import flight_of

    if picture.suffix.lower() not in PLOT_SUFFIXES:
        remedy = f"end it in {', '.join(PLOT_SUFFIXES)}"
        raise InputError(Fault("--plot", str(picture), "no such kind of picture is drawn", remedy))
    try:
        draw_flight(flight_of(_read(file)), picture)
    except OSError as error:
        problem = f"cannot be written: {error.strerror or error}"
        raise InputError(Fault("--plot", str(picture), problem, "name a file that can")) from error
    print(f"drawn: {picture}", file=sys.stderr)


def _warn(line: str) -> None:
    print(f"swarm: {line}", file=sys.stderr)


def _play(playback: Playback, port: int, *, json: bool, browser: bool) -> int:
    """Serve the page until told to stop."""
    import asyncio
    import webbrowser
    from json import dumps

    from coordinator.dashboard.access import access_for, listen, url_of
    from coordinator.dashboard.app import Dashboard
    from coordinator.dashboard.server import serving
    from coordinator.recording.player import RecordingPlayer
    from swarm.runtime.clock import SystemClock
    from swarm.runtime.log import LogLevel, configure_logging
    from swarm.runtime.process import run_until_stopped

    configure_logging(LogLevel.WARNING)
    host = "127.0.0.1"
    access, _ = access_for(host, (), None)
    taken = listen(host, port)
    url = url_of(host, taken.getsockname()[1])
    print(dumps({"url": url}) if json else f"replay: {url} (Ctrl-C ends it)", flush=True)
    if browser and not json:
        webbrowser.open(url)

    async def work() -> int:
        player = RecordingPlayer(playback, SystemClock())
        served = Dashboard(player, access)
        async with serving(served.app, taken):
            try:
                await served.beside(player.run())
            finally:
                await served.end("the replay has ended")
        return 0

    status = asyncio.run(run_until_stopped(work()))
    return 0 if status == EXIT_INTERRUPTED else status
