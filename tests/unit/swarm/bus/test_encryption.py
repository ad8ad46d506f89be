"""Nobody talks to other machines in the clear by mistake."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import pytest
import typer
from typer.testing import CliRunner

from swarm.bus.config import (
    DEFAULT_SECURE_ROUTER,
    BusConfig,
    ClientTopology,
    FileTopology,
    MeshTopology,
    RouterConfig,
    bus_config,
    is_loopback,
)
from swarm.bus.connection import DEFAULT_CONNECTION, ConnectionOptions
from swarm.identity import Identity, Role, load_identity
from swarm.identity.founding import found_authority
from swarm.runtime.clock import unix_s
from swarm.runtime.errors import InputError
from swarm.runtime.option_groups import with_options

HERE = "tcp/127.0.0.1:7447"
AWAY = "tcp/192.168.1.2:7447"
SAFE = "tls/192.168.1.2:7447"


@pytest.fixture(scope="module")
def keys(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("authority") / "keys"
    found_authority(folder, "m", ["uav1"], now_s=unix_s())
    return folder


@pytest.fixture(scope="module")
def identity(keys: Path) -> Identity:
    return load_identity(keys / "uav1")


@pytest.mark.parametrize(
    "endpoint",
    [
        HERE,
        "tcp/127.1.2.3:1",
        "tcp/[::1]:7447#iface=lo",
        "tcp/[::ffff:127.0.0.1]:7447",
        "ws/localhost:80",
        "unixsock-stream//run/swarm.sock",
    ],
)
def test_what_stays_on_this_machine_needs_no_keys(endpoint: str) -> None:
    assert is_loopback(endpoint)
    assert BusConfig(ClientTopology((endpoint,))).identity is None


@pytest.mark.parametrize(
    "endpoint",
    [
        AWAY,
        "tcp/0.0.0.0:7447",
        "tcp/[::]:7447",
        "tcp/[fe80::1%eth0]:7447",
        "tcp/router.example.org:7447",
        "tcp/localhost.example.org:7447",
        "tcp/127.0.0.1.example.org:7447",
        "ws/10.0.0.1:80",
    ],
)
@pytest.mark.parametrize(
    "make",
    [
        lambda each, clear: BusConfig(ClientTopology((HERE, each)), unencrypted=clear),
        lambda each, clear: BusConfig(MeshTopology(each), unencrypted=clear),
        lambda each, clear: BusConfig(MeshTopology(HERE, (each,)), unencrypted=clear),
        lambda each, clear: RouterConfig((each,), unencrypted=clear),
        lambda each, clear: RouterConfig((HERE,), (each,), unencrypted=clear),
    ],
)
def test_in_the_clear_other_machines_are_talked_to_only_when_told_so(
    make: Callable[[str, bool], object], endpoint: str
) -> None:
    with pytest.raises(ValueError, match=r"; give --keys DIR.*--unencrypted"):
        make(endpoint, False)
    assert make(endpoint, True)


def test_the_refusal_is_one_line_with_both_remedies() -> None:
    with pytest.raises(InputError) as refused:
        bus_config("router", "", [AWAY])

    (fault,) = refused.value.faults
    assert AWAY in fault.problem
    assert "--keys DIR" in fault.remedy
    assert "--unencrypted" in fault.remedy
    assert "\n" not in str(refused.value)


def test_a_zenoh_file_is_the_users_own_word(tmp_path: Path) -> None:
    assert BusConfig(FileTopology(tmp_path / "zenoh.json5"))


def test_encrypted_endpoints_need_keys_and_keys_need_encrypted_endpoints(
    identity: Identity,
) -> None:
    with pytest.raises(ValueError, match="needs keys"):
        BusConfig(ClientTopology((SAFE,)))
    with pytest.raises(ValueError, match="is not encrypted"):
        BusConfig(ClientTopology((HERE,)), identity=identity)
    with pytest.raises(ValueError, match="is not encrypted"):
        BusConfig(MeshTopology("unixsock-stream//run/x"), identity=identity)
    with pytest.raises(ValueError, match="contradict"):
        BusConfig(ClientTopology((SAFE,)), identity=identity, unencrypted=True)

    config = bus_config("router", "", [], identity=identity)

    assert config.endpoints == (DEFAULT_SECURE_ROUTER,)
    assert config.mission == "m"
    assert BusConfig(ClientTopology(("quic/[::1]:7447",)), identity=identity)


def test_settings_show_nothing_secret(identity: Identity) -> None:
    config = bus_config("router", "", [], identity=identity)

    assert identity.password not in repr(config)


# -- the options of every command -----------------------------------------------------------


def run(*arguments: str, roles: tuple[Role, ...] = ()) -> list[BusConfig]:
    """What a command makes of these arguments."""
    made: list[BusConfig] = []
    app = typer.Typer()

    @app.command()
    @with_options
    def command(
        name: str,
        seat: ConnectionOptions = DEFAULT_CONNECTION,
        loud: Annotated[bool, typer.Option("--loud")] = False,
    ) -> int:
        assert (name, loud) == ("x", True)
        made.append(seat.config(roles=roles))
        assert run_again(seat) == made[-1]
        return 0

    def run_again(seat: ConnectionOptions) -> BusConfig:
        if seat.bus == "mesh":
            return made[-1]
        other: list[BusConfig] = []
        again = typer.Typer()

        @again.command()
        @with_options
        def command(seat: ConnectionOptions = DEFAULT_CONNECTION) -> int:
            other.append(seat.config())
            return 0

        CliRunner().invoke(again, seat.arguments(), catch_exceptions=False)
        return other[0]

    CliRunner().invoke(app, ["x", "--loud", *arguments], catch_exceptions=False)
    return made


def test_a_command_finds_the_bus_by_its_common_options(keys: Path) -> None:
    assert run() == [BusConfig(ClientTopology((HERE,)))]
    assert run("--connect", HERE, "--connect", AWAY, "--unencrypted", "--lease-s", "3") == [
        BusConfig(ClientTopology((HERE, AWAY)), 3.0, unencrypted=True)
    ]
    assert run("--bus", "mesh", "--listen", HERE) == [BusConfig(MeshTopology(HERE))]
    (secure,) = run("--keys", str(keys / "uav1"), "--connect", SAFE)
    assert secure.endpoints == (SAFE,)
    assert secure.mission == "m"


def test_keys_of_another_role_are_refused(keys: Path) -> None:
    with pytest.raises(InputError, match=r"'uav1', whose role is uav; .* operator"):
        run("--keys", str(keys / "uav1"), roles=(Role.OPERATOR,))
