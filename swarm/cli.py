"""The `swarm` command: finds its subcommands by entry point and runs one.

A subcommand is an entry point of the group ``peckorder.commands``: a plain
function written for typer (annotated parameters, result an exit status or
None), or a ``typer.Typer`` for a family such as ``swarm task add``. Only the
one asked for is imported; ``--help`` imports all. Its docstring becomes its
help (swarm.runtime.console).

Exit status: 0 done; 1 the mission or check failed, or an error at run time;
2 wrong usage or input, one line each on standard error; 130 interrupted. An
unexpected exception leaves `main` as it is, so that the interpreter ends with
its traceback and 1.
"""

from __future__ import annotations

import errno
import inspect
import os
import re
import sys
from collections.abc import Iterable, Mapping, Sequence
from importlib.metadata import EntryPoint, entry_points
from typing import Annotated, Any

import typer.main

import swarm
from swarm.runtime import garbage
from swarm.runtime.console import Panels, explain_family, help_text, say
from swarm.runtime.errors import EXIT_INTERRUPTED, Fault, InputError, SwarmError
from swarm.runtime.extras import missing_extra

COMMAND_GROUP = "peckorder.commands"
_CHECK = "--check"
_COMPLETE = "_SWARM_COMPLETE"
"""Environment variable by which shells, and the library, ask for completions."""
_DONE, _FAILED, _WRONG_USAGE = 0, 1, 2
_CHOICE = re.compile(r"'([^']*)' is not one of (.+)")
_HELP = """Task allocation for fleets of UAVs: plan, simulate and fly.

Examples:
    swarm plan table-1
    swarm run table-1 --speedup 10
    swarm plan --help
"""


def main(
    argv: Sequence[str] | None = None, commands: Mapping[str, EntryPoint] | None = None
) -> int:
    """Run one command line and say how it ended, by its exit status.

    ``argv`` is what follows ``swarm``, on this process's command line if None; ``commands`` are the
    installed ones if None.
    """
    arguments = list(sys.argv[1:] if argv is None else argv)
    found = _installed_commands() if commands is None else commands
    stdout = sys.stdout
    try:
        status = _run_or_explain(arguments, found)
        if status == _DONE and _CHECK in arguments and not {"--help", "-h"} & {*arguments}:
            say("these options are right")
    except InputError as error:
        _complain(str(error))
        status = _WRONG_USAGE
    except SwarmError as error:
        _complain(f"swarm: {error}")
        status = _FAILED
    except (KeyboardInterrupt, typer.Abort):
        status = EXIT_INTERRUPTED
    except BrokenPipeError:
        status = _FAILED
    except OSError as error:
        if error.errno not in (errno.ENOSPC, errno.EDQUOT):
            raise
        _complain(f"swarm: output cannot be written: {error.strerror}")
        status = _FAILED
    finally:
        sys.stdout = stdout  # typer swaps it when a pipe breaks
    return status


def check(arguments: Sequence[str]) -> Mapping[str, Any]:
    """See whether a command line is right, by the very command it is for; nothing is begun.

    ``arguments`` are those after ``swarm``, of a command that has ``--check``. Gives what every
    parameter of the command comes to, defaults included.

    Raises:
        InputError: something is wrong with it.
    """
    name, *words = arguments
    commands = _installed_commands()
    app = typer.Typer(rich_markup_mode=None)
    app.command(name)(commands[name].load())
    command: Any = typer.main.get_command(app)
    try:
        parameters = dict(command.make_context(f"swarm {name}", list(words)).params)
    except typer.TyperException as error:
        raise InputError(_usage_fault(error, name)) from error
    _run([name, *words, _CHECK], commands)
    return parameters


def console_main() -> int:
    """Entry point of the console script; says so when its output could not be written."""
    garbage.begin_start()
    # It has none here, and would look for them in every distribution that is installed.
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
    status = main()
    try:
        if sys.stdout is not None:  # None when the caller has closed it
            sys.stdout.flush()
    except OSError as error:
        if not isinstance(error, BrokenPipeError):  # a reader that has seen enough is no mishap
            _complain(f"swarm: output cannot be written: {error.strerror}")
        # What is still buffered can reach nobody; the interpreter must not try again at its end.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        status = _FAILED
    daemon = sys.modules.get("swarm.runtime.process")
    if daemon is not None:  # loaded by commands that use the bus: one may hang at the exit
        daemon.leave(status)
    return status


def _installed_commands() -> dict[str, EntryPoint]:
    found = entry_points(group=COMMAND_GROUP)
    return {entry.name: entry for entry in sorted(found, key=lambda entry: entry.name)}


def _run_or_explain(arguments: list[str], commands: Mapping[str, EntryPoint]) -> int:
    """Run it; a package that is not installed is told by the extra that brings it."""
    try:
        return _run(arguments, commands)
    except ModuleNotFoundError as error:
        words = [word for word in arguments if not word.startswith("-")][:1]
        if (lacking := missing_extra(error, " ".join(["swarm", *words]))) is None:
            raise
        raise lacking from error


def _run(arguments: list[str], commands: Mapping[str, EntryPoint]) -> int:
    if len(arguments) == 2 and arguments[0] == "--show-completion":
        # The library knows the shell it runs in, and takes no name of another one.
        os.environ[_COMPLETE] = f"source_{arguments.pop()}"
    completing = _COMPLETE in os.environ
    name = next((word for word in arguments if not word.startswith("-")), None)
    if name is not None and name not in commands:
        raise InputError(_unknown_command(name, commands))
    if completing:
        name = next((word for word in _typed() if word in commands), None)
    app = _application()
    if name is not None:
        _register(app, name, commands[name].load())
    else:
        for other, entry in commands.items():
            _register(app, other, _load_or_explain(entry))
    command = typer.main.get_command(app)
    try:
        result = command.main(arguments or ["--help"], prog_name="swarm", standalone_mode=False)
    except typer.TyperException as error:
        raise InputError(_usage_fault(error, name)) from error
    except SystemExit as leaving:
        result = leaving.code
    if not arguments and not completing:
        raise InputError(Fault("swarm", "", "no command given", "choose one of the above"))
    if result is None:
        return _DONE
    if not isinstance(result, int):
        raise TypeError(f"command {name} must return an exit status or None, not {result!r}")
    return int(result)


def _typed() -> list[str]:
    """Words behind ``swarm`` on the line that a shell wants completed."""
    environment = os.environ
    line = environment.get("_TYPER_COMPLETE_ARGS") or environment.get("COMP_WORDS") or ""
    return line.split()[1:]


def _application() -> typer.Typer:
    app = typer.Typer(
        name="swarm",
        cls=Panels,
        rich_markup_mode=None,
        context_settings={"help_option_names": ["-h", "--help"]},
    )
    app.callback(help=help_text(_HELP))(_root)
    return app


def _print_version(wanted: bool) -> None:
    if wanted:
        print(f"swarm {swarm.__version__}")
        raise typer.Exit


def _root(
    version: Annotated[
        bool,
        typer.Option("--version", is_eager=True, callback=_print_version, help="Show the version."),
    ] = False,
) -> None:
    """Options before the subcommand."""


def _register(app: typer.Typer, name: str, loaded: object) -> None:
    if isinstance(loaded, typer.Typer):
        explain_family(loaded)
        app.add_typer(loaded, name=name)
    elif callable(loaded):
        text = help_text(inspect.getdoc(loaded) or "")
        app.command(name, help=text, short_help=text.partition("\n")[0])(loaded)
    else:
        raise TypeError(f"command {name} must be a function or a typer.Typer, not {loaded!r}")


def _load_or_explain(entry: EntryPoint) -> object:
    """The command, or one whose help says why there is none: `swarm --help` always works."""
    try:
        return entry.load()
    except (ImportError, AttributeError) as error:
        lacking = (
            missing_extra(error, f"swarm {entry.name}") if isinstance(error, ImportError) else None
        )
        reason = str(error if lacking is None else lacking)

    def unavailable() -> None:
        raise SwarmError(f"command {entry.name} cannot be loaded: {reason}")

    unavailable.__doc__ = f"Cannot be loaded: {reason}."
    return unavailable


def _alike(word: str, known: Iterable[str]) -> list[str]:
    """The known word that was meant, perhaps; none or one."""
    from difflib import get_close_matches

    return get_close_matches(word, list(known), n=1)


def _unknown_command(name: str, commands: Mapping[str, object]) -> Fault:
    close = _alike(name, commands)
    remedy = f"did you mean {close[0]!r}?" if close else f"the commands are {', '.join(commands)}"
    return Fault("swarm", "", f"no such command {name!r}", remedy)


def _usage_fault(error: typer.TyperException, name: str | None) -> Fault:
    context: Any = getattr(error, "ctx", None)
    path = f"swarm {name}" if name else "swarm"
    if context is not None:
        path = context.command_path  # also names the member of a family: swarm task add
    see = f"see '{path} --help'"
    if type(error).__name__ == "NoArgsIsHelpError":  # its message is the whole help
        return Fault(path, "", "missing command", see)
    problem = " ".join(error.format_message().split()).rstrip(".").replace("Value error, ", "")
    # The words of the library; where it guesses what was meant, that is the remedy.
    problem, _, close = problem.partition(" (Possible options: ")
    if not close:
        problem, _, close = problem.removesuffix("?").partition(". Did you mean ")
    if not close and (choice := _CHOICE.search(problem)) is not None:
        close = ", ".join(map(repr, _alike(choice[1], choice[2].split("'")[1::2])))
    remedy = f"did you mean {close.rstrip(')')}? {see[:1].upper()}{see[1:]}" if close else see
    return Fault(path, "", problem[:1].lower() + problem[1:], remedy)


def _complain(text: str) -> None:
    print(text, file=sys.stderr)
