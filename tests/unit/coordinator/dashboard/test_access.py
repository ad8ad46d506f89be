"""Who may look and command: names, origins, tokens and pace."""

from __future__ import annotations

from pathlib import Path

import pytest

from coordinator.dashboard.access import (
    RateLimit,
    access_for,
    is_loopback,
    parse_serve_address,
    read_token,
    url_of,
)
from swarm.runtime.errors import InputError

TOKEN = "0123456789abcdef"


@pytest.mark.parametrize(
    ("host", "known"),
    [
        ("localhost", True),
        ("LOCALHOST:8080", True),
        ("127.0.0.1:1234", True),
        ("[::1]:8080", True),
        ("192.168.1.5:8080", False),
        ("evil.example", False),
        ("localhost.evil.example:8080", False),
        ("", False),
        (None, False),
    ],
)
def test_on_loopback_only_its_own_names_are_answered(host: str | None, known: bool) -> None:
    access, made = access_for("127.0.0.1", (), None)

    assert access.knows_host(host) is known
    assert (access.token, made) == (None, False)


@pytest.mark.parametrize(
    ("host", "known"),
    [
        ("192.168.1.5:8080", True),
        ("[fe80::1]:8080", True),
        ("mast.example:8080", True),
        ("localhost", True),
        ("evil.example", False),
    ],
)
def test_beyond_loopback_addresses_and_given_names_are_answered(host: str, known: bool) -> None:
    access, _ = access_for("0.0.0.0", ("Mast.example",), TOKEN)

    assert access.knows_host(host) is known


@pytest.mark.parametrize("host", ["0.0.0.0", "127.0.0.1", "127.0.0.2", "::1", "192.168.1.5"])
def test_the_address_that_is_told_is_answered(host: str) -> None:
    access, _ = access_for(host, (), TOKEN)

    assert access.knows_host(url_of(host, 8080).split("/")[2])


def test_beyond_loopback_a_token_is_made_where_none_is_given() -> None:
    first, made = access_for("0.0.0.0", (), None)
    second, _ = access_for("192.168.1.5", (), None)
    given, not_made = access_for("0.0.0.0", (), TOKEN)

    assert made
    assert not not_made
    assert given.token == TOKEN
    assert first.token is not None
    assert len(first.token) >= 24
    assert first.token != second.token


@pytest.mark.parametrize(
    ("origin", "same"),
    [
        (None, True),
        ("http://localhost:8080", True),
        ("https://LOCALHOST:8080", True),
        ("http://localhost:9090", False),
        ("http://evil.example", False),
        ("null", False),
        ("file://localhost:8080", False),
    ],
)
def test_only_pages_of_this_very_server_are_of_its_origin(origin: str | None, same: bool) -> None:
    access, _ = access_for("127.0.0.1", (), None)

    assert access.same_origin(origin, "localhost:8080") is same


@pytest.mark.parametrize("token", [None, "", "0123456789abcdeF", TOKEN + "x", "\ud800", "ä"])
def test_any_other_token_is_turned_down(token: str | None) -> None:
    access, _ = access_for("127.0.0.1", (), TOKEN)

    assert not access.admits(token)
    assert access.admits(TOKEN)


def test_a_burst_is_allowed_and_then_so_many_a_second_each() -> None:
    pace = RateLimit(burst=3.0, per_s=2.0, clients=2)

    assert [pace.allows("a", 0.0) for _ in range(4)] == [True, True, True, False]
    assert pace.allows("b", 0.0)
    assert [pace.allows("a", 1.0) for _ in range(3)] == [True, True, False]


def test_only_so_many_clients_are_remembered() -> None:
    pace = RateLimit(burst=1.0, per_s=0.1, clients=2)
    for client in "abc":
        pace.allows(client, 0.0)

    assert pace.allows("a", 0.0)
    assert not pace.allows("c", 0.0)


def test_a_token_comes_from_the_file_or_the_environment(tmp_path: Path) -> None:
    file = tmp_path / "token"
    file.touch(mode=0o600)
    file.write_text(f" {TOKEN}\n")
    environment = {"SWARM_DASHBOARD_TOKEN": "abcdefabcdefabcdef"}

    assert read_token(file, environment) == TOKEN
    assert read_token(None, environment) == "abcdefabcdefabcdef"
    assert read_token(None, {}) is None


@pytest.mark.parametrize(
    ("text", "mode", "fault"),
    [
        (TOKEN, 0o644, "others may read it; run: chmod 600"),
        ("short", 0o600, "it must be one word of at least 16 ASCII signs"),
        ("two words are not one", 0o600, "it must be one word"),
        ("", 0o600, "it must be one word"),
    ],
)
def test_a_token_that_is_none_is_refused(tmp_path: Path, text: str, mode: int, fault: str) -> None:
    file = tmp_path / "token"
    file.write_text(text)
    file.chmod(mode)

    with pytest.raises(InputError, match=fault) as refused:
        read_token(file, {})

    assert len(str(refused.value).splitlines()) == 1
    assert text == "" or text not in str(refused.value)


def test_a_token_file_that_is_not_there_is_told(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot be read: No such file"):
        read_token(tmp_path / "none", {})


@pytest.mark.parametrize("host", ["localhost", "127.0.0.1", "127.8.9.1", "::1", "[::1]"])
def test_loopback_is_known(host: str) -> None:
    assert is_loopback(host)
    assert not is_loopback("0.0.0.0")
    assert not is_loopback("mast.example")


def test_a_place_is_a_port_with_or_without_an_address(tmp_path: Path) -> None:
    here = parse_serve_address("0", {})
    there = parse_serve_address("[::1]:8123", {}, must_be_free=False)
    open_to_all = parse_serve_address("0.0.0.0:8124", {}, must_be_free=False)
    words = open_to_all.arguments(tmp_path)

    assert (here.host, here.url, here.token) == (
        "127.0.0.1",
        f"http://127.0.0.1:{here.port}/",
        None,
    )
    assert here.port > 0
    assert there.url == "http://[::1]:8123/"
    assert read_token(Path(words[-1]), {}) == open_to_all.token
    assert open_to_all.lines[1] == f"token: {open_to_all.token}"


def test_a_token_of_the_operators_is_not_told_again(tmp_path: Path) -> None:
    place = parse_serve_address(
        "0.0.0.0:8124", {"SWARM_DASHBOARD_TOKEN": TOKEN}, must_be_free=False
    )

    assert place.lines == [f"dashboard: {place.url}"]
    assert place.arguments(tmp_path) == ["--host", "0.0.0.0", "--port", "8124"]


@pytest.mark.parametrize("text", ["", "http://x:1", "70000", "a b:1", ":1", "-1", "1.5"])
def test_what_is_no_place_is_refused(text: str) -> None:
    with pytest.raises(InputError, match="is no place to listen at; give PORT"):
        parse_serve_address(text, {}, must_be_free=False)


def test_a_port_that_is_taken_is_told_in_one_line() -> None:
    import socket

    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(InputError, match=f"port {port}: Address already in use") as refused:
            parse_serve_address(str(port), {})

    assert len(str(refused.value).splitlines()) == 1
