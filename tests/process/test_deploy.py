"""The files of deploy/: Zenoh's open and say what the runtime does by itself, containers' parse.

No container is built here: their files are read, and every command in them is tried on the
command line's own parser. Booting the units: deploy/checks/units.sh.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import re
import shlex
import shutil
import socket
import subprocess
import sys
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest
import typer.main
import yaml
import zenoh

from swarm import cli
from swarm.bus.config import BusConfig, FileTopology
from swarm.bus.port import TokenSeen
from swarm.bus.zenoh_bus import open_zenoh_bus
from swarm.bus.zenoh_session import session_config
from swarm.identity import load_identity
from swarm.protocol.timing import PRESETS, LinkKind
from tests.process.router_processes import router

pytestmark = pytest.mark.process

DEPLOY = Path(__file__).parents[2] / "deploy"
MAKEFILE = (DEPLOY.parent / "Makefile").read_text()
ZENOH = DEPLOY / "zenoh"
SETTINGS = (
    "connect/retry",
    "scouting/delay",
    "scouting/multicast/enabled",
    "scouting/gossip/enabled",
    "transport/shared_memory/enabled",
    "transport/link/tx/lease",
    "transport/link/tx/keep_alive",
    "transport/link/tx/queue/congestion_control/block/wait_before_close",
    "transport/link/rx/max_message_size",
    "transport/unicast/open_timeout",
    "transport/unicast/accept_timeout",
)
PATIENT_BY_RADIO = {
    "transport/link/tx/queue/congestion_control/block/wait_before_close",
    "transport/unicast/open_timeout",
    "transport/unicast/accept_timeout",
}
FILES = sorted(ZENOH.rglob("*.json5"))
LIMIT_S = 30.0


@pytest.fixture(scope="module")
def keys(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Of the fleet of the compose file."""
    folder = tmp_path_factory.mktemp("authority") / "keys"
    assert cli.main(["keys", "init", "meadow", "--out", str(folder), "--routers", "2"]) == 0
    return folder


# -- Zenoh ------------------------------------------------------------------------------


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(ZENOH)))
def test_file_says_what_the_runtime_does_by_itself(path: Path) -> None:
    file = zenoh.Config.from_file(path)
    mode = "router" if path.stem.startswith("router") else "client"
    radio = path.parent.name == "radio"
    lease_s = PRESETS[LinkKind.BAD if radio else LinkKind.NORMAL].lease_s
    own = session_config(mode, listen=[], connect=[], lease_s=lease_s)

    assert json.loads(file.get_json("mode")) == mode
    for setting in SETTINGS:
        if radio and setting in PATIENT_BY_RADIO:
            assert int(file.get_json(setting)) > int(own.get_json(setting)), setting
        else:
            assert file.get_json(setting) == own.get_json(setting), setting


def with_routers(file: Path, folder: Path, endpoints: list[str]) -> Path:
    """A copy of a client's file that calls the routers of the test instead."""
    text, changed = re.subn(
        r'endpoints: \["tls/192[^]]*\]', f"endpoints: {json.dumps(endpoints)}", file.read_text()
    )
    assert changed == 1
    copy = folder / f"{file.parent.name}-{file.name}"
    copy.write_text(text)
    return copy


@pytest.mark.parametrize("kind", [".", "two-routers", "radio"])
def test_two_uavs_with_keys_meet_at_routers_of_the_shipped_files(
    kind: str, tmp_path: Path, keys: Path
) -> None:
    with contextlib.ExitStack() as routers:

        def start(name: str, file: Path) -> str:
            words = ("--keys", str(keys / name), "--config", str(file))
            _, endpoint = routers.enter_context(router(*words, "--listen", "tls/127.0.0.1:0"))
            return endpoint

        if kind == "two-routers":
            first = start("router", ZENOH / kind / "router-a.json5")
            file = with_routers(ZENOH / kind / "router-b.json5", tmp_path, [first])
            ends = [first, start("router-2", file)]
        else:
            ends = [start("router", ZENOH / kind / "router.json5")] * 2
        asyncio.run(
            meet(
                keys,
                [
                    with_routers(ZENOH / kind / "client.json5", tmp_path / each, [end])
                    for each, end in zip(folders(tmp_path), ends, strict=True)
                ],
            )
        )


def folders(path: Path) -> Iterator[str]:
    for name in ("uav1", "uav2"):
        (path / name).mkdir()
        yield name


async def meet(keys: Path, files: list[Path]) -> None:
    """One shows its token, and the other sees it."""
    async with asyncio.timeout(LIMIT_S):
        buses = [
            await open_zenoh_bus(
                BusConfig(FileTopology(file), identity=load_identity(keys / f"uav{i + 1}"))
            )
            for i, file in enumerate(files)
        ]
        try:
            buses[0].declare_token("swarm/meadow/alive/uav1")
            buses[1].watch_tokens("swarm/meadow/alive/*")
            while True:
                await buses[1].inbox.wait()
                if TokenSeen("swarm/meadow/alive/uav1") in buses[1].inbox.take():
                    return
        finally:
            for bus in buses:
                bus.close()


# -- containers ---------------------------------------------------------------------------


def parsed(words: list[str]) -> Mapping[str, Any]:
    """What a command line comes to, by the command's own parser."""
    root: Any = cli._application()
    name, *rest = words
    cli._register(root, name, cli._installed_commands()[name].load())
    group: Any = typer.main.get_command(root)
    command = group.commands[name]
    while hasattr(command, "commands"):
        name, *rest = rest
        command = command.commands[name]
    return dict(command.make_context(f"swarm {name}", list(rest)).params)


@pytest.fixture(scope="module")
def compose() -> dict[str, Any]:
    loaded = yaml.safe_load((DEPLOY / "compose.yaml").read_text())
    assert isinstance(loaded, dict)
    return loaded


def test_every_service_of_the_fleet_is_a_command_line_that_its_command_accepts(
    compose: dict[str, Any], keys: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    token = compose["services"]["dashboard"]["environment"]["SWARM_DASHBOARD_TOKEN"]
    monkeypatch.setenv("SWARM_DASHBOARD_TOKEN", token.partition(":-")[2].rstrip("}"))
    services = dict(compose["services"])
    del services["keys"]
    for name, service in services.items():
        mounted = {volume.split(":")[1]: volume.split(":")[0] for volume in service["volumes"]}
        own = keys / mounted["/keys"].removeprefix("keys-")
        words = [str(own) + word[5:] if word.startswith("/keys") else word
                 for word in service["command"]]  # fmt: skip
        if words[0] == "autopilot":
            assert parsed(words)["uav"] == [name.removeprefix("autopilot-")]
        else:
            cli.check(words)  # opens the keys, too
        assert service["image"] == compose["services"]["keys"]["image"]
        assert service["read_only"] is True
        assert service["cap_drop"] == ["ALL"]
        assert {volume.split(":")[0] for volume in service["volumes"]} <= set(compose["volumes"])


def test_every_uav_of_the_mission_has_agent_and_autopilot(compose: dict[str, Any]) -> None:
    uavs = {f"uav{n}" for n in (1, 2, 3)}
    services = compose["services"]

    assert uavs | {f"autopilot-{uav}" for uav in uavs} <= set(services)
    for uav in uavs:
        link = services[uav]["command"]
        assert link[link.index("--mavlink") + 1] == f"tcp:autopilot-{uav}:5760"
        for service in (uav, f"autopilot-{uav}"):
            assert services[service]["volumes"][0].startswith(f"keys-{uav}:/keys")


def test_keys_are_made_by_a_command_line_that_is_accepted_for_all_who_use_them(
    compose: dict[str, Any],
) -> None:
    service = compose["services"]["keys"]
    (script,) = service["command"]
    (made,) = re.findall(r"swarm (keys init .*)", script)
    names = shlex.split(re.findall(r"for name in (.*); do", script)[0])

    assert str(parsed(shlex.split(made))["scenario"]).endswith("meadow.toml")
    assert {f"keys-{name}:/keys/{name}" for name in names} < set(service["volumes"])
    shell = shutil.which("sh")
    assert shell is not None
    checked = subprocess.run([shell, "-n", "-c", script.replace("$$", "$")], check=False)
    assert checked.returncode == 0


def test_order_of_the_fleet_waits_for_keys_and_router(compose: dict[str, Any]) -> None:
    services = compose["services"]
    for name, service in services.items():
        after = service.get("depends_on", {})
        assert set(after) <= set(services)
        if name != "keys":
            assert after["keys"]["condition"] == "service_completed_successfully"
        for other, on in after.items():
            if on["condition"] == "service_healthy":
                assert "healthcheck" in services[other]


@pytest.fixture(scope="module")
def machine() -> dict[str, Any]:
    loaded = yaml.safe_load((DEPLOY / "compose.machine.yaml").read_text())
    assert isinstance(loaded, dict)
    return loaded


def said_by(script: str, folder: Path, environment: Mapping[str, str]) -> list[list[str]]:
    """Command lines of `swarm` that a script of the compose file comes to."""
    stub, said = folder / "swarm", folder / "said"
    # A line in one piece: several write at the same moment.
    stub.write_text('#!/bin/sh\nprintf "%s\\n" "$(printf "%s\\t" "$@")" >>"$SAID"\n')
    stub.chmod(0o755)
    said.unlink(missing_ok=True)
    shell = shutil.which("sh")
    assert shell is not None
    path = f"{folder}:/usr/bin:/bin"
    subprocess.run(
        [shell, "-euc", script.replace("$$", "$")],
        env={"PATH": path, "SAID": str(said), **environment},
        check=True,
    )
    return sorted(line.split("\t")[:-1] for line in said.read_text().splitlines())


def test_every_process_of_one_of_several_machines_is_a_command_line_that_is_accepted(
    machine: dict[str, Any], keys: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SWARM_DASHBOARD_TOKEN", "simulated-fleet-only")
    place = {
        "PECKORDER_MISSION": "meadow",
        "PECKORDER_UAVS": "uav2 uav3",
        "PECKORDER_FIRST_ID": "2",
        "PECKORDER_OTHERS": "tls/machine-a:7447 tls/machine-b:7447",
        "PECKORDER_ROUTER": "router-2",
        "PECKORDER_LINK": "normal",
    }
    lines: dict[str, list[list[str]]] = {}
    for name, service in machine["services"].items():
        (script,) = service["command"]
        assert place.keys() <= service["environment"].keys()
        lines[name] = said_by(script, tmp_path, place)
        for line in lines[name]:
            words = [word.replace("/keys/", f"{keys}/").replace("/scenario.toml", "meadow")
                     for word in line]  # fmt: skip
            if name == "autopilots":
                assert parsed(words)["uav"] == ["uav2", "uav3"]
            else:
                cli.check(words)  # opens the keys, too

    others = ["--connect", "tls/machine-a:7447", "--connect", "tls/machine-b:7447"]
    assert lines["router"][0][-4:] == others
    flown = [parsed(words) for words in lines["agents"]]
    assert [(each["uav"], each["system_id"]) for each in flown] == [
        (["uav2"], [2]),
        (["uav3"], [3]),
    ]
    assert [each["mavlink"] for each in flown] == [
        ["tcp:autopilots:20001"],
        ["tcp:autopilots:20002"],
    ]


def instructions() -> list[tuple[str, str]]:
    """Of the Containerfile, continued lines joined."""
    text = re.sub(r"^\s*#.*\n", "", (DEPLOY / "Containerfile").read_text(), flags=re.MULTILINE)
    lines = re.sub(r"\\\n\s*", "", text).splitlines()
    return [(line.split(" ", 1)[0], line.split(" ", 1)[1]) for line in lines if line.strip()]


def stages() -> dict[str, list[tuple[str, str]]]:
    """The same by stage, from its FROM on; the last one, which has no name, as ""."""
    found: dict[str, list[tuple[str, str]]] = {}
    steps = instructions()
    for word, said in steps[[word for word, _ in steps].index("FROM") :]:
        if word == "FROM":
            name = said.partition(" AS ")[2]
            found[name] = []
        found[name].append((word, said))
    return found


def test_image_has_no_build_tools_and_runs_as_nobody() -> None:
    final = stages()["fleet"]

    assert stages()[""] == [("FROM", "fleet")], "what a build without a target makes"
    assert {word for word, _ in instructions()} <= {
        *("ARG", "FROM", "RUN", "WORKDIR", "COPY", "ENV", "USER", "ENTRYPOINT", "CMD"),
        *("EXPOSE", "HEALTHCHECK"),
    }
    assert not any(tool in said for _, said in final for tool in ("apt-get", "g++", "pip install"))
    assert [said for word, said in final if word == "COPY"] == [
        "--from=build /opt/peckorder /opt/peckorder"
    ]
    assert [said for word, said in final if word == "USER"] == ["10001:10001"]
    assert json.loads(dict(final)["ENTRYPOINT"]) == ["swarm"]


def test_image_is_built_from_all_that_a_wheel_is_made_of() -> None:
    project = tomllib.loads((DEPLOY.parent / "pyproject.toml").read_text())
    copied = {
        source for word, said in stages()["build"] if word == "COPY" for source in said.split()[:-1]
    }

    assert copied == {
        "pyproject.toml",
        project["project"]["readme"],
        *project["project"]["license-files"],
        *project["tool"]["scikit-build"]["wheel"]["packages"],
    }


def test_image_to_try_flies_a_fleet_and_is_asked_whether_its_dashboard_lives() -> None:
    steps = stages()["demo"]
    told = dict(steps)

    assert [word for word, _ in steps] == ["FROM", "EXPOSE", "HEALTHCHECK", "CMD"]
    assert told["FROM"] == "fleet AS demo", "as nobody, with nothing more in it"
    words = json.loads(told["CMD"])
    assert parsed(words)["dashboard"] == f"0.0.0.0:{told['EXPOSE']}"
    asked = json.loads(told["HEALTHCHECK"].partition(" CMD ")[2])
    compile(asked[2], "healthcheck", "exec")
    assert f"127.0.0.1:{told['EXPOSE']}/healthz" in asked[2]


def test_a_container_to_work_in_has_what_make_needs_and_no_rights() -> None:
    file = DEPLOY.parent / ".devcontainer" / "devcontainer.json"
    told = json.loads(file.read_text())

    build = told["build"]
    assert (file.parent / build["dockerfile"]).resolve() == DEPLOY / "Containerfile"
    assert (file.parent / build["context"]).resolve() == DEPLOY.parent
    steps = stages()[build["target"]]
    (installs,) = (said for word, said in steps if word == "RUN")
    assert {"g++", "make", "git", "chromium"} <= set(installs.split())
    assert f" {told['remoteUser']}" in installs
    assert dict(steps)["USER"] != "0:0"
    make, target = told["postCreateCommand"].split()
    assert (make, f"\n{target.replace('.venv', '$(VENV)')}:" in MAKEFILE) == ("make", True)


# -- by hand ------------------------------------------------------------------------------


def by_hand(said: str, root: Path) -> list[str]:
    """The command line that was printed to be run by hand, for a machine that lies in ``root``."""
    line = said.split("by hand:\n")[1].strip()
    sudo, _, user, program, *words = shlex.split(line)
    assert (sudo, user.partition("-")[0]) == ("sudo", "peckorder")
    assert program == "/opt/peckorder/bin/swarm"
    return [str(root) + word if word.startswith(("/etc/", "/var/")) else word for word in words]


def test_command_line_printed_for_machines_without_systemd_runs(
    tmp_path: Path, keys: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def install(*words: str) -> list[str]:
        capsys.readouterr()
        assert cli.main(["install", *words, "--root", str(tmp_path)]) == 0
        return by_hand(capsys.readouterr().out, tmp_path)

    serve = install("router", "--keys", str(keys / "router"), "--listen", "tls/127.0.0.1:0")
    with router(*serve[1:]) as (_, endpoint):
        own = ("--mission", "meadow", "--uav", "uav1", "--mavlink", "tcp:127.0.0.1:1")
        fly = install("agent", *own, "--keys", str(keys / "uav1"), "--connect", endpoint)
        with told(tmp_path / "notify") as manager:
            agent = subprocess.Popen(
                [sys.executable, "-m", "swarm", *fly],
                env={"NOTIFY_SOCKET": manager.getsockname(), "PATH": ""},
                stderr=subprocess.DEVNULL,
            )
            try:
                manager.settimeout(LIMIT_S)
                while "READY=1" not in (said := manager.recv(4096).decode()):
                    pass
            finally:
                agent.terminate()
                assert agent.wait(LIMIT_S) == 0
    assert said.startswith("STATUS=uav1: on the bus, in mission meadow")


@contextlib.contextmanager
def told(path: Path) -> Iterator[socket.socket]:
    """A service manager's socket."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as listening:
        listening.bind(str(path))
        yield listening
