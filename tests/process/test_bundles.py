"""Words of a large fleet reach clients of a real router together, and without it one by one."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from pathlib import Path

import pytest

from swarm.bus.bundles import BUNDLE_S, bundle_key, packed
from swarm.bus.config import BusConfig, ClientTopology
from swarm.bus.port import LinkDown, LinkUp, Sample
from swarm.bus.zenoh_bus import ZenohBus, open_zenoh_bus
from swarm.identity import load_identity
from swarm.identity.founding import found_authority
from swarm.protocol.key_space import KeySpace
from swarm.protocol.timing import UNSTRETCHED_UAVS
from swarm.runtime.clock import unix_s
from tests.process.router_processes import router

pytestmark = pytest.mark.process

KEYS = KeySpace("m")
LIMIT_S = 60.0


async def until(bus: ZenohBus, seen: list[object], condition: Callable[[], bool]) -> None:
    """Gather as a shell does until the condition holds; everything that comes is in ``seen``."""
    async with asyncio.timeout(LIMIT_S):
        while not condition():
            bus.gather()
            seen += bus.inbox.take()
            await asyncio.sleep(BUNDLE_S / 2.0)


def test_claims_of_many_come_in_bundles_once_these_are_steady_and_each_is_heard() -> None:
    async def scenario(endpoint: str) -> None:
        config = BusConfig(ClientTopology((endpoint,)), 1.5)
        speaker, hearer, onlooker = [await open_zenoh_bus(config) for _ in range(3)]
        try:
            hearer.subscribe(KEYS.claim("*"), latest=True, gathered=True)
            onlooker.subscribe(bundle_key("m", "*"))
            seen: list[object] = []
            round_ = [0]

            def say() -> bool:
                round_[0] += 1
                for number in range(UNSTRETCHED_UAVS + 5):
                    speaker.publish(KEYS.claim(f"u{number}"), b"%d" % round_[0])
                return hearer.relies_on_bundles("m")

            await until(hearer, seen, say)
            bundles = [event for event in onlooker.inbox.take() if isinstance(event, Sample)]
            assert bundles
            last = Sample(KEYS.claim("u3"), b"the last word")
            speaker.publish(last.key, last.payload)
            await until(hearer, seen, lambda: last in seen)
            own = Sample(KEYS.claim("u7"), b"its own")
            hearer.publish(own.key, own.payload)
            after = Sample(KEYS.claim("u8"), b"after it")
            speaker.publish(after.key, after.payload)
            await until(hearer, seen, lambda: after in seen)
            assert own not in seen
            assert LinkDown() not in seen
            assert seen.count(LinkUp()) == 1
        finally:
            for bus in (speaker, hearer, onlooker):
                bus.close()

    with router("--listen", "tcp/127.0.0.1:0") as (_, endpoint):
        asyncio.run(scenario(endpoint))


def test_who_hears_bundles_no_more_hears_claims_by_themselves() -> None:
    async def scenario(endpoint: str) -> None:
        config = BusConfig(ClientTopology((endpoint,)), 1.5)
        speaker, hearer = [await open_zenoh_bus(config) for _ in range(2)]
        try:
            hearer.subscribe(KEYS.claim("*"), latest=True, gathered=True)
            seen: list[object] = []
            number = [0]

            def bundle() -> bool:
                """In place of a router: nobody else has said so much that one would."""
                number[0] += 1
                speaker.publish(bundle_key("m", "a"), packed(number[0], ()))
                return hearer.relies_on_bundles("m")

            await until(hearer, seen, bundle)
            await until(hearer, seen, lambda: not hearer.relies_on_bundles("m"))
            await until(hearer, seen, lambda: seen[-2:] == [LinkDown(), LinkUp()])
            said = Sample(KEYS.claim("u1"), b"by itself")
            speaker.publish(said.key, said.payload)
            await until(hearer, seen, lambda: said in seen)
        finally:
            for bus in (speaker, hearer):
                bus.close()

    with router("--listen", "tcp/127.0.0.1:0") as (_, endpoint):
        asyncio.run(scenario(endpoint))


def test_with_keys_bundles_are_heard_of_routers_and_of_nobody_else(tmp_path: Path) -> None:
    folder = tmp_path / "keys"
    found_authority(folder, "m", ["u1", "u2"], now_s=unix_s(), coordinators=1, routers=2)

    async def scenario(endpoint: str) -> None:
        def seat(name: str) -> BusConfig:
            topology = ClientTopology((endpoint.replace("tcp/", "tls/"),))
            return BusConfig(topology, identity=load_identity(folder / name))

        # Another router may say what many have said to it.
        carrier, liar, hearer = [
            await open_zenoh_bus(seat(name)) for name in ("router-2", "u1", "u2")
        ]
        try:
            hearer.subscribe(bundle_key("m", "*"))
            heard: dict[str, int] = {}

            def is_heard() -> bool:
                for number in range(UNSTRETCHED_UAVS + 5):
                    carrier.publish(KEYS.claim(f"u{number}"), b"said")
                liar.publish(bundle_key("m", "liar"), packed(1, ()))
                for event in hearer.inbox.take():
                    if isinstance(event, Sample):
                        heard[event.key] = heard.get(event.key, 0) + 1
                return max(heard.values(), default=0) >= 5

            await until(hearer, [], is_heard)
            assert len(heard) == 1
            assert bundle_key("m", "liar") not in heard
        finally:
            for bus in (carrier, liar, hearer):
                bus.close()

    options = ("--keys", str(folder / "router"), "--listen", "tls/127.0.0.1:0")
    with router(*options) as (_, endpoint):
        asyncio.run(scenario(endpoint))
