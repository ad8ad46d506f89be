"""A process loads its keys, or learns in one line why it cannot."""

from __future__ import annotations

from pathlib import Path

import pytest

from swarm.errors import InputError
from swarm.identity import Role, load_identity
from swarm.identity.founding import found_authority

NOW_S = 1_800_000_000.0


@pytest.fixture
def keys(tmp_path: Path) -> Path:
    found_authority(tmp_path / "keys", "table-1", ["uav1", "uav2"], now_s=NOW_S)
    return tmp_path / "keys"


@pytest.mark.parametrize(
    ("name", "role"),
    [
        ("uav1", Role.UAV),
        ("coordinator", Role.COORDINATOR),
        ("router", Role.ROUTER),
        ("dashboard", Role.VIEWER),
        ("operator", Role.OPERATOR),
    ],
)
def test_everyone_of_a_new_fleet_has_keys_that_load(keys: Path, name: str, role: Role) -> None:
    identity = load_identity(keys / name, name=name, roles=[role], mission="table-1", now_s=NOW_S)

    entry = identity.roster.entry(name)
    assert entry is not None
    assert (identity.common_name, identity.role) == (f"{name}@1", role)
    assert identity.private_key.public_key().public_bytes_raw() == entry.public_key
    assert (identity.door_secret is not None) == (role is Role.ROUTER)
    assert (identity.mavlink_key_path is not None) == (role is Role.UAV)


def test_expired_keys_say_when_they_ended_and_what_to_do(keys: Path) -> None:
    with pytest.raises(InputError, match=r"expired on .*; issue a new one with 'swarm keys add"):
        load_identity(keys / "uav1", now_s=NOW_S + 91 * 86_400)
