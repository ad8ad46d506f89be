"""An authority hands out what belongs together, never twice, and readable by nobody else."""

from __future__ import annotations

import csv
import hashlib
import os
import shutil
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from swarm.identity import Role, decode_roster, load_identity
from swarm.identity.authority import Authority, open_authority
from swarm.identity.founding import found_authority
from swarm.identity.shared_secrets import door_dictionary, door_password
from swarm.runtime.errors import InputError

NOW_S = 1_800_000_000.0
DAY_S = 86_400.0


@pytest.fixture
def authority(tmp_path: Path) -> Authority:
    return found_authority(tmp_path / "keys", "table-1", ["uav1", "uav2"], now_s=NOW_S)


def everything_in(folder: Path) -> Iterator[Path]:
    return folder.rglob("*")


def phrases(authority: Authority) -> dict[str, str]:
    with authority.mavlink_table.open() as file:
        return {row["uav"]: row["pass_phrase"] for row in csv.DictReader(file)}


@pytest.mark.parametrize("umask", [0o000, 0o077, 0o777])
def test_nobody_else_can_read_anything_whatever_the_umask(tmp_path: Path, umask: int) -> None:
    before = os.umask(umask)
    try:
        authority = found_authority(tmp_path / "keys", "m", ["uav1"], now_s=NOW_S)
        authority.issue({"uav1": Role.UAV, "uav2": Role.UAV}, now_s=NOW_S)
        authority.revoke(["uav2"])
    finally:
        os.umask(before)

    assert (tmp_path / "keys").stat().st_mode & 0o777 == 0o700
    for path in everything_in(tmp_path / "keys"):
        assert path.stat().st_mode & 0o777 == (0o700 if path.is_dir() else 0o600), path


def test_nothing_is_left_beside_what_was_made(authority: Authority, tmp_path: Path) -> None:
    authority.issue({"uav1": Role.UAV}, now_s=NOW_S)
    authority.renew(now_s=NOW_S)

    names = {path.name for path in (tmp_path / "keys").iterdir() if path.is_dir()}
    assert names == {"uav1", "uav2", "coordinator", "router", "dashboard", "operator"}
    assert [path.name for path in tmp_path.iterdir()] == ["keys"]
    assert not [path for path in everything_in(tmp_path) if path.name.startswith(".")]


def test_secrets_go_where_they_belong(authority: Authority) -> None:
    def holders(name: str) -> set[str]:
        return {path.parent.name for path in authority.directory.glob(f"*/{name}")}

    assert holders("authority.key") == set()
    assert holders("mavlink-keys.csv") == set()
    assert holders("door.key") == {"router"}
    assert holders("mavlink.key") == {"uav1", "uav2"}
    secrets = [authority.directory.glob(f"*/{name}") for name in ("private.key", "door.password")]
    for paths in secrets:
        texts = [path.read_bytes() for path in paths]
        assert len(set(texts)) == len(texts) == 6


def test_several_of_a_kind_are_numbered(tmp_path: Path) -> None:
    authority = found_authority(
        tmp_path / "keys", "m", ["a"], now_s=NOW_S, coordinators=2, routers=3, dashboards=0
    )

    names = [entry.name for entry in authority.roster.entries]
    assert names == sorted(
        ["a", "coordinator", "coordinator-2", "router", "router-2", "router-3", "operator"]
    )


def test_the_door_password_is_the_one_that_routers_expect(authority: Authority) -> None:
    router = load_identity(authority.folder("router"), now_s=NOW_S)
    uav = load_identity(authority.folder("uav1"), now_s=NOW_S)
    assert router.door_secret is not None

    expected = door_dictionary(router.roster, router.door_secret)

    assert expected["uav1@1"] == uav.password
    assert len(expected) == len(set(expected.values())) == 6
    assert door_password(router.door_secret, "uav1@2") not in expected.values()


def test_an_authority_is_never_overwritten(authority: Authority) -> None:
    before = {
        path: path.read_bytes() for path in everything_in(authority.directory) if path.is_file()
    }

    with pytest.raises(InputError, match="is an authority's folder already; add to it with"):
        found_authority(authority.directory, "m", ["uav1"], now_s=NOW_S)

    after = {
        path: path.read_bytes() for path in everything_in(authority.directory) if path.is_file()
    }
    assert after == before


def test_a_folder_in_use_or_a_file_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "used").mkdir()
    (tmp_path / "used" / "notes").touch()

    with pytest.raises(InputError, match="used: is not empty; choose a new folder"):
        found_authority(tmp_path / "used", "m", ["uav1"], now_s=NOW_S)
    with pytest.raises(InputError, match="notes: is a file; choose a new folder"):
        found_authority(tmp_path / "used" / "notes", "m", ["uav1"], now_s=NOW_S)


def test_an_empty_folder_is_used_and_those_above_it_are_made(tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir(mode=0o755)

    found_authority(tmp_path / "empty", "m", ["uav1"], now_s=NOW_S)
    found_authority(tmp_path / "a" / "b", "m", ["uav1"], now_s=NOW_S)

    assert (tmp_path / "empty").stat().st_mode & 0o777 == 0o700
    assert (tmp_path / "a" / "b" / "uav1").is_dir()


@pytest.mark.parametrize(
    ("uavs", "problem"),
    [
        (["router"], "UAV id 'router' is the name of the router's keys"),
        (["operator"], "UAV id 'operator' is the name of the operator's keys"),
        (["dashboard"], "UAV id 'dashboard' is the name of the viewer's keys"),
        (["fleet"], "'fleet' names the whole fleet, not a uav"),
        (["authority"], "'authority' names the mission authority, not a uav"),
        (["authority.pem"], "'authority.pem' is the name of a file of the authority"),
        (["Roster.json"], "'Roster.json' differs from 'roster.json' in capital letters alone"),
        (["uav1", "UAV1"], "'UAV1' differs from 'uav1' in capital letters alone"),
        (["u" * 64], "more than the 64 characters"),
    ],
)
def test_uavs_whose_names_are_taken_are_refused_before_anything_is_made(
    tmp_path: Path, uavs: list[str], problem: str
) -> None:
    with pytest.raises(InputError) as caught:
        found_authority(tmp_path / "keys", "m", uavs, now_s=NOW_S)

    assert problem in str(caught.value)
    assert str(caught.value).endswith("name the UAV otherwise in the scenario")
    assert list(tmp_path.iterdir()) == []


def test_issuing_anew_replaces_the_certificate_and_keeps_the_mavlink_key(
    authority: Authority,
) -> None:
    before, phrase = load_identity(authority.folder("uav1"), now_s=NOW_S), phrases(authority)
    key = (authority.folder("uav1") / "mavlink.key").read_text()

    roster = authority.issue({"uav1": Role.UAV}, now_s=NOW_S + DAY_S, days=10)

    after = load_identity(authority.folder("uav1"), now_s=NOW_S + DAY_S)
    assert (after.common_name, after.not_after_s) == ("uav1@2", NOW_S + 11 * DAY_S)
    assert after.password != before.password
    assert roster.version == before.roster.version + 1
    assert roster.series == before.roster.series
    assert phrases(authority) == phrase
    assert (authority.folder("uav1") / "mavlink.key").read_text() == key


def test_what_is_issued_after_a_revocation_shares_nothing_with_what_was(
    authority: Authority,
) -> None:
    before, phrase = load_identity(authority.folder("uav1"), now_s=NOW_S), phrases(authority)

    authority.revoke(["uav1"])

    assert not authority.folder("uav1").exists()
    assert set(phrases(authority)) == {"uav2"}
    authority.issue({"uav1": Role.UAV}, now_s=NOW_S)
    after = load_identity(authority.folder("uav1"), now_s=NOW_S)
    assert after.common_name == "uav1@2"
    assert after.private_key.public_key() != before.private_key.public_key()
    assert phrases(authority)["uav1"] != phrase["uav1"]
    assert phrases(authority)["uav2"] == phrase["uav2"]


def test_the_mavlink_key_is_what_ground_stations_make_of_the_phrase(authority: Authority) -> None:
    for uav, phrase in phrases(authority).items():
        key = (authority.folder(uav) / "mavlink.key").read_text().strip()
        assert key == hashlib.sha256(phrase.encode()).hexdigest()
        assert phrase.isalnum()


def test_generations_go_on_after_a_second_revocation(authority: Authority) -> None:
    for generation in (2, 3):
        authority.revoke(["uav1"])
        authority.issue({"uav1": Role.UAV}, now_s=NOW_S)
        assert load_identity(authority.folder("uav1"), now_s=NOW_S).generation == generation


def test_every_folder_that_is_still_there_gets_the_new_roster(authority: Authority) -> None:
    shutil.rmtree(authority.folder("uav2"))

    authority.revoke(["uav1"])

    for name in ("coordinator", "router", "dashboard", "operator"):
        roster = load_identity(authority.folder(name), now_s=NOW_S).roster
        assert (roster.version, roster.entry("uav1")) == (3, None)
    assert not authority.folder("uav2").exists()


def test_renewing_begins_a_series_in_which_nothing_from_before_counts(
    authority: Authority,
) -> None:
    authority.revoke(["uav2"])
    names = [entry.name for entry in authority.roster.entries]
    before = [load_identity(authority.folder(name), now_s=NOW_S) for name in names]
    key = (authority.folder("uav1") / "mavlink.key").read_text()

    roster = authority.renew(now_s=NOW_S + 80 * DAY_S)

    after = [load_identity(authority.folder(name), now_s=NOW_S + 160 * DAY_S) for name in names]
    assert [one.name for one in after] == [entry.name for entry in roster.entries] == names
    assert roster.series != before[0].roster.series
    assert roster.supersedes(before[0].roster)
    for old, new in zip(before, after, strict=True):
        assert new.generation == old.generation + 1
        assert new.password != old.password
        assert new.private_key.public_key() != old.private_key.public_key()
    assert after[names.index("router")].door_secret != before[names.index("router")].door_secret
    assert (authority.folder("uav1") / "mavlink.key").read_text() == key


@pytest.mark.parametrize(
    ("names", "problem"),
    [
        (["uav9"], "nobody is named 'uav9'; choose of coordinator, dashboard, operator, router, "),
        (["uav1", "gone"], "'gone' is revoked already; leave it out"),
    ],
)
def test_only_who_is_in_force_is_revoked_and_else_nothing_happens(
    authority: Authority, names: list[str], problem: str
) -> None:
    authority.issue({"gone": Role.VIEWER}, now_s=NOW_S)
    authority.revoke(["gone"])
    version = authority.roster.version

    with pytest.raises(InputError, match=problem):
        authority.revoke(names)

    assert open_authority(authority.directory).roster.version == version
    assert authority.folder("uav1").exists()


def test_a_name_keeps_its_role_also_when_it_was_revoked(authority: Authority) -> None:
    authority.revoke(["dashboard"])

    with pytest.raises(InputError, match="'dashboard' is the name of a viewer, and no operator"):
        authority.issue({"dashboard": Role.OPERATOR}, now_s=NOW_S)


def test_no_certificate_outlives_its_authority(authority: Authority) -> None:
    with pytest.raises(InputError, match="would outlive the authority's own; choose fewer days"):
        authority.issue({"uav1": Role.UAV}, now_s=NOW_S + 3600 * DAY_S)

    assert open_authority(authority.directory).issued["uav1"].generation == 1


def test_a_renewal_that_is_refused_changes_nothing(authority: Authority) -> None:
    before = {path: path.read_bytes() for path in authority.directory.iterdir() if path.is_file()}

    with pytest.raises(InputError, match="would outlive"):
        authority.renew(now_s=NOW_S, days=4000)

    for path, data in before.items():
        assert path.read_bytes() == data, path


def test_a_mavlink_key_does_not_outlive_a_revocation_that_was_cut_short(
    authority: Authority,
) -> None:
    table, phrase = authority.mavlink_table.read_bytes(), phrases(authority)
    authority.revoke(["uav1"])
    authority.mavlink_table.write_bytes(table)

    authority.issue({"uav1": Role.UAV}, now_s=NOW_S)

    assert phrases(authority)["uav1"] != phrase["uav1"]
    assert phrases(authority)["uav2"] == phrase["uav2"]


def test_commands_at_one_time_do_not_undo_each_other(authority: Authority) -> None:
    def add(name: str) -> None:
        open_authority(authority.directory).issue({name: Role.UAV}, now_s=NOW_S)

    threads = [threading.Thread(target=add, args=(f"late{number}",)) for number in range(6)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()

    roster = open_authority(authority.directory).roster
    assert roster.version == 2 + len(threads)
    assert all(roster.entry(f"late{number}") for number in range(len(threads)))


def test_a_roster_that_could_not_be_written_leaves_the_old_one_in_force(
    authority: Authority, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(source: Path, target: Path) -> Path:
        if target.name == "roster.json":
            raise OSError(28, "No space left on device")
        os.replace(source, target)  # noqa: PTH105 - Path.replace is what is patched
        return target

    monkeypatch.setattr(Path, "replace", full)
    with pytest.raises(OSError, match="No space left"):
        authority.issue({"uav1": Role.UAV}, now_s=NOW_S)
    monkeypatch.undo()

    assert load_identity(authority.folder("uav1"), now_s=NOW_S).generation == 1
    again = open_authority(authority.directory)
    again.issue({"uav1": Role.UAV}, now_s=NOW_S)
    assert load_identity(authority.folder("uav1"), now_s=NOW_S).generation == 3


@pytest.mark.parametrize(
    ("name", "data", "problem"),
    [
        ("issued.json", None, "is missing; put a copy of the authority's folder back"),
        ("issued.json", b"{}", "is damaged: it is no list of this version; put a copy"),
        ("roster.json", b"x", "is damaged: it is no roster; put a copy"),
        ("authority.key", b"x", "is damaged: it holds no private key; put a copy"),
        ("authority.pem", b"x", "is damaged: it holds no certificate; put a copy"),
    ],
)
def test_a_damaged_authority_says_what_is_wrong_with_it(
    authority: Authority, name: str, data: bytes | None, problem: str
) -> None:
    path = authority.directory / name
    path.unlink()
    if data is not None:
        path.touch(mode=0o600)
        path.write_bytes(data)

    with pytest.raises(InputError) as caught:
        open_authority(authority.directory)

    assert str(caught.value).startswith(f"{path}: {problem}")


def test_the_authority_s_key_is_read_by_nobody_else(authority: Authority) -> None:
    (authority.directory / "authority.key").chmod(0o644)

    with pytest.raises(InputError, match=r"authority.key: is open to others \(mode 0644\); close"):
        open_authority(authority.directory)


def test_the_roster_travels_as_bytes(authority: Authority) -> None:
    assert decode_roster(authority.roster_bytes(), authority.public_key) == authority.roster
