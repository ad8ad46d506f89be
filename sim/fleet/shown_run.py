"""Fly one run in front of a person: its picture, log lines, recording and report."""

from __future__ import annotations

import asyncio
import contextlib
import json
import re
import sys
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Self, TextIO

from rich.console import Console

from coordinator.core.heights import height_warnings
from coordinator.terminal.live_view import LiveView
from sim.fleet.layout import LaunchOptions, flight_layers
from sim.fleet.run import fly
from sim.fleet.security import security_of
from sim.options import print_report
from swarm.model import Mission
from swarm.protocol.timing import Timing
from swarm.runtime.errors import Fault, InputError

if TYPE_CHECKING:
    from coordinator.recording.flight_recorder import FlightRecorder


@dataclass(frozen=True, slots=True)
class Outputs:
    """Where what is told goes."""

    json: bool
    """The report as one JSON object."""
    report: Path | None
    """A file for the report, too."""
    record: Path | None
    """A new recording."""
    logs: Path | None
    """A folder for what every process logs."""
    verbose: bool
    """What every process logs goes to standard error."""


class ShownRun:
    """One run on this machine, and the screen; timers are in mission seconds."""

    def __init__(
        self, mission: Mission, scenario: Path, speedup: float, timing: Timing, outputs: Outputs
    ) -> None:
        self._mission = mission
        self._scenario = scenario
        self._timing = timing
        self._speedup = speedup
        self._outputs = outputs
        # With every process's log on the screen, a picture would only be torn apart.
        self._console = Console(stderr=True, force_terminal=False if outputs.verbose else None)
        self._kept = None if outputs.logs is None else LogFiles(outputs.logs, self._console.print)

    def warn(self, options: LaunchOptions) -> None:
        """Say what a person should know before the start."""
        for line in () if options.dashboard is None else options.dashboard.lines:
            self._say(line)
        layers = flight_layers(self._mission, options)
        for warning in height_warnings(self._mission, layers):
            self._say(f"warning: {warning}")

    async def fly(self, options: LaunchOptions) -> int:
        """Fly it to its end; the exit status."""
        outputs = self._outputs
        try:
            with (
                self._kept or contextlib.nullcontext(),
                self._recording() as recorder,
                LiveView(
                    self._console, speedup=self._speedup, secure=options.keys is not None
                ) as view,
            ):
                flight = await fly(
                    self._mission,
                    options,
                    on_frame=view.update,
                    on_log=self._log if outputs.verbose or self._kept else None,
                    recorder=recorder,
                    on_private=lambda fault: self._say(f"commands do not find this run: {fault}"),
                )
        except asyncio.CancelledError:
            self._console.print("interrupted: the mission was given up and every process ended")
            raise
        told = flight.report(self._speedup, security_of(options, self._mission, flight.dropped))
        status = print_report(told, json=outputs.json, report=outputs.report)
        return status or int(recorder is not None and recorder.fault is not None)

    def _recording(self) -> AbstractContextManager[FlightRecorder | None]:
        """What records the flight; nothing, nor anything imported, where it is not asked for."""
        if self._outputs.record is None:
            return contextlib.nullcontext()
        from coordinator.recording.flight_recorder import recording_to, wall_ns
        from coordinator.recording.recorder import RecordingInfo

        info = RecordingInfo(self._mission.name, self._timing, self._speedup, str(self._scenario))
        return recording_to(self._outputs.record, info, wall_ns(), self._say)

    def _log(self, name: str, line: str) -> None:
        if self._kept is not None:
            self._kept.write(name, line)
        if self._outputs.verbose:
            sys.stderr.write(f"{name}: {line}\n")

    def _say(self, line: str) -> None:
        self._console.print(line, highlight=False, markup=False, soft_wrap=True)


class LogFiles:
    """The files of one run, in a folder that is made if need be; use it as a context manager.

    What was there before stays, and lines are added to it. A disk that is full costs the logs and
    not the flight: ``complain`` is told once.

    Raises:
        InputError: no file can be written there.
    """

    def __init__(self, folder: Path, complain: Callable[[str], object]) -> None:
        self._folder = folder
        self._complain = complain
        self._files: dict[str, TextIO] = {}
        self._failed = False
        try:
            folder.mkdir(parents=True, exist_ok=True)
            with (folder / ".probe").open("w"):
                pass
            (folder / ".probe").unlink()
        except OSError as fault:
            problem = f"nothing can be written there: {fault.strerror or fault}"
            raise InputError(Fault("--logs", str(folder), problem, "name a folder")) from fault

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        for file in self._files.values():
            try:
                file.close()
            except OSError as fault:
                self._fail(fault)
        self._files.clear()

    def write(self, name: str, line: str) -> None:
        """Keep a line of the process of that name; one that is no JSON object becomes one."""
        if self._failed:
            return
        try:
            file = self._files.get(name)
            if file is None:
                path = self._folder / f"{re.sub(r'[^A-Za-z0-9_.-]+', '-', name)[:100]}.jsonl"
                # Each line is there at once: whoever reads along, or after a crash, has it.
                file = self._files[name] = path.open("a", encoding="utf-8", buffering=1)
            file.write(_as_object(name, line) + "\n")
        except OSError as fault:
            self._fail(fault)

    def _fail(self, fault: OSError) -> None:
        if not self._failed:
            self._failed = True
            self._complain(f"logs are kept no longer: {fault.strerror or fault}")


def _as_object(name: str, line: str) -> str:
    """The line itself, or what a foreign program or a traceback says, as a JSON object."""
    try:
        if isinstance(json.loads(line), dict):
            return line
    except ValueError:
        pass
    return json.dumps({"module": name, "event": line, "level": "info"})
