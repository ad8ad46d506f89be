"""The units as they are shipped: complete, all equally shut in, and good in systemd's own eyes.

Where systemd-analyze is missing, what it would say is not known; the rest is checked all the same.
Booting them for real: deploy/checks/units.sh.
"""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from swarm.cli import _installed_commands, main
from swarm.install.installation import VARIABLE
from swarm.install.services import DEFAULT_PROGRAM, FOLDER, KINDS, STATE, UNITS, ServiceKind

DEPLOY = Path(__file__).parents[4] / "deploy" / "systemd"
ANALYZE = shutil.which("systemd-analyze")
MOST_EXPOSED = 20
"""Tenths of systemd's measure, 0 to 100; up to 2.0 counts as OK."""
KIND = pytest.mark.parametrize("kind", KINDS.values(), ids=str)


def settings(kind: ServiceKind) -> dict[str, list[str]]:
    """Of a unit, by name, in order."""
    found: dict[str, list[str]] = {}
    for line in (UNITS / kind.unit_file).read_text().splitlines():
        if line and not line.startswith(("#", "[")):
            name, _, value = line.partition("=")
            found.setdefault(name, []).append(value)
    return found


def sandbox(kind: ServiceKind) -> str:
    text = (UNITS / kind.unit_file).read_text()
    return text[text.index("# What it may touch") : text.index("[Install]")]


@KIND
def test_unit_runs_its_command_as_a_user_of_its_own_with_the_options_installed(
    kind: ServiceKind,
) -> None:
    unit = settings(kind)
    name = f"{kind.command}-%i" if kind.per_uav else kind.command

    assert kind.command in _installed_commands()
    assert unit["ExecStart"] == [f"{DEFAULT_PROGRAM} {kind.command} ${VARIABLE}"]
    assert unit["EnvironmentFile"] == [f"{FOLDER}/{name}.conf"]
    assert unit["StateDirectory"] == [f"{STATE.name}/{name}"]
    assert unit["User"] == [kind.user]
    assert f"u {kind.user} - " in (UNITS / "peckorder.sysusers").read_text()


@KIND
def test_unit_comes_back_however_often_it_fails_and_is_watched(kind: ServiceKind) -> None:
    unit = settings(kind)

    assert unit["StartLimitIntervalSec"] == ["0"]
    assert unit["Restart"] == ["on-failure" if kind.command == "coordinator" else "always"]
    assert unit["Type"] == ["notify"]
    assert int(unit["WatchdogSec"][0]) >= 10
    assert unit["LimitCORE"] == ["0"]


def test_all_units_are_shut_in_alike() -> None:
    assert len({sandbox(kind) for kind in KINDS.values()}) == 1


def test_deploy_shows_the_units_that_are_installed() -> None:
    shown = {path.name: path.read_bytes() for path in DEPLOY.iterdir()}

    assert shown == {path.name: path.read_bytes() for path in UNITS.iterdir()}


@pytest.fixture
def installed(tmp_path: Path) -> Path:
    """Units of every kind, with a program that is there wherever this runs."""
    into = ["--root", str(tmp_path), "--program", "/bin/true"]
    link = ["--mission", "table-1", "--mavlink", "serial:/dev/ttyAMA0:921600"]
    assert main(["install", "agent", "--uav", "uav1", *link, *into]) == 0
    assert main(["install", "coordinator", "table-1", *into]) == 0
    assert main(["install", "router", *into]) == 0
    assert main(["install", "dashboard", *into]) == 0
    return tmp_path / "etc" / "systemd" / "system"


def test_systemd_finds_nothing_wrong_with_them_and_little_exposed(installed: Path) -> None:
    units = [kind.unit_file.replace("@", "@uav1") for kind in KINDS.values()]
    for unit in units:
        text = (installed / unit.replace("@uav1", "@")).read_text()
        assert re.search(r"^ExecStart=/bin/true ", text, re.MULTILINE)
    if ANALYZE is None:
        print("systemd-analyze is not here: verify and security remain unchecked")
        return
    for unit in units:
        path = str(installed / unit)
        assert analyze("verify", path) == (0, "", "")
        limit = f"--threshold={MOST_EXPOSED}"
        status, said, _ = analyze("security", "--no-pager", "--offline=true", limit, path)
        assert status == 0, said.splitlines()[-1]


def analyze(*words: str) -> tuple[int, str, str]:
    assert ANALYZE is not None
    run = subprocess.run([ANALYZE, *words], check=False, capture_output=True, text=True)
    return run.returncode, run.stdout, run.stderr
