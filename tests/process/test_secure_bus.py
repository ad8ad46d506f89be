"""Who gets onto a bus with keys, and who may say what there; at a router and in a mesh."""

from __future__ import annotations

import asyncio
import contextlib
import json
import shutil
from collections.abc import AsyncIterator, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from swarm.bus.config import BusConfig, ClientTopology, FileTopology, MeshTopology, Topology
from swarm.bus.loopback import free_loopback_endpoints
from swarm.bus.port import LinkDown, LinkUp, Query, Sample, TokenSeen
from swarm.bus.zenoh_bus import open_zenoh_bus
from swarm.bus.zenoh_session import lay_over, open_session, session_config
from swarm.identity import Identity, Role, load_identity
from swarm.identity.authority import Authority
from swarm.identity.founding import found_authority
from swarm.protocol.key_space import KeySpace
from swarm.runtime.clock import unix_s
from swarm.runtime.errors import BusError, InputError
from tests.contract.bus_fleet import LIMIT_S, Reader
from tests.process.router_processes import router

pytestmark = pytest.mark.process

MISSION = "m"
KEYS = KeySpace(MISSION)
DAY_S = 86_400.0
REFUSED_S = 0.3
"""A router refuses within milliseconds; whoever is let in is so as soon."""


@dataclass(frozen=True)
class Fleet:
    """Keys, and a router that knows them."""

    folder: Path
    authority: Authority
    endpoint: str

    def identity(self, name: str) -> Identity:
        return load_identity(self.folder / name)


def to_tls(endpoint: str) -> str:
    return endpoint.replace("tcp/", "tls/")


@pytest.fixture(scope="module")
def fleet(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Fleet]:
    folder = tmp_path_factory.mktemp("fleet") / "keys"
    uavs = ["uav1", "uav2", "uav3", "stolen"]
    authority = found_authority(
        folder, MISSION, uavs, now_s=unix_s(), coordinators=2, routers=2, dashboards=2
    )
    authority.issue({"late": Role.UAV}, now_s=unix_s() - 3.0 * DAY_S, days=1.0)
    authority.issue({"lost": Role.UAV}, now_s=unix_s())
    shutil.copytree(folder / "lost", folder.parent / "lost")
    authority.revoke(["lost"])
    options = ("--keys", str(folder / "router"), "--listen", "tls/127.0.0.1:0")
    with router(*options) as (_, endpoint):
        yield Fleet(folder, authority, endpoint)


@contextlib.asynccontextmanager
async def seated(identity: Identity, topology: Topology) -> AsyncIterator[Reader]:
    bus = await open_zenoh_bus(BusConfig(topology, identity=identity), timeout_s=LIMIT_S)
    try:
        yield Reader(bus)
    finally:
        bus.close()


# -- who gets in --------------------------------------------------------------------------


def foreign(fleet: Fleet, tmp_path: Path) -> Identity:
    found_authority(tmp_path / "keys", MISSION, ["uav1"], now_s=unix_s())
    return load_identity(tmp_path / "keys" / "uav1")


def foreign_that_trusts_the_router(fleet: Fleet, tmp_path: Path) -> Identity:
    stranger = foreign(fleet, tmp_path)
    shutil.copy(fleet.folder / "authority.pem", stranger.authority_path)
    return stranger


def expired(fleet: Fleet, tmp_path: Path) -> Identity:
    return load_identity(fleet.folder / "late", now_s=unix_s() - 2.5 * DAY_S)


def revoked(fleet: Fleet, tmp_path: Path) -> Identity:
    return load_identity(fleet.folder.parent / "lost")


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (foreign, "who listens at .* is no router of this mission"),
        (foreign_that_trusts_the_router, "another mission's: it does not know our authority"),
        (expired, "the own certificate expired on"),
        (revoked, "still refuses lost@1: its keys are revoked"),
    ],
)
def test_who_does_not_belong_is_refused_and_told_why(
    fleet: Fleet, tmp_path: Path, make: object, says: str
) -> None:
    assert callable(make)
    identity = make(fleet, tmp_path)

    async def scenario() -> None:
        config = BusConfig(ClientTopology((fleet.endpoint,)), identity=identity)
        with pytest.raises(BusError, match=says):
            await open_zenoh_bus(config, timeout_s=REFUSED_S)

    asyncio.run(scenario())


def test_who_forgot_its_keys_is_told_so(fleet: Fleet) -> None:
    async def scenario() -> None:
        config = BusConfig(ClientTopology((fleet.endpoint.replace("tls/", "tcp/"),)))
        with pytest.raises(BusError, match=r"speaks encrypted.*give --keys DIR"):
            await open_zenoh_bus(config, timeout_s=REFUSED_S)

    asyncio.run(scenario())


@pytest.mark.parametrize("protocol", ["tls", "tcp"])
def test_without_a_certificate_nobody_gets_in(fleet: Fleet, protocol: str) -> None:
    endpoint = fleet.endpoint.replace("tls/", f"{protocol}/")
    config = session_config("client", listen=[], connect=[endpoint], lease_s=1.0)
    trusted = str(fleet.folder / "authority.pem")
    tls = "transport/link/tls"
    lay_over(
        config, {f"{tls}/root_ca_certificate": trusted, f"{tls}/verify_name_on_connect": False}
    )

    with pytest.raises(BusError, match="cannot reach the bus"):
        asyncio.run(open_session(config, timeout_s=REFUSED_S))


def test_a_uav_cannot_pass_for_a_router(fleet: Fleet, tmp_path: Path) -> None:
    """Neither by our command, nor by a session of its own."""
    uav = fleet.identity("uav1")
    (endpoint,) = map(to_tls, free_loopback_endpoints(1, np.random.default_rng()))
    false_router = session_config("router", listen=[endpoint], connect=[], lease_s=1.0)
    tls = "transport/link/tls"
    files = {
        "root_ca_certificate": uav.authority_path,
        "listen_certificate": uav.certificate_path,
        "listen_private_key": uav.private_key_path,
    }
    lay_over(false_router, {f"{tls}/{name}": str(path) for name, path in files.items()})

    async def scenario() -> None:
        session = await open_session(false_router, timeout_s=LIMIT_S)
        try:
            config = BusConfig(ClientTopology((endpoint,)), identity=fleet.identity("uav2"))
            with pytest.raises(BusError, match="is no router of this mission"):
                await open_zenoh_bus(config, timeout_s=REFUSED_S)
        finally:
            session.close()
        mesh = BusConfig(MeshTopology(endpoint), identity=uav)
        with pytest.raises(InputError, match="refuse to dial 'uav1'"):
            await open_zenoh_bus(mesh)

    asyncio.run(scenario())


def test_keys_count_with_a_file_of_the_users_too(fleet: Fleet, tmp_path: Path) -> None:
    def file(endpoint: str) -> FileTopology:
        path = tmp_path / "zenoh.json5"
        path.write_text(
            json.dumps({"mode": "client", "connect": {"endpoints": [endpoint]}, "scouting": {}})
        )
        return FileTopology(path)

    async def scenario() -> None:
        async with seated(fleet.identity("uav1"), file(fleet.endpoint)) as reader:
            await reader.until_event(LinkUp())
        plain = BusConfig(file("tcp/127.0.0.1:7447"), identity=fleet.identity("uav1"))
        with pytest.raises(InputError, match=r"tcp/127\.0\.0\.1:7447 is not encrypted"):
            await open_zenoh_bus(plain)

    asyncio.run(scenario())


# -- who may say what -----------------------------------------------------------------------

REGISTERS = (
    KEYS.brief,
    KEYS.plan,
    KEYS.board("t1"),
    KEYS.roster,
    KEYS.operator("uav1"),
    KEYS.operator_task("t1"),
    *(key(uav) for uav in ("uav1", "uav2") for key in (KEYS.claim, KEYS.status, KEYS.choice)),
    *(KEYS.outcome(uav, "t1") for uav in ("uav1", "uav2")),
)
PLANS = {KEYS.brief, KEYS.plan, KEYS.board("t1"), KEYS.roster}
OWN = {
    "uav1": {key for key in REGISTERS if "/uav/uav1/" in key},
    "uav2": {key for key in REGISTERS if "/uav/uav2/" in key},
    "coordinator": PLANS,
    "coordinator-2": PLANS,
    "operator": {KEYS.operator("uav1"), KEYS.operator_task("t1"), KEYS.roster},
    "dashboard": set[str](),
}


async def until_known(hearer: Reader, key: str) -> None:
    """Return when what ``hearer`` has declared is known, and somebody who serves ``key`` answers.

    Not too often: questions are limited.
    """
    for _ in range(100):
        if await hearer.bus.query(key, timeout_s=0.1):
            return
        await asyncio.sleep(0.03)
    raise AssertionError(f"nobody answers on {key}")


async def say_all(speaker: Reader, name: str) -> None:
    """Say all there is to say, others' and the own; return when it has been passed on."""
    for key in REGISTERS:
        speaker.bus.publish(key, name.encode())
    # Who asks on the same session is answered after what was said there has gone on.
    await until_known(speaker, KEYS.state("*"))


async def answer(reader: Reader, name: str) -> None:
    """Answer whatever is asked."""
    while True:
        await reader.bus.inbox.wait()
        reader.events += reader.bus.inbox.take()
        for query in reader.of(Query):
            query.reply(name.encode())
            reader.events.remove(query)


@contextlib.asynccontextmanager
async def answering(reader: Reader, name: str) -> AsyncIterator[None]:
    async with asyncio.TaskGroup() as group:
        task = group.create_task(answer(reader, name))
        yield
        task.cancel()


def said_by(reader: Reader, roster: bytes | None = None) -> dict[str, set[str]]:
    """Keys on which somebody was heard, by name; a router repeats the true ``roster`` besides."""
    heard: dict[str, set[str]] = {name: set() for name in OWN}
    names = {name.encode(): name for name in OWN}
    for sample in reader.of(Sample):
        if roster is not None and sample.key == KEYS.roster and roster in sample.payload:
            continue
        heard[names[sample.payload]].add(sample.key)
    return heard


def test_at_a_router_each_says_what_is_theirs_and_nothing_else(fleet: Fleet) -> None:
    async def scenario() -> None:
        async with contextlib.AsyncExitStack() as stack:
            at_router = ClientTopology((fleet.endpoint,))

            async def join(name: str) -> Reader:
                return await stack.enter_async_context(seated(fleet.identity(name), at_router))

            hearer, witness = await join("dashboard-2"), await join("uav3")
            hearer.bus.subscribe(f"{KEYS.root}/**")
            witness.bus.serve(KEYS.state("uav3"))
            await stack.enter_async_context(answering(witness, "uav3"))
            await until_known(hearer, KEYS.state("uav3"))
            for name in OWN:
                await say_all(await join(name), name)
            await until_known(hearer, KEYS.state("uav3"))
            hearer.events += hearer.bus.inbox.take()
            assert said_by(hearer, fleet.authority.roster_bytes()) == OWN

    asyncio.run(scenario())


def test_at_a_router_each_shows_the_own_token_and_gives_the_own_answer_alone(fleet: Fleet) -> None:
    names = ("uav1", "uav2", "coordinator", "operator", "dashboard")

    async def scenario() -> None:
        async with contextlib.AsyncExitStack() as stack:
            at_router = ClientTopology((fleet.endpoint,))
            hearer = await stack.enter_async_context(
                seated(fleet.identity("dashboard-2"), at_router)
            )
            hearer.bus.watch_tokens(KEYS.alive("*"))
            for name in ("uav2", "operator", "dashboard"):
                speaker = await stack.enter_async_context(seated(fleet.identity(name), at_router))
                for each in names:
                    speaker.bus.serve(KEYS.state(each))
                    speaker.bus.declare_token(KEYS.alive(each))
                await stack.enter_async_context(answering(speaker, name))
            await hearer.until_event(TokenSeen(KEYS.alive("uav2")))
            await until_known(hearer, KEYS.state("uav2"))
            answers = await hearer.bus.query(KEYS.state("*"), timeout_s=LIMIT_S)
            assert [(each.key, each.payload) for each in answers] == [(KEYS.state("uav2"), b"uav2")]
            hearer.events += hearer.bus.inbox.take()
            assert hearer.of(TokenSeen) == [TokenSeen(KEYS.alive("uav2"))]

    asyncio.run(scenario())


def test_in_a_mesh_each_peer_hears_of_others_what_is_theirs_and_nothing_else(
    tmp_path: Path,
) -> None:
    folder = tmp_path / "keys"
    found_authority(folder, MISSION, ["uav1", "uav2"], now_s=unix_s(), mesh=True)
    names = ("uav1", "uav2", "coordinator")
    endpoints = [to_tls(each) for each in free_loopback_endpoints(3, np.random.default_rng())]

    async def scenario() -> None:
        async with contextlib.AsyncExitStack() as stack:
            readers = {}
            for n, name in enumerate(names):
                topology = MeshTopology(endpoints[n], tuple(endpoints[:n]))
                identity = load_identity(folder / name)
                reader = await stack.enter_async_context(seated(identity, topology))
                reader.bus.subscribe(f"{KEYS.root}/**")
                reader.bus.serve(KEYS.state(name))
                await stack.enter_async_context(answering(reader, name))
                readers[name] = reader
            for name, reader in readers.items():
                for other in names:
                    if other != name:
                        await until_known(reader, KEYS.state(other))
            for name, reader in readers.items():
                await say_all(reader, name)
            for name, reader in readers.items():
                reader.events += reader.bus.inbox.take()
                heard = {other: keys for other, keys in said_by(reader).items() if keys}
                assert heard == {other: OWN[other] for other in names if other != name}

    asyncio.run(scenario())


# -- a newer roster -------------------------------------------------------------------------


def test_a_newer_roster_shuts_the_door_to_the_revoked_and_to_nobody_else(fleet: Fleet) -> None:
    async def scenario() -> None:
        at_router = ClientTopology((fleet.endpoint,))
        stolen = fleet.identity("stolen")
        async with (
            seated(fleet.identity("uav1"), at_router) as uav,
            seated(fleet.identity("operator"), at_router) as operator,
            seated(stolen, at_router) as thief,
        ):
            for reader in (uav, operator, thief):
                await reader.until_event(LinkUp())
                reader.events.clear()
            operator.bus.publish(KEYS.roster, b"no roster")
            uav.bus.declare_token(KEYS.alive("uav1"))
            operator.bus.watch_tokens(KEYS.alive("*"))
            await operator.until_event(TokenSeen(KEYS.alive("uav1")))

            fleet.authority.revoke(["stolen"])

            for reader in (uav, operator):
                await reader.until_event(LinkUp())
            await operator.until_event(TokenSeen(KEYS.alive("uav1")), times=2)
            await thief.until_event(LinkDown())
            with pytest.raises(BusError):
                await open_zenoh_bus(BusConfig(at_router, identity=stolen), timeout_s=REFUSED_S)
            assert LinkUp() not in thief.events

    asyncio.run(scenario())


def test_two_routers_with_keys_are_one_bus(fleet: Fleet) -> None:
    options = ("--keys", str(fleet.folder / "router-2"), "--listen", "tls/127.0.0.1:0")

    async def scenario(other: str) -> None:
        async with (
            seated(fleet.identity("dashboard"), ClientTopology((fleet.endpoint,))) as hearer,
            seated(fleet.identity("uav1"), ClientTopology((other,))) as speaker,
        ):
            hearer.bus.subscribe(f"{KEYS.root}/**")
            speaker.bus.serve(KEYS.state("uav1"))
            async with answering(speaker, "uav1"):
                await until_known(hearer, KEYS.state("uav1"))
            for key in REGISTERS:
                speaker.bus.publish(key, b"uav1")

            def heard() -> set[str]:  # but for rosters that routers say
                return {each.key for each in hearer.of(Sample) if each.payload == b"uav1"}

            await hearer.until(lambda: len(heard()) >= len(OWN["uav1"]))
            assert heard() == OWN["uav1"]

    with router(*options, "--connect", fleet.endpoint) as (_, other):
        asyncio.run(scenario(other))


def test_who_floods_is_shut_out_and_the_others_stay(fleet: Fleet) -> None:
    """Ten times as many words at once as any UAV has to say."""

    async def scenario() -> None:
        at_router = ClientTopology((fleet.endpoint,))
        async with (
            seated(fleet.identity("uav1"), at_router) as uav,
            seated(fleet.identity("dashboard"), at_router) as hearer,
            seated(fleet.identity("uav3"), at_router) as hostile,
        ):
            hearer.bus.watch_tokens(KEYS.alive("*"))
            uav.bus.declare_token(KEYS.alive("uav1"))
            hostile.bus.declare_token(KEYS.alive("uav3"))
            for name in ("uav1", "uav3"):
                await hearer.until_event(TokenSeen(KEYS.alive(name)))
            hearer.events.clear()
            for number in range(10_000):
                hostile.bus.publish(KEYS.outcome("uav3", f"t{number % 100}"), bytes(300))
                if number % 100 == 0:  # or the own queue overflows
                    await asyncio.sleep(0.005)
            await hostile.until_event(LinkDown())
            await hearer.until_event(TokenSeen(KEYS.alive("uav1")))
            assert TokenSeen(KEYS.alive("uav3")) not in hearer.events
            with pytest.raises(BusError, match="still refuses uav3@1"):
                await open_zenoh_bus(
                    BusConfig(at_router, identity=fleet.identity("uav3")), timeout_s=REFUSED_S
                )

    asyncio.run(scenario())
