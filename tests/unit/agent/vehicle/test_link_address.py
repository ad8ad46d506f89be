"""Link URLs."""

from __future__ import annotations

import pytest

from agent.vehicle.config import (
    LinkAddress,
    SerialAddress,
    TcpAddress,
    UdpInAddress,
    UdpOutAddress,
    parse_forward,
    parse_link,
)
from swarm.runtime.errors import InputError


@pytest.mark.parametrize(
    ("url", "address"),
    [
        ("tcp:127.0.0.1:5760", TcpAddress("127.0.0.1", 5760)),
        ("tcp:[::1]:5760", TcpAddress("::1", 5760)),
        ("tcp:[fe80::1%eth0]:5760", TcpAddress("fe80::1%eth0", 5760)),
        ("udpout:sitl-3.local:14550", UdpOutAddress("sitl-3.local", 14550)),
        ("udpin:0.0.0.0:14550", UdpInAddress("0.0.0.0", 14550)),
        ("serial:/dev/ttyACM0:115200", SerialAddress("/dev/ttyACM0", 115200)),
    ],
)
def test_every_kind_of_link_is_read_and_written(url: str, address: LinkAddress) -> None:
    assert parse_link(url) == address
    assert str(address) == url


@pytest.mark.parametrize(
    ("url", "problem"),
    [
        ("", "'' is no kind of link"),
        ("127.0.0.1:5760", "'127.0.0.1' is no kind of link"),
        ("tcp://127.0.0.1:5760", "'//127.0.0.1' is no host"),
        ("tcp:5760", "a part is missing"),
        ("tcp::5760", "a part is missing"),
        ("tcp:localhost:", "'' is not a whole number"),
        ("udpin:localhost:http", "'http' is not a whole number"),
        ("udpin:localhost:٣", "'٣' is not a whole number"),
        ("udpout:localhost:0", "port 0 is not within 1..65535"),
        ("udpout:localhost:65536", "port 65536 is not within 1..65535"),
        ("tcp:a b:1", "'a b' is no host"),
        ("tcp:a..b:1", "'a..b' is no host"),
        ("serial:/dev/ttyACM0", "a part is missing"),
        ("serial:/dev/ttyACM0:0", "0 is no baud rate"),
    ],
)
def test_wrong_url_is_one_clear_line(url: str, problem: str) -> None:
    with pytest.raises(InputError) as raised:
        parse_link(url, "--mavlink")
    line = str(raised.value)
    assert problem in line
    assert "\n" not in line
    assert line.endswith("such as tcp:127.0.0.1:5760")


@pytest.mark.parametrize(
    ("url", "address"),
    [
        ("udp:127.0.0.1:14550", UdpOutAddress("127.0.0.1", 14550)),
        ("udp:[::1]:1", UdpOutAddress("::1", 1)),
        ("udp:station.local:65535", UdpOutAddress("station.local", 65535)),
    ],
)
def test_a_ground_stations_address_is_read(url: str, address: UdpOutAddress) -> None:
    assert parse_forward(url) == address


@pytest.mark.parametrize(
    ("url", "problem"),
    [
        ("127.0.0.1:14550", "'127.0.0.1' is no kind of link"),
        ("udpout:127.0.0.1:14550", "'udpout' is no kind of link"),
        ("udp:14550", "a part is missing"),
        ("udp:localhost:x", "'x' is not a whole number"),
        ("udp:localhost:0", "port 0 is not within 1..65535"),
        ("udp:a b:1", "'a b' is no host"),
    ],
)
def test_a_wrong_ground_stations_address_is_one_clear_line(url: str, problem: str) -> None:
    with pytest.raises(InputError) as raised:
        parse_forward(url)
    remedy = "give udp:HOST:PORT, such as udp:192.168.1.5:14550"
    assert str(raised.value) == f"--forward: {url}: {problem}; {remedy}"
