"""`swarm agent` and `swarm autopilot` with wrong links and keys: one clear line, exit status 2."""

from __future__ import annotations

from pathlib import Path

import pytest

from swarm.cli import main

AGENT = ["agent", "--mission", "m", "--uav", "u", "--mavlink", "tcp:127.0.0.1:5760"]
AUTOPILOT = ["autopilot", "table-1"]


@pytest.mark.parametrize("command", [AGENT, AUTOPILOT])
@pytest.mark.parametrize(
    ("content", "mode", "line"),
    [
        (None, 0, "cannot be read (No such file or directory); give a file of 32 bytes"),
        (b"short", 0o600, "5 bytes that are no signing key; give a file of 32 bytes"),
        (b"k" * 32, 0o644, "this key is open to everyone on this machine; close it: chmod o= "),
    ],
)
def test_a_key_that_cannot_be_used_is_told(
    command: list[str],
    content: bytes | None,
    mode: int,
    line: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    key = tmp_path / "key"
    if content is not None:
        key.write_bytes(content)
        key.chmod(mode)
    assert main([*command, "--signing-key", str(key)]) == 2
    output = capsys.readouterr()
    assert output.out == ""
    assert output.err.startswith(f"{key}: {line}")
    assert output.err.count("\n") == 1


def test_a_ground_station_that_is_no_address_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    good, bad = ["--forward", "udp:127.0.0.1:14550"], ["--forward", "udp:127.0.0.1"]
    assert main([*AGENT, *good, *bad]) == 2
    remedy = "give udp:HOST:PORT, such as udp:192.168.1.5:14550"
    line = f"--forward: udp:127.0.0.1: a part is missing; {remedy}\n"
    assert capsys.readouterr() == ("", line)


@pytest.mark.parametrize("text", ["", "0", "256", "255:", "255:0", "a:b", "255:191:1"])
def test_own_ids_that_are_none_are_told(text: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([*AGENT, "--ground-id", text]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("--ground-id: ")
    assert err.endswith("is not a whole number within 1..255; give SYS or SYS:COMP\n")
    assert err.count("\n") == 1


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (
            [],
            "--station-actions: there is no ground station whose actions could be taken; name one",
        ),
        (
            ["--forward", "udp:127.0.0.1:14550", "--forward", "udp:192.168.1.5:14550"],
            "--station-actions: udp:192.168.1.5:14550: anybody on that network could pass for",
        ),
    ],
)
def test_actions_of_ground_stations_that_anybody_could_be_are_refused(
    words: list[str], line: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([*AGENT, "--station-actions", *words]) == 2
    output = capsys.readouterr()
    assert output.out == ""
    assert output.err.startswith(line)
    assert output.err.count("\n") == 1


def test_actions_are_taken_from_this_machine_or_by_key(tmp_path: Path) -> None:
    key = tmp_path / "key"
    key.write_bytes(bytes(range(32)))
    key.chmod(0o600)
    far = ["--forward", "udp:192.168.1.5:14550", "--signing-key", str(key)]

    assert main([*AGENT, "--check", "--station-actions", *far]) == 0
    near = ["--forward", "udp:[::1]:14550", "--forward", "udp:localhost:14551"]
    assert main([*AGENT, "--check", "--station-actions", *near]) == 0
