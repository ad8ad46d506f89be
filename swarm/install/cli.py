"""The commands `swarm install agent`, `coordinator`, `router` and `dashboard`."""

from __future__ import annotations

import os
import shlex
import sys
from collections.abc import Sequence
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Annotated

import typer

from swarm.runtime.errors import Fault, InputError

if TYPE_CHECKING:
    from swarm.install.installation import Installation
    from swarm.install.machine import TargetMachine
    from swarm.install.services import ServiceInstance

install = typer.Typer(
    help="Run a process of a fleet as a service of this machine.",
    rich_markup_mode=None,
    no_args_is_help=True,
)

_PASS_ON = {"allow_extra_args": True, "ignore_unknown_options": True}
_UNREACHABLE = ("/home", "/root", "/run/user", "/tmp", "/var/tmp")  # noqa: S108 - named, not used
_OWN_PLACE = "install into a place of its own: python3 -m venv /opt/peckorder, and pip there"

RootOption = Annotated[
    Path | None,
    typer.Option(
        "--root",
        metavar="DIR",
        help="Install into the file system of an image there, not into this machine's.",
        file_okay=False,
        exists=True,
        resolve_path=True,
        show_default=False,
    ),
]
ProgramOption = Annotated[
    str | None,
    typer.Option(
        "--program",
        metavar="PATH",
        help="The swarm that the service runs. Default: this one; with --root "
        "/opt/peckorder/bin/swarm.",
        show_default=False,
    ),
]
DryRunOption = Annotated[
    bool, typer.Option("--dry-run", help="Only print what would be written, secrets left out.")
]


@install.command("agent", context_settings=_PASS_ON)
def agent(
    context: typer.Context,
    uav: Annotated[str, typer.Option("--uav", metavar="ID", help="UAV that this machine flies.")],
    root: RootOption = None,
    program: ProgramOption = None,
    dry_run: DryRunOption = False,
) -> int:
    """Run an agent on this companion computer, always.

    Takes the options of `swarm agent`, checks them as that would, and writes a unit of systemd,
    a file with the options, and copies of the keys that only the service can read; root alone
    may. Installed again without options it keeps those it has, for upgrades. Prints what to do
    next; where systemd does not run, the command line to run by hand.

    Examples:
      swarm install agent --uav uav1 --mission field --mavlink serial:/dev/ttyAMA0:921600
      --keys uav1 --signing-key uav1/mavlink.key --connect tls/192.168.1.2:7447

      swarm install agent --uav uav1
    """
    return _install("agent", ["--uav", uav], context.args, root, program, dry_run, uav)


@install.command("coordinator", context_settings=_PASS_ON)
def coordinator(
    context: typer.Context,
    root: RootOption = None,
    program: ProgramOption = None,
    dry_run: DryRunOption = False,
) -> int:
    """Run the coordinator of a mission on this machine.

    Takes scenario and options of `swarm coordinator`; see `swarm install agent` for what it
    makes of them. Starting the service is the order to take off, so it is not started with the
    machine.

    Examples:
        swarm install coordinator field.toml --keys coordinator --connect tls/127.0.0.1:7447
        swarm install coordinator field.toml --keys coordinator-2 --standby
    """
    return _install("coordinator", [], context.args, root, program, dry_run)


@install.command("router", context_settings=_PASS_ON)
def router(
    context: typer.Context,
    root: RootOption = None,
    program: ProgramOption = None,
    dry_run: DryRunOption = False,
) -> int:
    """Run a router on this machine, always.

    Takes the options of `swarm router`; see `swarm install agent` for what it makes of them.

    Examples:
        swarm install router --keys router --listen tls/0.0.0.0:7447
    """
    return _install("router", [], context.args, root, program, dry_run)


@install.command("dashboard", context_settings=_PASS_ON)
def dashboard(
    context: typer.Context,
    root: RootOption = None,
    program: ProgramOption = None,
    dry_run: DryRunOption = False,
) -> int:
    """Serve a dashboard from this machine, always.

    Takes the options of `swarm dashboard`; see `swarm install agent` for what it makes of them.

    Examples:
        swarm install dashboard --keys dashboard --host 0.0.0.0 --token-file token
    """
    return _install("dashboard", [], context.args, root, program, dry_run)


def _install(
    command: str,
    own: Sequence[str],
    words: Sequence[str],
    root: Path | None,
    program: str | None,
    dry_run: bool,
    uav: str | None = None,
) -> int:
    from swarm.install.installation import plan_installation
    from swarm.install.machine import TargetMachine
    from swarm.install.services import KINDS, ServiceInstance

    service = ServiceInstance(KINDS[command], uav)
    options = [*own, *words] if words else []
    runs = _program(program, root)
    if root is None and not dry_run:
        _check_program(runs)
    plan = plan_installation(service, options, runs, root)
    machine = TargetMachine(root, is_root=os.geteuid() == 0)
    if dry_run:
        _show(plan)
    else:
        for file, outcome in machine.install(plan):
            print(f"{outcome.value:<9} {file.path}")
        for note in plan.notes:
            print(f"note: {note}", file=sys.stderr)
    _tell_what_next(plan, machine, root)
    return 0


def _program(given: str | None, root: Path | None) -> PurePosixPath:
    """The `swarm` that the unit runs."""
    from swarm.install.services import DEFAULT_PROGRAM

    own = Path(sys.executable).parent / "swarm"
    path = PurePosixPath(given or (own if root is None else DEFAULT_PROGRAM))
    if not path.is_absolute() or any(char.isspace() or char in "\"'\\%$" for char in str(path)):
        raise InputError(Fault("--program", str(path), "is no plain absolute path", _OWN_PLACE))
    return path


def _check_program(path: PurePosixPath) -> None:
    """See that a service can run it: homes and temporary folders are out of its sight."""
    if any(PurePosixPath(place) in path.parents for place in _UNREACHABLE):
        problem = "is where services of this machine cannot reach it"
        raise InputError(Fault("--program", str(path), problem, _OWN_PLACE))
    if not os.access(path, os.X_OK):
        raise InputError(Fault("--program", str(path), "no such program", _OWN_PLACE))


def _show(plan: Installation) -> None:
    for file in plan.files:
        print(f"# {file.path}  mode {file.mode:04o}, owner {file.owner or 'root'}")
        print("(secret)" if file.is_secret else file.content.decode("utf-8", "replace"))


def _tell_what_next(plan: Installation, machine: TargetMachine, root: Path | None) -> None:
    service = plan.service
    if lines := _next_commands(service, machine, root):
        print("\nnext:", *lines, sep="\n    ")
    if not machine.runs_systemd:
        where = "where systemd does not run" if root is not None else "systemd does not run here"
        print(f"\n{where}; by hand:")
        by_hand = ["sudo", "-u", service.kind.user, *plan.command_line]
        print(f"    {shlex.join(by_hand)}")


def _next_commands(
    service: ServiceInstance, machine: TargetMachine, root: Path | None
) -> list[str]:
    boot = service.kind.starts_at_boot
    if root is not None:
        return [f"systemctl --root={root} enable {service.unit}"] if boot else []
    if not machine.runs_systemd:
        return []
    lines = ["systemctl daemon-reload"]
    if boot:
        lines.append(f"systemctl enable --now --no-block {service.unit}")
        lines.append(f"systemctl restart {service.unit}    # had it run before; not in flight")
    else:
        lines.append(f"systemctl start {service.unit}    # the order to take off")
    return [*lines, f"systemctl status {service.unit}"]
