"""A process loads its keys, or learns in one line why it cannot."""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from swarm.identity import Role, Roster, load_identity
from swarm.identity.authority import open_authority
from swarm.identity.founding import found_authority
from swarm.runtime.errors import InputError

NOW_S = 1_800_000_000.0
DAY_S = 86_400.0
NAMES = {
    "uav1": Role.UAV,
    "coordinator": Role.COORDINATOR,
    "router": Role.ROUTER,
    "dashboard": Role.VIEWER,
    "operator": Role.OPERATOR,
}


@pytest.fixture(scope="module")
def founded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("founded")
    for name in ("keys", "foreign"):
        found_authority(folder / name, "table-1", ["uav1", "uav2"], now_s=NOW_S)
    found_authority(folder / "other-mission", "north", ["uav1"], now_s=NOW_S)
    return folder


@pytest.fixture
def keys(founded: Path, tmp_path: Path) -> Path:
    """A copy to be spoilt; beside it ``foreign`` and ``other-mission``."""
    shutil.copytree(founded, tmp_path / "all")
    return tmp_path / "all" / "keys"


@pytest.mark.parametrize(("name", "role"), NAMES.items())
def test_everyone_of_a_new_fleet_has_keys_that_load(keys: Path, name: str, role: Role) -> None:
    identity = load_identity(keys / name, name=name, roles=[role], mission="table-1", now_s=NOW_S)

    entry = identity.roster.entry(name)
    assert entry is not None
    assert (identity.common_name, identity.role) == (f"{name}@1", role)
    assert identity.private_key.public_key().public_bytes_raw() == entry.public_key
    assert identity.not_after_s == entry.not_after_s == NOW_S + 90 * DAY_S
    assert (identity.door_secret is not None) == (role is Role.ROUTER)
    assert (identity.mavlink_key_path is not None) == (role is Role.UAV)
    for path in (identity.authority_path, identity.certificate_path, identity.private_key_path):
        assert path.is_file()


def test_the_text_of_an_identity_shows_no_secret(keys: Path) -> None:
    identity = load_identity(keys / "router", now_s=NOW_S)

    assert identity.door_secret is not None
    for secret in (identity.password, identity.door_secret.hex(), repr(identity.door_secret)):
        assert secret not in repr(identity)
    assert "rivate" not in repr(identity)


def refused(path: Path, **how: Any) -> str:
    with pytest.raises(InputError) as caught:
        load_identity(path, **{"now_s": NOW_S, **how})
    (line,) = str(caught.value).splitlines()
    return line


@pytest.mark.parametrize(
    ("how", "line"),
    [
        ({"mission": "north"}, "these keys are for the mission 'table-1', not 'north'; "),
        ({"name": "uav2"}, "these keys are those of 'uav1', not of 'uav2'; give the folder of"),
        (
            {"roles": [Role.OPERATOR, Role.VIEWER]},
            (
                "these keys are those of 'uav1', whose role is uav; "
                "give those of one whose role is operator or viewer"
            ),
        ),
        (
            {"now_s": NOW_S + 91 * DAY_S},
            (
                "expired on 2027-04-15 08:00 UTC; issue a new one with 'swarm keys add DIR uav1', "
                "or set the clock, which says 2027-04-16 08:00 UTC"
            ),
        ),
        (
            {"now_s": NOW_S - 2 * DAY_S},
            (
                "is not valid before 2027-01-14 08:00 UTC; set the clock of this machine, which "
                "says 2027-01-13 08:00 UTC"
            ),
        ),
    ],
)
def test_keys_of_another_or_of_another_time_are_refused(
    keys: Path, how: dict[str, Any], line: str
) -> None:
    assert line in refused(keys / "uav1", **how)


def test_a_clock_that_is_some_hours_behind_does_not_matter(keys: Path) -> None:
    assert load_identity(keys / "uav1", now_s=NOW_S - 0.9 * DAY_S).name == "uav1"


REINSTALL = "; install the folder that 'swarm keys' made for it anew"


def _write(name: str, data: bytes) -> Callable[[Path], object]:
    return lambda folder: (folder / name).write_bytes(data)


def _swap(name: str, other: str) -> Callable[[Path], object]:
    return lambda folder: shutil.copy(folder.parent / other / name, folder / name)


@pytest.mark.parametrize(
    ("spoil", "place", "line"),
    [
        (shutil.rmtree, "", "no such folder; give the folder that 'swarm keys' made for"),
        (lambda folder: (folder / "identity.json").unlink(), "", "holds no keys: there is no"),
        (_write("identity.json", b"{"), "/identity.json", f"is damaged{REINSTALL}"),
        (_write("identity.json", b"[" * 9999), "/identity.json", f"is damaged{REINSTALL}"),
        (_write("identity.json", b"{}"), "/identity.json", f"is damaged{REINSTALL}"),
        (lambda folder: (folder / "private.key").unlink(), "/private.key", "is missing"),
        (
            lambda folder: (folder / "private.key").chmod(0o640),
            "/private.key",
            "is open to others (mode 0640); close it: chmod 600 ",
        ),
        (
            lambda folder: (folder / "mavlink.key").chmod(0o604),
            "/mavlink.key",
            "is open to others (mode 0604); close it: chmod 600 ",
        ),
        (_write("private.key", b"secret"), "/private.key", "is damaged: it holds no private key"),
        (_write("certificate.pem", b"x"), "/certificate.pem", "is damaged: it holds no certif"),
        (_write("authority.pem", b"x"), "/authority.pem", "is damaged: it holds no certificate"),
        (_write("door.password", b"secret"), "/door.password", "is damaged: it is not 64 hexadec"),
        (_write("roster.json", b"x"), "/roster.json", "is damaged: it is no roster"),
        (
            _swap("private.key", "uav2"),
            "/private.key",
            "is not the key of the certificate.pem beside it",
        ),
        (
            _swap("certificate.pem", "../foreign/uav1"),
            "/certificate.pem",
            "is not issued by the authority.pem beside it",
        ),
        (
            _swap("roster.json", "../foreign/uav1"),
            "/roster.json",
            "is damaged: it is not signed by this mission's authority",
        ),
        (
            _swap("identity.json", "uav2"),
            "/certificate.pem",
            "is for 'uav1@1', identity.json for 'uav2@1'",
        ),
    ],
)
def test_what_is_wrong_with_a_folder_is_said_in_one_line(
    keys: Path, spoil: Callable[[Path], object], place: str, line: str
) -> None:
    spoil(keys / "uav1")

    told = refused(keys / "uav1")

    assert told.startswith(f"{keys / 'uav1'}{place}: {line}")
    assert "secret" not in told


def test_the_authority_flies_nothing_itself(keys: Path) -> None:
    assert refused(keys) == (
        f"{keys}: is the folder of the authority, which no process flies with; "
        f"give one within it, such as {keys}/uav1"
    )


def test_a_file_is_no_folder(keys: Path) -> None:
    assert "/uav1/identity.json: is no folder; give" in refused(keys / "uav1" / "identity.json")


@pytest.mark.parametrize("reissued", [False, True])
def test_keys_that_were_revoked_or_replaced_are_refused(keys: Path, *, reissued: bool) -> None:
    shutil.copytree(keys / "uav1", keys.parent / "old")
    authority = open_authority(keys)
    authority.revoke(["uav1"])
    if reissued:
        authority.issue({"uav1": Role.UAV}, now_s=NOW_S)
    shutil.copy(keys / "uav2" / "roster.json", keys.parent / "old")

    assert refused(keys.parent / "old") == (
        f"{keys.parent}/old/roster.json: uav1@1 is not in this roster "
        f"(version {3 + reissued}); it was revoked or replaced: install the newest folder of "
        "'uav1', which 'swarm keys add' makes"
    )


def test_a_newer_roster_is_kept_and_an_older_one_is_not(keys: Path) -> None:
    identity = load_identity(keys / "uav1", now_s=NOW_S)
    shutil.copytree(keys / "uav1", keys.parent / "flying")
    flying = load_identity(keys.parent / "flying", now_s=NOW_S)
    authority = open_authority(keys)
    old = authority.roster_bytes()
    authority.revoke(["uav2"])
    new = authority.roster_bytes()

    assert flying.keep_roster(new) == authority.roster
    assert flying.keep_roster(old) == identity.roster

    kept = load_identity(keys.parent / "flying", now_s=NOW_S).roster
    assert kept == authority.roster
    assert (keys.parent / "flying" / "roster.json").stat().st_mode & 0o777 == 0o600


@pytest.mark.parametrize(
    ("other", "problem"),
    [("foreign", "not signed by this mission's authority"), ("other-mission", "not signed")],
)
def test_another_s_roster_is_not_kept(keys: Path, other: str, problem: str) -> None:
    identity = load_identity(keys / "uav1", now_s=NOW_S)
    before = (keys / "uav1" / "roster.json").read_bytes()

    with pytest.raises(ValueError, match=problem):
        identity.keep_roster((keys.parent / other / "roster.json").read_bytes())

    assert (keys / "uav1" / "roster.json").read_bytes() == before


def test_a_damaged_roster_on_disk_is_replaced(keys: Path) -> None:
    identity = load_identity(keys / "uav1", now_s=NOW_S)
    path = keys / "uav1" / "roster.json"
    data = path.read_bytes()
    path.write_bytes(b"")

    roster: Roster = identity.keep_roster(data)

    assert roster == identity.roster
    assert path.read_bytes() == data


def test_without_keys_the_cryptography_library_is_not_loaded() -> None:
    code = (
        "import sys, swarm.identity.cli, swarm.identity.shared_secrets, swarm.identity.authority\n"
        "sys.exit(any(name.startswith('cryptography') for name in sys.modules))"
    )

    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
