"""Commands with --check: they say that they would begin, or in one line why not."""

from __future__ import annotations

from pathlib import Path

import pytest

from swarm.cli import main
from swarm.identity.founding import found_authority
from swarm.runtime.clock import unix_s

ENDPOINT = "tls/192.0.2.1:7447"


@pytest.fixture(scope="module")
def keys(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("keys") / "keys"
    found_authority(folder, "table-1", ["uav1"], now_s=unix_s())
    return folder


def said(capsys: pytest.CaptureFixture[str], status: int, *words: str) -> str:
    assert main([*words, "--check"]) == status
    out, err = capsys.readouterr()
    assert out == ""
    return err


@pytest.mark.parametrize(
    "words",
    [
        ("agent --mission table-1 --uav uav1 --mavlink tcp:127.0.0.1:5760", "uav1"),
        ("coordinator table-1", "coordinator"),
        ("dashboard", "dashboard"),
        ("dashboard", "operator"),
        ("dashboard", "coordinator"),
    ],
)
def test_options_that_are_right_are_said_to_be(
    keys: Path, capsys: pytest.CaptureFixture[str], words: tuple[str, str]
) -> None:
    command, folder = words
    told = said(capsys, 0, *command.split(), "--connect", ENDPOINT, "--keys", str(keys / folder))

    assert told.splitlines()[-1] == "swarm: these options are right"


def test_a_router_too(keys: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert said(capsys, 0, "router", "--keys", str(keys / "router")) == (
        "swarm: these options are right\n"
    )


def test_a_dashboard_does_not_take_the_keys_of_a_uav(
    keys: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    told = said(capsys, 2, "dashboard", "--connect", ENDPOINT, "--keys", str(keys / "uav1"))

    assert "'uav1', whose role is uav" in told
    assert "viewer" in told
