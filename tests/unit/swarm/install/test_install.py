"""What `swarm install` puts where, what it refuses, and what stays when it is done again."""

from __future__ import annotations

import shutil
import stat
from collections.abc import Sequence
from pathlib import Path

import pytest

from swarm.cli import main
from swarm.identity.authority import open_authority
from swarm.install.installation import kept_words

SERIAL = ["--mavlink", "serial:/dev/ttyAMA0:921600"]
CONNECT = ["--connect", "tls/192.168.1.2:7447"]


@pytest.fixture(scope="module")
def keys(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("authority") / "keys"
    assert main(["keys", "init", "table-1", "--out", str(folder)]) == 0
    return folder


def install(root: Path, *words: str) -> int:
    return main(["install", *words, "--root", str(root)])


def install_agent(root: Path, keys: Path, *words: str, uav: str = "uav1") -> int:
    link = [] if "--mavlink" in words else SERIAL
    own = ["--mission", "table-1", *link, *CONNECT, "--keys", str(keys / uav)]
    return install(root, "agent", "--uav", uav, *own, *words)


def options(root: Path, name: str = "agent-uav1") -> list[str]:
    return kept_words((root / f"etc/peckorder/{name}.conf").read_text())


def files(root: Path) -> dict[str, bytes]:
    return {
        str(path.relative_to(root)): path.read_bytes() for path in root.rglob("*") if path.is_file()
    }


def test_agent_gets_unit_options_and_keys_of_its_own(tmp_path: Path, keys: Path) -> None:
    key = keys / "uav1" / "mavlink.key"
    assert install_agent(tmp_path, keys, "--signing-key", str(key)) == 0

    state = "/var/lib/peckorder/agent-uav1"
    assert options(tmp_path) == [
        *("--uav", "uav1", "--mission", "table-1", *SERIAL, *CONNECT),
        *("--keys", f"{state}/keys", "--signing-key", f"{state}/keys/mavlink.key"),
        *("--state", state),
    ]
    copies = tmp_path / state[1:] / "keys"
    assert {path.name: path.read_bytes() for path in copies.iterdir()} == {
        path.name: path.read_bytes() for path in (keys / "uav1").iterdir()
    }
    modes = {stat.S_IMODE(path.stat().st_mode) for path in copies.iterdir()}
    folders = {stat.S_IMODE(path.stat().st_mode) for path in (copies, copies.parent)}
    assert (modes, folders) == ({0o600}, {0o700})
    drop_in = tmp_path / "etc/systemd/system/peckorder-agent@uav1.service.d/10-serial-port.conf"
    assert "DeviceAllow=char-ttyAMA rw" in drop_in.read_text()


def test_installed_again_without_options_it_keeps_those_of_the_user(
    tmp_path: Path, keys: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    install_agent(tmp_path, keys)
    path = tmp_path / "etc/peckorder/agent-uav1.conf"
    path.write_text(path.read_text().replace("table-1", "table-1 --rejoin") + "SWARM_X=1\n")
    unit = tmp_path / "etc/systemd/system/peckorder-agent@.service"
    unit.write_text("of an older release")
    before = files(tmp_path) | {str(unit.relative_to(tmp_path)): b""}
    capsys.readouterr()

    assert install(tmp_path, "agent", "--uav", "uav1") == 0
    after = files(tmp_path) | {str(unit.relative_to(tmp_path)): b""}
    assert after == before
    assert "replaced  /etc/systemd/system/peckorder-agent@.service" in capsys.readouterr().out
    assert b"[Service]" in unit.read_bytes()


def test_newer_roster_of_the_machine_stays(tmp_path: Path, keys: Path) -> None:
    install_agent(tmp_path, keys)
    roster = tmp_path / "var/lib/peckorder/agent-uav1/keys/roster.json"
    authority = open_authority(shutil.copytree(keys, tmp_path / "authority"))
    authority.revoke(["uav3"])
    roster.write_bytes(authority.roster_bytes())

    assert install_agent(tmp_path, keys) == 0
    assert roster.read_bytes() == authority.roster_bytes()


def test_keys_that_the_machine_knows_to_be_revoked_are_refused(
    tmp_path: Path, keys: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    install_agent(tmp_path, keys)
    authority = open_authority(shutil.copytree(keys, tmp_path / "authority"))
    authority.revoke(["uav1"])
    roster = tmp_path / "var/lib/peckorder/agent-uav1/keys/roster.json"
    roster.write_bytes(authority.roster_bytes())
    capsys.readouterr()

    assert install_agent(tmp_path, keys) == 2
    assert "uav1@1 was revoked or replaced, as this machine knows" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "fault"),
    [
        (["--mission", "other"], "these keys are for the mission 'table-1', not 'other'"),
        (["--mavlink", "serial:ttyAMA0:9600"], "no device; name one below /dev"),
        (["--mavlink", "usb:1:2"], "'usb' is no kind of link"),
        (["--connect", "tcp/192.168.1.2:7447"], "is not encrypted"),
        (["--connect", "192.168.1.2"], "not an endpoint"),
        (["--state", "/tmp/elsewhere"], "is not a place it can write to; leave it out"),
        (["--no-such-option"], "no such option: --no-such-option"),
        (["--fence-radius-m", "far"], "invalid value for '--fence-radius-m'"),
        (["--signing-key", "/no/such/file"], "cannot be read"),
    ],
)
def test_wrong_input_is_one_clear_line_and_nothing_is_written(
    tmp_path: Path,
    keys: Path,
    capsys: pytest.CaptureFixture[str],
    words: Sequence[str],
    fault: str,
) -> None:
    assert install_agent(tmp_path, keys, *words) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert fault in said
    assert not list(tmp_path.iterdir())


def test_keys_of_another_uav_are_refused(
    tmp_path: Path, keys: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["--mission", "table-1", *SERIAL, "--keys", str(keys / "uav2")]
    assert install(tmp_path, "agent", "--uav", "uav1", *words) == 2
    assert "these keys are those of 'uav2', not of 'uav1'" in capsys.readouterr().err


def test_first_installation_of_an_agent_needs_options(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert install(tmp_path, "agent", "--uav", "uav1") == 2
    assert "there is none yet" in capsys.readouterr().err


def test_dry_run_shows_everything_but_secrets_and_writes_nothing(
    tmp_path: Path, keys: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert install_agent(tmp_path, keys, "--dry-run") == 0
    said = capsys.readouterr().out
    assert "/etc/systemd/system/peckorder-agent@.service" in said
    assert "SWARM_OPTIONS=" in said
    assert "sudo -u peckorder-agent /opt/peckorder/bin/swarm agent --uav uav1" in said
    assert (keys / "uav1/private.key").read_text().splitlines()[1] not in said
    assert not list(tmp_path.iterdir())


def test_coordinator_gets_a_copy_of_its_scenario_and_is_not_started_with_the_machine(
    tmp_path: Path, keys: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scenario = tmp_path / "field.toml"
    main(["new", str(scenario)])
    capsys.readouterr()
    root = tmp_path / "root"
    root.mkdir()

    assert install(root, "coordinator", str(scenario), "--method", "greedy") == 0
    assert (root / "etc/peckorder/coordinator.toml").read_bytes() == scenario.read_bytes()
    assert options(root, "coordinator")[:3] == [
        *("/etc/peckorder/coordinator.toml", "--method", "greedy")
    ]
    assert " enable " not in capsys.readouterr().out


def test_dashboard_for_others_gets_a_token_that_stays_its_own(tmp_path: Path, keys: Path) -> None:
    words = ("dashboard", "--host", "0.0.0.0", "--keys", str(keys / "dashboard"))
    assert install(tmp_path, *words) == 0
    token = tmp_path / "var/lib/peckorder/dashboard/token"
    first = token.read_text()
    assert install(tmp_path, *words) == 0

    assert token.read_text() == first
    assert stat.S_IMODE(token.stat().st_mode) == 0o600
    assert options(tmp_path, "dashboard")[-2:] == [
        *("--token-file", "/var/lib/peckorder/dashboard/token")
    ]


def test_zenoh_file_is_copied_to_where_the_service_can_read_it(tmp_path: Path, keys: Path) -> None:
    file = tmp_path / "mine.json5"
    file.write_text('{mode: "client", connect: {endpoints: ["tls/192.168.1.2:7447"]}}')
    root = tmp_path / "root"
    root.mkdir()
    own = ["--mission", "table-1", *SERIAL, "--keys", str(keys / "uav1")]

    assert install(root, "agent", "--uav", "uav1", *own, "--bus", str(file)) == 0
    assert (root / "etc/peckorder/agent-uav1.json5").read_text() == file.read_text()
    assert "/etc/peckorder/agent-uav1.json5" in options(root)


def test_program_that_services_cannot_reach_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["install", "router", "--program", "/home/pi/.venv/bin/swarm"]) == 2
    assert "where services of this machine cannot reach it" in capsys.readouterr().err


def test_a_link_that_a_service_put_into_its_folder_is_not_followed(
    tmp_path: Path, keys: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert install_agent(tmp_path, keys) == 0
    copies, elsewhere = tmp_path / "var/lib/peckorder/agent-uav1/keys", tmp_path / "elsewhere"
    shutil.rmtree(copies)
    elsewhere.mkdir(mode=0o755)
    copies.symlink_to(elsewhere)

    assert install_agent(tmp_path, keys) == 2
    assert "agent-uav1/keys" in capsys.readouterr().err
    assert list(elsewhere.iterdir()) == []
    assert stat.S_IMODE(elsewhere.stat().st_mode) == 0o755


def test_no_link_makes_anothers_secret_the_token_of_a_dashboard(tmp_path: Path) -> None:
    folder, secret = tmp_path / "var/lib/peckorder/dashboard", tmp_path / "secret"
    folder.mkdir(parents=True)
    secret.write_text("of root alone\n")
    (folder / "token").symlink_to(secret)

    assert install(tmp_path, "dashboard", "--host", "0.0.0.0") == 0
    assert not (folder / "token").is_symlink()
    assert "of root alone" not in (folder / "token").read_text()
    assert secret.read_text() == "of root alone\n"
