"""A change reaches the fleet, or is not made, or it is said who does not know of it."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Collection
from pathlib import Path

import pytest

from swarm.bus.config import BusConfig
from swarm.identity import decode_roster
from swarm.identity.authority import Authority
from swarm.identity.changes import FleetAddress, enact, told
from swarm.identity.founding import found_authority
from swarm.runtime.clock import unix_s
from swarm.runtime.errors import BusError, InputError, SwarmError

ROUTER = "tls/127.0.0.1:7447"


@pytest.fixture
def authority(tmp_path: Path) -> Authority:
    return found_authority(tmp_path / "keys", "table-1", ["uav1"], now_s=unix_s(), operators=2)


def fleet(authority: Authority, name: str = "operator", connect: str = ROUTER) -> FleetAddress:
    return FleetAddress("router", "", [connect] if connect else None, authority.folder(name))


def revoking(authority: Authority, name: str = "uav1") -> Callable[[], object]:
    return lambda: authority.revoke([name])


def test_without_a_fleet_the_change_is_made_and_how_to_tell_it_is_said(
    authority: Authority,
) -> None:
    line = enact(authority, revoking(authority), fleet(authority, connect=""), ["uav1"])

    assert line == (
        "roster version 3; tell a running fleet: "
        f"swarm keys publish {authority.directory} --connect ENDPOINT"
    )


def test_the_roster_that_is_told_is_the_one_after_the_change(authority: Authority) -> None:
    def publish(config: BusConfig, change: Callable[[], bytes]) -> Collection[str]:
        assert config.identity is not None
        assert (config.identity.name, config.endpoints) == ("operator", (ROUTER,))
        assert authority.roster.version == 2, "changed before the bus was reached"
        roster = decode_roster(change(), authority.public_key)
        assert (roster.version, roster.entry("uav1")) == (3, None)
        return ["coordinator"]

    line = enact(authority, revoking(authority), fleet(authority), ["uav1"], publish)

    assert line == "roster version 3 published; confirmed by coordinator"


def test_where_no_fleet_is_reached_nothing_is_changed(authority: Authority) -> None:
    def unreachable(config: BusConfig, change: Callable[[], bytes]) -> Collection[str]:
        raise BusError("cannot reach the bus")

    with pytest.raises(SwarmError, match="cannot reach the bus; nothing was changed"):
        enact(authority, revoking(authority), fleet(authority), ["uav1"], unreachable)

    assert authority.roster.entry("uav1") is not None


def test_a_bus_that_is_lost_after_the_change_does_not_say_that_nothing_was_changed(
    authority: Authority,
) -> None:
    def lost(config: BusConfig, change: Callable[[], bytes]) -> Collection[str]:
        change()
        raise BusError("the bus has gone")

    with pytest.raises(BusError, match=r"^the bus has gone$"):
        enact(authority, revoking(authority), fleet(authority), ["uav1"], lost)


@pytest.mark.parametrize("name", ["operator", "operator-2"])
def test_no_fleet_is_told_with_the_keys_that_change(authority: Authority, name: str) -> None:
    with pytest.raises(InputError, match=f"the keys of '{name}' are themselves to be changed"):
        enact(authority, revoking(authority, name), fleet(authority, name), [name])

    assert authority.roster.version == 2


def test_only_an_operator_or_a_coordinator_tells(authority: Authority) -> None:
    with pytest.raises(InputError, match="whose role is coordinator or operator"):
        enact(authority, revoking(authority), fleet(authority, "dashboard"), ["uav1"])


def test_keys_of_another_authority_tell_nothing(authority: Authority, tmp_path: Path) -> None:
    found_authority(tmp_path / "other", "table-1", ["uav1"], now_s=unix_s())
    shutil.copytree(tmp_path / "other" / "operator", tmp_path / "foreign")
    foreign = FleetAddress("router", "", [ROUTER], tmp_path / "foreign")

    with pytest.raises(InputError, match=r"--as: .*foreign: these keys are from another authority"):
        enact(authority, revoking(authority), foreign, ["uav1"])

    assert authority.roster.version == 2


def test_where_nobody_is_that_is_said() -> None:
    assert told(7, []) == "roster version 7 published; nobody is there to confirm it"
