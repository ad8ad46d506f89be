"""`swarm router`: says where it serves and ends cleanly, however it is ended."""

from __future__ import annotations

import signal
import socket
from pathlib import Path

import pytest

from tests.process.router_processes import commanded, finish, read_endpoints, router, token_holder

pytestmark = pytest.mark.process

LOOPBACK = "tcp/127.0.0.1:0"


@pytest.mark.parametrize(
    ("number", "status"), [(signal.SIGTERM, 0), (signal.SIGINT, 130)], ids=["SIGTERM", "SIGINT"]
)
def test_signals_end_it_while_a_client_is_there(number: signal.Signals, status: int) -> None:
    with router("--listen", LOOPBACK) as (process, endpoint), token_holder("client", "t", endpoint):
        process.send_signal(number)
        ended, out, log = finish(process)
        assert (ended, out, len(log.splitlines())) == (status, "", 1)
        assert f"router ready at {endpoint}" in log


def test_end_of_standard_input_ends_it() -> None:
    with router("--listen", LOOPBACK, "--json") as (process, _):
        assert process.stdin is not None
        process.stdin.close()
        assert finish(process) == (0, "", "")


def test_without_lifeline_standard_input_does_not_matter() -> None:
    with commanded("router", "--listen", LOOPBACK) as process:
        assert process.stdin is not None
        process.stdin.close()
        assert len(read_endpoints(process)) == 1
        assert process.poll() is None
        process.terminate()
        assert finish(process)[0] == 0


def test_standard_output_has_the_endpoints_alone() -> None:
    with router("--listen", LOOPBACK, RUST_LOG="debug") as (process, endpoint):
        with token_holder("client", "t", endpoint):
            pass
        process.terminate()
        assert finish(process)[1] == ""


def test_says_the_real_port_of_every_endpoint() -> None:
    with commanded("router", *["--listen", LOOPBACK] * 2) as process:
        endpoints = read_endpoints(process)
        assert len(set(endpoints)) == 2
        for endpoint in endpoints:
            host, port = endpoint.removeprefix("tcp/").split(":")
            socket.create_connection((host, int(port)), timeout=5.0).close()


def test_configuration_file_is_used(tmp_path: Path) -> None:
    file = tmp_path / "router.json5"
    file.write_text('{listen: {endpoints: ["tcp/127.0.0.1:0"]}, /* as it is */}')
    with router("--config", str(file)) as (process, endpoint):
        with token_holder("client", "t", endpoint):
            pass
        process.terminate()
        assert finish(process)[0] == 0


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["--listen", "udp/127.0.0.1:7447"], "lost UDP packets stay lost; use tcp, tls or quic"),
        (["--listen", "127.0.0.1:7447"], "not an endpoint: '127.0.0.1:7447'; write PROTOCOL/"),
        (["--listen", "tcp/127.0.0.1:70000"], "the port must be within 0..65535"),
        (["--connect", "tcp/127.0.0.1:0"], "the port must be within 1..65535"),
        (["--config", "/no/such/file"], "/no/such/file: there is no such file; give a Zenoh"),
        (["--lease-s", "0"], "lease-s"),
    ],
)
def test_wrong_options_are_one_line_and_status_2(options: list[str], says: str) -> None:
    with commanded("router", *options) as process:
        status, out, err = finish(process)
    assert (status, out) == (2, "")
    assert says in err
    assert err.count("\n") == 1


def test_broken_configuration_file_is_one_line_and_status_2(tmp_path: Path) -> None:
    file = tmp_path / "broken.json5"
    file.write_text('{listen: {endpoints: ["tcp/127.0.0.1:0"]}, no_such_key: 1}')
    with commanded("router", "--config", str(file)) as process:
        status, out, err = finish(process)
    assert (status, out) == (2, "")
    assert err.startswith(f"{file}: ")
    assert "no_such_key" in err
    assert err.count("\n") == 1


def test_taken_endpoint_is_one_line_and_status_1() -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        endpoint = f"tcp/127.0.0.1:{taken.getsockname()[1]}"
        with commanded("router", "--listen", endpoint) as process:
            status, out, err = finish(process)
    assert (status, out) == (1, "")
    told = f"swarm: cannot open the bus: {endpoint} is already in use by another process"
    assert err.startswith(told)
    assert err.count("\n") == 1
