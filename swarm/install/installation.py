"""What a service needs on a machine: its files, and the command line it is started by.

The options are kept in a file that systemd reads.
"""

from __future__ import annotations

import re
import secrets
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any, Final

from swarm.bus.config import is_loopback
from swarm.cli import check
from swarm.identity import load_identity
from swarm.identity.folder import KEY_FILES, ROSTER_FILE
from swarm.identity.roster import decode_roster
from swarm.install.services import (
    DEFAULT_PROGRAM,
    FOLDER,
    STATE,
    SYSUSERS_FILE,
    UNITS,
    ServiceInstance,
    placed,
)
from swarm.runtime.errors import Fault, InputError
from swarm.scenario.files import resolve_scenario, shipped_scenarios

VARIABLE: Final = "SWARM_OPTIONS"
_LINE = re.compile(rf"^{VARIABLE}=((?:.*\\\n)*.*)$", re.MULTILINE)
_ESCAPED = re.compile(r'([\\"`$])')
_UNESCAPED = re.compile(r'\\([\\"`$])')


def option_value(words: Sequence[str], option: str) -> str | None:
    """What ``option`` is given on a command line; None if it is not."""
    for i, word in enumerate(words):
        if word == option:
            return words[i + 1] if i + 1 < len(words) else None
        if word.startswith(f"{option}="):
            return word.partition("=")[2]
    return None


def replaced(words: Sequence[str], option: str, value: str) -> list[str]:
    """The command line with another value of ``option``, which is added if it is not there."""
    kept: list[str] = []
    left = iter(words)
    for word in left:
        if word == option:
            next(left, None)
        elif not word.startswith(f"{option}="):
            kept.append(word)
    return [*kept, option, value]


def with_words(text: str, words: Sequence[str]) -> str:
    """An environment file with other options; all else that is in it stays.

    Raises:
        ValueError: a word cannot be written there.
    """
    for word in words:
        if not word.isprintable():
            raise ValueError(f"{word!r} has a sign that no option needs")
    value = _ESCAPED.sub(r"\\\1", shlex.join(words))
    line = f'{VARIABLE}="{value}"'
    if _LINE.search(text) is not None:
        return _LINE.sub(lambda _: line, text, count=1)
    return f"{text}{line}\n"


def kept_words(text: str) -> list[str]:
    """The options in an environment file.

    Raises:
        ValueError: there are none, or a quote is not closed.
    """
    found = _LINE.search(text)
    if found is None:
        raise ValueError(f"there is no {VARIABLE}")
    value = found[1].replace("\\\n", " ").strip()
    if len(value) > 1 and value[0] == value[-1] == "'":
        value = value[1:-1]
    elif len(value) > 1 and value[0] == value[-1] == '"':
        value = _UNESCAPED.sub(r"\1", value[1:-1])
    return shlex.split(value)


_OPEN, _PRIVATE = 0o644, 0o600
_LOWEST_PORT = 1024
_SERIAL_CLASSES: Final = ("ttyACM", "ttyUSB", "ttyAMA", "ttyS")
_LONGEST_BYTES = 1 << 20


@dataclass(frozen=True, slots=True)
class File:
    """One file to be there."""

    path: PurePosixPath
    content: bytes
    mode: int = _OPEN
    owner: str | None = None
    """Of the file and of its folder; root if None."""

    @property
    def is_secret(self) -> bool:
        """Whether nobody may see what is in it."""
        return self.mode == _PRIVATE


@dataclass(frozen=True, slots=True)
class Installation:
    """All that one service needs."""

    service: ServiceInstance
    program: PurePosixPath
    words: tuple[str, ...]
    """Options and arguments of its process, files named where they will be."""
    files: tuple[File, ...]
    notes: tuple[str, ...]
    """What whoever installs it should know."""

    @property
    def command_line(self) -> tuple[str, ...]:
        """What the unit runs."""
        return (str(self.program), self.service.kind.command, *self.words)


def plan_installation(
    service: ServiceInstance, words: Sequence[str], program: PurePosixPath, root: Path | None
) -> Installation:
    """What to put on the machine for ``service``, once every input is checked.

    Args:
        service: which one.
        words: options of its process, files named where they are now; those of an earlier
            installation if there are none.
        program: the `swarm` that the unit runs.
        root: the machine's file system, if that is not this one's.

    Raises:
        InputError: something is wrong with an option, or with a file that one names.
    """
    options = placed(root, service.options_path)
    before = options.read_text("utf-8") if options.is_file() else None
    files: list[File] = []
    notes: list[str] = []
    if words:
        parameters = _checked(service, words, root)
        final = _place_files(service, list(words), parameters, files, root)
    else:
        final = _words_before(service, options, before)
        parameters = _checked(service, _within(root, final), root)
    if any(file.path.name == "token" for file in files):
        notes.append(f"browsers are asked for the token in {service.state_folder / 'token'}")
    if parameters.get("keys") is None:
        notes.append("without keys it talks to this machine alone, unless told --unencrypted")
    text = before if before is not None else _heading(service)
    try:
        text = with_words(text, final)
    except ValueError as fault:
        raise _fault(service, str(fault), "leave it out") from None
    unit = (UNITS / service.kind.unit_file).read_text("utf-8")
    units = [
        File(SYSUSERS_FILE, (UNITS / "peckorder.sysusers").read_bytes()),
        File(service.unit_path, unit.replace(str(DEFAULT_PROGRAM), str(program)).encode()),
        File(service.options_path, text.encode()),
    ]
    port = _serial_port(parameters)
    if port is not None:
        units.append(File(service.drop_in_path, _serial_drop_in(port, root).encode()))
    return Installation(service, program, tuple(final), (*units, *files), tuple(notes))


def _checked(
    service: ServiceInstance, words: Sequence[str], root: Path | None
) -> Mapping[str, Any]:
    """What the process's own command makes of ``words``."""
    parameters = check([service.kind.command, *words])
    state, wanted = parameters.get("state"), service.state_folder
    if state is not None and Path(state) != placed(root, wanted):
        raise _fault(service, f"--state {state} is not a place it can write to", "leave it out")
    port = parameters.get("port")
    if port is not None and 0 < port < _LOWEST_PORT:
        problem = f"--port {port} is for root alone, and it runs as {service.kind.user}"
        raise _fault(service, problem, f"give one from {_LOWEST_PORT} on")
    device = _serial_port(parameters)
    if device is not None:
        _check_serial(device, root)
    return parameters


def _words_before(service: ServiceInstance, path: Path, text: str | None) -> list[str]:
    """The options of an earlier installation."""
    command = f"swarm {service.kind.command}"
    if text is None:
        if service.kind.command in ("router", "dashboard"):
            return []
        remedy = f"give its options, as '{command} --help' has them"
        raise _fault(service, f"there is none yet, at {path}", remedy)
    try:
        return kept_words(text)
    except ValueError as fault:
        remedy = f'write one line {VARIABLE}="…", or give the options anew'
        raise InputError(Fault(str(path), "", str(fault), remedy)) from None


def _place_files(
    service: ServiceInstance,
    words: list[str],
    parameters: Mapping[str, Any],
    files: list[File],
    root: Path | None,
) -> list[str]:
    """The words with every file named where the service will find it; adds those to ``files``."""
    kind = service.kind
    keys = parameters.get("keys")
    signing_key = parameters.get("signing_key")
    if keys is not None:
        files += _key_files(service, Path(keys), root)
        words = replaced(words, "--keys", str(service.keys_folder))
    for option, name in kind.secrets.items():
        given = option_value(words, option)
        if given is None:
            continue
        if keys is not None and signing_key is not None and _same(signing_key, keys, name):
            words = replaced(words, option, str(service.keys_folder / name))
            continue
        target = service.state_folder / name
        files.append(File(target, _read(Path(given), option), _PRIVATE, kind.user))
        words = replaced(words, option, str(target))
    if kind.command == "dashboard":
        words = _place_token(service, words, str(parameters["host"]), files, root)
    for option, suffix in kind.settings.items():
        given = option_value(words, option)
        if given is not None and given not in ("mesh", "router"):
            target = FOLDER / f"{service.name}{suffix}"
            files.append(File(target, _read(Path(given), option)))
            words = replaced(words, option, str(target))
    if "scenario" in parameters:
        words = _place_scenario(service, words, Path(parameters["scenario"]), files)
    if kind.has_state:
        words = replaced(words, "--state", str(service.state_folder))
    return words


def _place_token(
    service: ServiceInstance, words: list[str], host: str, files: list[File], root: Path | None
) -> list[str]:
    """A token for who comes from elsewhere, unless one was given: none gets into the journal."""
    target = service.state_folder / "token"
    if option_value(words, "--token-file") is not None or is_loopback(f"tcp/{host}:1"):
        return words
    there = placed(root, target)
    kept = there.is_file() and not there.is_symlink()  # which would be another's secret
    token = there.read_bytes() if kept else f"{secrets.token_urlsafe(24)}\n".encode()
    files.append(File(target, token, _PRIVATE, service.kind.user))
    return replaced(words, "--token-file", str(target))


def _same(signing_key: Any, keys: Any, name: str) -> bool:
    return Path(signing_key).resolve() == (Path(keys) / name).resolve()


def _place_scenario(
    service: ServiceInstance, words: list[str], scenario: Path, files: list[File]
) -> list[str]:
    if scenario in shipped_scenarios().values():
        return words
    target = FOLDER / f"{service.name}.toml"
    files.append(File(target, _read(scenario, "SCENARIO")))
    for i, word in enumerate(words):
        if not word.startswith("-") and _names(word, scenario):
            return [*words[:i], str(target), *words[i + 1 :]]
    raise _fault(service, f"{scenario} is not among its options", "give it as it is")


def _names(word: str, scenario: Path) -> bool:
    try:
        return resolve_scenario(word) == scenario
    except InputError:
        return False


def _key_files(service: ServiceInstance, folder: Path, root: Path | None) -> list[File]:
    """Copies of the keys in ``folder``; a newer roster on the machine stays."""
    identity = load_identity(folder)
    user = service.kind.user
    data = {name: _read(folder / name, "--keys") for name in KEY_FILES if (folder / name).exists()}
    there = placed(root, service.keys_folder / ROSTER_FILE)
    try:
        kept = there.read_bytes()
        roster = decode_roster(kept, identity.authority_public_key)
    except (OSError, ValueError):
        kept = b""  # none, or another authority's: its keys are replaced
    else:
        if roster.supersedes(identity.roster):
            entry = roster.entry(identity.name)
            if entry is None or entry.generation != identity.generation:
                problem = f"{identity.common_name} was revoked or replaced, as this machine knows"
                remedy = f"give the newest folder of {identity.name!r}"
                raise InputError(Fault(str(folder), "", problem, remedy))
            data[ROSTER_FILE] = kept
    return [
        File(service.keys_folder / name, content, _PRIVATE, user) for name, content in data.items()
    ]


def _serial_port(parameters: Mapping[str, Any]) -> PurePosixPath | None:
    """Device of its autopilot's link ``serial:DEVICE:BAUD``; None of another one."""
    for link in parameters.get("mavlink") or ():
        if link.startswith("serial:"):
            return PurePosixPath(link.removeprefix("serial:").rpartition(":")[0])
    return None


def _check_serial(device: PurePosixPath, root: Path | None) -> None:
    place = f"serial:{device}"
    if PurePosixPath("/dev") not in device.parents:
        raise InputError(Fault("--mavlink", place, "no device", "name one below /dev"))
    if root is None and not Path(device).exists():
        found = sorted(str(path) for path in Path("/dev").glob("tty[AU][CSM][MBA][0-9]*"))
        there = f"name one of {', '.join(found)}" if found else "none is there now"
        remedy = f"connect the autopilot, or set the port up; {there}"
        raise InputError(Fault("--mavlink", place, "no such device on this machine", remedy))


def _serial_drop_in(device: PurePosixPath, root: Path | None) -> str:
    """Leave to the unit the one kind of serial port that its autopilot is at, and no other."""
    real = Path(device).resolve().name if root is None else device.name
    fitting = [kind for kind in _SERIAL_CLASSES if real.removeprefix(kind).isdigit()]
    allowed = "\n".join(f"DeviceAllow=char-{kind} rw" for kind in fitting or _SERIAL_CLASSES)
    return (
        f"# Its autopilot is at {device}: written by `swarm install agent`, which replaces it.\n"
        "# The kind of port rather than the port: a plug that is pulled out and put in again may\n"
        "# come back under another number.\n"
        "[Service]\n"
        "PrivateDevices=no\n"
        "DevicePolicy=closed\n"
        f"{allowed}\n"
        "SupplementaryGroups=dialout\n"
    )


def _heading(service: ServiceInstance) -> str:
    command = f"swarm {service.kind.command}"
    return (
        f"# Options of `{command}`, with which {service.unit} runs it;\n"
        f"# `{command} --help` explains them. To change one, edit it here and restart the unit,\n"
        "# or install it anew with all options. Other settings that the process takes from its\n"
        "# environment, such as SWARM_LOG_LEVEL=debug, are lines of their own, and stay.\n"
    )


def _within(root: Path | None, words: Sequence[str]) -> list[str]:
    """Words for the machine as they are for this process, which may see it below ``root``."""
    if root is None:
        return list(words)
    own = (f"{FOLDER}/", f"{STATE}/")
    return [
        str(placed(root, PurePosixPath(each))) if each.startswith(own) else each for each in words
    ]


def _read(path: Path, option: str) -> bytes:
    try:
        data = path.read_bytes()
    except OSError as error:
        problem = f"cannot be read ({error.strerror or error})"
        raise InputError(Fault(str(path), "", problem, f"give {option} another file")) from error
    if len(data) > _LONGEST_BYTES:
        raise InputError(Fault(str(path), "", "is too large", f"give {option} another file"))
    return data


def _fault(service: ServiceInstance, problem: str, remedy: str) -> InputError:
    return InputError(Fault(f"swarm install {service.kind.command}", "", problem, remedy))
