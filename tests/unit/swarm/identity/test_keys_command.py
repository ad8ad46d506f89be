"""`swarm keys` makes what a fleet needs, says where it goes, and shows no secret."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from importlib.metadata import EntryPoint
from pathlib import Path

import pytest

from swarm.cli import main
from swarm.identity import Role, load_identity
from swarm.identity.authority import open_authority
from swarm.identity.founding import found_authority
from swarm.model.frames import DEFAULT_ORIGIN
from swarm.runtime.clock import unix_s
from swarm.scenario.blank import Blank, blank_scenario

COMMANDS = {"keys": EntryPoint("keys", "swarm.identity.cli:keys", "peckorder.commands")}
DAY_S = 86_400.0


def run(*arguments: object) -> int:
    return main(["keys", *map(str, arguments)], COMMANDS)


@pytest.fixture
def keys(tmp_path: Path) -> Path:
    found_authority(tmp_path / "keys", "table-1", ["uav1", "uav2"], now_s=unix_s())
    return tmp_path / "keys"


def secrets_in(folder: Path) -> Iterator[str]:
    for path in folder.rglob("*"):
        if path.name.endswith((".key", ".password", ".csv")):
            yield from re.findall(r"[A-Za-z0-9+/=]{16,}", path.read_text())


def test_init_makes_keys_for_everyone_of_the_scenario_and_says_where_they_go(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "keys"

    assert run("init", "table-1", "--out", folder, "--days", 7, "--routers", 2, "--mesh") == 0

    told = capsys.readouterr().out
    authority = open_authority(folder)
    assert (authority.mission, authority.days, authority.mesh) == ("table-1", 7, True)
    names = ["uav1", "uav2", "uav3", "coordinator", "router", "router-2", "dashboard", "operator"]
    assert set(authority.issued) == set(names)
    for name in names:
        assert load_identity(folder / name).mission == "table-1"
        assert re.search(rf"^  {re.escape(str(folder / name))} +to ", told, re.MULTILINE)
    assert "keep this folder off the vehicles" in told
    assert str(folder / "mavlink-keys.csv") in told
    assert f"next: swarm router --keys {folder / 'router'}" in told


def test_the_folders_of_a_large_fleet_are_told_in_one_row(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    fleet = tmp_path / "fleet.toml"
    fleet.write_text(blank_scenario(Blank("fleet", 13, 0, DEFAULT_ORIGIN)))

    assert run("init", fleet, "--out", tmp_path / "keys") == 0

    rows = [line for line in capsys.readouterr().out.splitlines() if line.startswith("  ")]
    assert len(rows) == 5
    assert rows[0].endswith(" (13)  each to its companion computer, for swarm agent --keys")


def test_no_command_shows_a_secret(keys: Path, capsys: pytest.CaptureFixture[str]) -> None:
    secrets = list(secrets_in(keys))
    for command in (
        ["add", keys, "uav1"],
        ["revoke", keys, "uav1"],
        ["list", keys],
        ["list", keys, "--json"],
        ["list", keys / "router"],
        ["renew", keys],
    ):
        assert run(*command) == 0
        secrets += secrets_in(keys)

    told = "".join(capsys.readouterr())
    assert len(set(secrets)) > 25
    for secret in secrets:
        assert secret not in told


def test_add_gives_new_names_a_role_and_known_ones_the_next_generation(
    keys: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run("add", keys, "uav9", "--role", "uav") == 0
    assert f"{keys}/mavlink-keys.csv: new pass phrases for the autopilots of uav9" in (
        capsys.readouterr().out
    )
    assert run("add", keys, "recorder", "--role", "viewer", "--days", 3) == 0
    assert run("add", keys, "uav1", "router") == 0

    told = capsys.readouterr().out
    assert "mavlink" not in told
    assert "roster version 5" in told
    assert load_identity(keys / "uav9").role is Role.UAV
    assert load_identity(keys / "recorder").not_after_s < unix_s() + 4 * DAY_S
    assert load_identity(keys / "uav1").common_name == "uav1@2"
    assert load_identity(keys / "router").common_name == "router@2"


def test_revoke_takes_out_of_force(keys: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run("revoke", keys, "uav2", "dashboard", "uav2") == 0

    assert "revoked: uav2, dashboard\n" in capsys.readouterr().out
    assert open_authority(keys).roster.entry("uav2") is None
    assert not (keys / "uav2").exists()


def test_renew_issues_everything_anew(keys: Path, capsys: pytest.CaptureFixture[str]) -> None:
    series = open_authority(keys).roster.series

    assert run("renew", keys, "--days", 5) == 0

    assert open_authority(keys).roster.series != series
    assert load_identity(keys / "uav1").generation == 2
    told = capsys.readouterr().out
    assert "give all machines their new ones" in told
    assert f"processes that run from folders in {keys} end: start them anew" in told


def test_list_shows_everyone_and_warns_of_what_ends(
    keys: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    authority = open_authority(keys)
    authority.issue({"uav1": Role.UAV}, now_s=unix_s(), days=3.5)
    authority.issue({"uav2": Role.UAV}, now_s=unix_s() - 100 * DAY_S)
    authority.revoke(["operator"])

    assert run("list", keys) == 0

    told = capsys.readouterr()
    rows = [line.split() for line in told.out.splitlines()]
    assert rows[0][:4] == ["table-1:", "roster", "version", "5,"]
    assert [row[0] for row in rows[2:]] == (
        ["uav1", "uav2", "coordinator", "router", "dashboard", "operator"]
    )
    assert rows[2][1:3] + rows[2][4:] == ["uav", "2", "ends", "in", "3", "d"]
    assert rows[3][4:] == ["expired"]
    assert rows[-1] == ["operator", "operator", "1", "revoked"]
    assert told.err == (
        f"expired, or within 14 days: uav1, uav2; issue anew: swarm keys add {keys} uav1 uav2\n"
    )


def test_list_as_json(keys: Path, capsys: pytest.CaptureFixture[str]) -> None:
    authority = open_authority(keys)
    authority.revoke(["uav2"])

    assert run("list", keys, "--json") == 0

    told = json.loads(capsys.readouterr().out)
    assert (told["mission"], told["version"]) == ("table-1", 3)
    assert told["series"] == authority.roster.series.hex()
    by_name = {each["name"]: each for each in told["identities"]}
    entry = authority.roster.entry("uav1")
    assert entry is not None
    assert by_name["uav1"] == {
        "name": "uav1",
        "role": "uav",
        "generation": 1,
        "state": "in force",
        "not_after_s": entry.not_after_s,
        "days_left": 89,
    }
    assert by_name["uav2"]["state"] == "revoked"
    assert by_name["uav2"]["not_after_s"] is None


def test_list_reads_a_machine_s_folder_too(keys: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run("list", keys / "uav1") == 0

    assert "coordinator" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (["add", "keys", "x"], "keys: 'x' is new and has no role; give it one: --role uav|coord"),
        (["add", "keys", "a b", "--role", "uav"], "keys: name 'a b' is not 1 to 64 letters"),
        (["add", "keys", "uav1", "--role", "router"], "keys: 'uav1' is the name of a uav, and no "),
        (["add", "nowhere", "x"], "nowhere: no such folder; give the one that 'swarm keys init'"),
        (["add", "keys/uav1", "x"], "keys/uav1: is no authority's folder; give the one that"),
        (["revoke", "keys", "x"], "keys: nobody is named 'x'; choose of coordinator, dashboard"),
        (["list", "nowhere"], "nowhere: no such folder; give a folder that 'swarm keys' made"),
        (["list", "."], ".: holds no keys; give a folder that 'swarm keys' made"),
        (["init", "table-1"], "swarm keys init: missing option '--out'; see"),
        (["init", "table-1", "--out", "keys"], "keys: is an authority's folder already; add to it"),
        (["init", "table-1", "--out", "file/k"], "cannot be written: "),
    ],
)
def test_what_is_wrong_is_said_in_one_line(
    keys: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    arguments: list[str],
    line: str,
) -> None:
    monkeypatch.chdir(keys.parent)
    Path("file").touch()

    assert run(*arguments) == 2

    told = capsys.readouterr()
    assert told.out == ""
    assert line in told.err
    assert told.err.count("\n") == 1
