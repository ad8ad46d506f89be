"""Which roster a router goes by, and who is shut out of it."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from pathlib import Path

import pytest

from swarm.bus.router import FLOOD_BURST, RosterKeeper
from swarm.identity import load_identity
from swarm.identity.authority import Authority
from swarm.identity.folder import ROSTER_FILE
from swarm.identity.founding import found_authority
from swarm.model.ids import AUTHORITY
from swarm.protocol.encoding import encode
from swarm.protocol.messages import Message, SignedRoster, Stamp
from swarm.runtime.clock import unix_s

Play = Callable[[RosterKeeper], Awaitable[None]]


@pytest.fixture
def authority(tmp_path: Path) -> Authority:
    return found_authority(tmp_path / "keys", "m", ["uav1", "uav2"], now_s=unix_s())


def play(authority: Authority, scenario: Play) -> RosterKeeper:
    """Rosters of its router after the scenario."""
    rosters = RosterKeeper(load_identity(authority.folder("router")), look_s=0.01)
    asyncio.run(_within_limit(scenario(rosters)))
    return rosters


async def _within_limit(playing: Awaitable[None]) -> None:
    async with asyncio.timeout(5.0):
        await playing


def tell_nobody(key: str, data: bytes) -> None:
    """A bus without anybody."""


def said(authority: Authority) -> bytes:
    """The roster in force as the bus carries it."""
    signed = authority.roster_bytes().decode()
    stamp = Stamp(authority.roster.version, 0)
    return encode(Message("m", AUTHORITY, stamp, SignedRoster(signed)))


def test_a_newer_roster_in_the_folder_counts(authority: Authority) -> None:
    async def scenario(rosters: RosterKeeper) -> None:
        authority.revoke(["uav1"])
        await rosters.wait_for_change(tell_nobody)

    assert play(authority, scenario).roster.entry("uav1") is None


def test_a_newer_roster_on_the_bus_counts_and_is_kept(authority: Authority) -> None:
    file = authority.folder("router") / ROSTER_FILE
    before = file.read_bytes()

    async def scenario(rosters: RosterKeeper) -> None:
        authority.revoke(["uav1"])
        newer = file.read_bytes()
        file.write_bytes(before)  # as on a machine of its own
        rosters.look()
        assert rosters.roster.entry("uav1") is not None
        rosters.hear(rosters.key, said(authority))
        await rosters.wait_for_change(tell_nobody)
        assert file.read_bytes() == newer

    assert play(authority, scenario).roster.entry("uav1") is None


def test_an_older_roster_and_what_is_none_change_nothing(
    authority: Authority, tmp_path: Path
) -> None:
    older = said(authority)
    authority.revoke(["uav2"])
    file = authority.folder("router") / ROSTER_FILE
    foreign = found_authority(tmp_path / "other", "m", ["uav1", "uav2"], now_s=unix_s())

    async def scenario(rosters: RosterKeeper) -> None:
        in_force = rosters.roster
        for data in (older, said(foreign), b"", b"no roster", b"\x91" * 100_000):
            rosters.hear(rosters.key, data)
        for data in (foreign.roster_bytes(), b"no roster", b"\xff" * 10):
            file.write_bytes(data)
            rosters.look()
        file.unlink()
        rosters.look()
        assert rosters.roster is in_force
        with pytest.raises(TimeoutError):
            async with asyncio.timeout(0.03):
                await rosters.wait_for_change(tell_nobody)

    play(authority, scenario)


def test_the_roster_is_told_to_who_has_missed_it(authority: Authority) -> None:
    async def scenario(rosters: RosterKeeper) -> None:
        told: asyncio.Future[tuple[str, bytes]] = asyncio.get_running_loop().create_future()
        waiting = asyncio.create_task(
            rosters.wait_for_change(lambda key, data: told.set_result((key, data)))
        )
        assert await told == ("swarm/m/roster", said(authority))
        waiting.cancel()

    play(authority, scenario)


def test_who_floods_is_shut_out_until_it_has_new_keys(authority: Authority) -> None:
    async def scenario(rosters: RosterKeeper) -> None:
        floods = [
            rosters.flooding(rosters.roster.entry("uav1"), 0.0) for _ in range(FLOOD_BURST + 1)
        ]
        assert floods == [None] * FLOOD_BURST + ["uav1@1"]
        rosters.shut_out("uav1@1")
        rosters.shut_out("uav1@1")
        rosters.shut_out("nobody@1")
        await rosters.wait_for_change(tell_nobody)
        assert [each.name for each in rosters.let_in.entries if each.role == "uav"] == ["uav2"]
        assert rosters.roster.entry("uav1") is not None
        authority.issue({"uav1": rosters.roster.entries[-1].role}, now_s=unix_s())
        await rosters.wait_for_change(tell_nobody)
        rosters.shut_out("uav1@1")  # of its old keys, and told late
        assert rosters.flooding(rosters.roster.entry("uav1"), 0.0) is None
        assert rosters.flooding(rosters.roster.entry("coordinator"), 0.0) is None

    assert play(authority, scenario).let_in.entry("uav1") is not None


def test_an_honest_uav_is_never_taken_for_a_flood(authority: Authority) -> None:
    """Not at 200 sayings a second for a minute, nor when it greets 200 others at once."""
    rosters = RosterKeeper(load_identity(authority.folder("router")))

    assert not any(rosters.flooding(rosters.roster.entry("uav1"), n / 200.0) for n in range(12_000))
    assert not any(rosters.flooding(rosters.roster.entry("uav1"), 100.0) for _ in range(1000))
