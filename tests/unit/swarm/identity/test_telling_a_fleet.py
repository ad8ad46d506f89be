"""A roster that is told reaches everyone on the bus, and who is out in it stops."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from dataclasses import replace

from swarm.identity.announcer import RosterAnnouncer
from swarm.identity.roster import Roster, RosterEntry
from swarm.protocol.events import (
    CommonAction,
    CommonEvent,
    Finish,
    MessageReceived,
    SnapshotsReceived,
    Stop,
)
from swarm.protocol.messages import Snapshot, roster_message
from swarm.protocol.registers import Replica
from swarm.protocol.seal import Seal
from swarm.runtime.clock import ScaledClock
from swarm.runtime.joining import join_mission
from swarm.runtime.shell import Shell
from tests.support.builders import MISSION
from tests.support.keyring import Keyring
from tests.support.memory_bus import MemoryBus, MemoryNetwork
from tests.support.shell_play import play

UAVS = ("u0", "u1", "u2")
KEYS = Keyring(*UAVS)
PACE = 20.0


class Member:
    """A core that remembers what is said, and ends when it is told to stop."""

    def __init__(self) -> None:
        self.replica = Replica()
        self.stopped = ""

    def start(self, now_s: float) -> Sequence[CommonAction]:
        return []

    def step(self, fact: CommonEvent, now_s: float) -> Sequence[CommonAction]:
        match fact:
            case MessageReceived(message):
                self.replica.join(message)
            case SnapshotsReceived(snapshots):
                for snapshot in snapshots:
                    self.replica.join_all(snapshot.messages)
            case Stop(reason):
                self.stopped = reason
                return [Finish(0)]
            case _:
                pass
        return []

    def next_deadline_s(self) -> None:
        return None


async def _run(shell: Shell[CommonEvent, CommonAction], bus: MemoryBus) -> None:
    try:
        await shell.run()
    finally:
        bus.close()


def told(
    roster: Roster, *, seals: dict[str, Seal], writers: Sequence[str] = UAVS
) -> tuple[RosterAnnouncer, dict[str, Member]]:
    """What comes of it when the operator tells ``roster`` to those with ``seals``."""
    members = {name: Member() for name in seals}

    async def tell() -> RosterAnnouncer:
        network, clock = MemoryNetwork(), ScaledClock(PACE)
        running = []
        for name, member in members.items():
            bus = network.join(name, seal=seals[name])

            def snapshot(now_s: float, name: str = name, member: Member = member) -> Snapshot:
                messages = tuple(member.replica.answers(name, ()))
                return Snapshot(MISSION, name, 1, None, messages)

            shell: Shell[CommonEvent, CommonAction] = Shell(
                member,
                bus,
                clock,
                mission=MISSION,
                name=name,
                from_bus=lambda fact: fact,
                execute=lambda _: None,
                snapshot=snapshot,
                known=member.replica.digest,
            )
            join_mission(bus, MISSION, name, status=False)
            running.append(asyncio.create_task(_run(shell, bus)))
        signed = KEYS.signed(roster).encode()
        seal = KEYS.seal("operator")
        seal.put_in_force(signed.decode())
        announcer = RosterAnnouncer(
            roster_message(MISSION, roster.version, signed.decode()), writers, 100.0
        )
        bus = network.join("operator", seal=seal)
        telling: Shell[CommonEvent, CommonAction] = Shell(
            announcer,
            bus,
            clock,
            mission=MISSION,
            name="operator",
            from_bus=lambda fact: fact,
            execute=lambda _: None,
            snapshot=None,
            known=announcer.known,
        )
        join_mission(bus, MISSION, None, status=False)
        await telling.run()
        for task in running:
            task.cancel()
        await asyncio.gather(*running, return_exceptions=True)
        return announcer

    return play(tell), members


def test_all_but_the_revoked_confirm_it_and_the_revoked_stops() -> None:
    seals = {name: KEYS.seal(name) for name in UAVS}

    announcer, members = told(KEYS.without("u1"), seals=seals)

    assert announcer.has == {"u0", "u2"}
    assert announcer.lacking == []
    assert [seals[name].roster.version for name in UAVS] == [2, 2, 2]
    assert members["u1"].stopped == "its keys were revoked or replaced"
    assert members["u0"].stopped == members["u2"].stopped == ""


def test_who_flies_with_keys_that_were_issued_anew_stops() -> None:
    seals = {name: KEYS.seal(name) for name in UAVS}
    others = tuple(entry for entry in KEYS.roster.entries if entry.name != "u1")
    (before,) = set(KEYS.roster.entries) - set(others)
    after = RosterEntry("u1", before.role, 2, bytes(32), before.not_after_s)
    entries = tuple(sorted((*others, after), key=lambda entry: entry.name))

    roster = replace(KEYS.roster, version=2, entries=entries)
    announcer, members = told(roster, seals=seals, writers=("u0", "u2"))

    assert announcer.lacking == []
    assert members["u1"].stopped
    assert not members["u0"].stopped


def test_a_fleet_that_has_a_newer_roster_already_is_not_set_back() -> None:
    newer = replace(KEYS.without("u1"), version=5)
    seals = {name: KEYS.seal(name, newer) for name in ("u0", "u2")}

    announcer, _ = told(KEYS.without("u2"), seals=seals)

    assert announcer.other_version == 5
    assert seals["u0"].roster == newer
