"""What a router says together, which of several does, and when a process relies on it."""

from __future__ import annotations

import msgpack
import pytest

from swarm.bus.bundles import (
    ALIVE_S,
    LATE_S,
    MOST_BYTES,
    MOST_EACH,
    RIVAL_S,
    STEADY_S,
    Bundler,
    BundleReader,
    Statement,
    bundle_key,
    packed,
    unpacked,
)
from swarm.protocol.timing import UNSTRETCHED_UAVS

MISSION = "m"


def claim(number: int) -> str:
    return f"swarm/{MISSION}/uav/u{number}/claim"


def bundler(name: str = "b", uavs: int = UNSTRETCHED_UAVS + 1) -> Bundler:
    """Of a fleet of that size, whose first words are said."""
    made = Bundler(name)
    for number in range(uavs):
        made.hear(claim(number), b"first", 0.0)
    list(made.take(0.0))
    return made


def said(by: Bundler, now_s: float) -> list[list[Statement]]:
    """The statements of each bundle."""
    bundles = [unpacked(payload) for _, payload in by.take(now_s)]
    assert None not in bundles
    return [bundle[1] for bundle in bundles if bundle is not None]


def test_what_comes_within_a_moment_is_said_together_and_once() -> None:
    router = bundler()
    router.hear(claim(1), b"old", 1.0)
    router.hear(claim(1), b"new", 1.0)
    router.hear(f"swarm/{MISSION}/uav/u2/outcome/t1", b"done", 1.0)
    router.hear(f"swarm/{MISSION}/uav/u2/status", b"is news", 1.0)

    (key, payload), *rest = router.take(1.05)
    assert rest == []
    assert key == bundle_key(MISSION, "b")
    assert unpacked(payload) == (
        2,
        [(claim(1), b"new"), (f"swarm/{MISSION}/uav/u2/outcome/t1", b"done")],
    )
    assert said(router, 1.1) == []


def test_who_bundles_shows_that_it_lives() -> None:
    router = bundler()

    assert said(router, 0.9 * ALIVE_S) == []
    assert said(router, 1.1 * ALIVE_S) == [[]]


def test_small_fleets_are_heard_without_bundles() -> None:
    router = bundler(uavs=UNSTRETCHED_UAVS)
    router.hear(claim(1), b"said", 1.0)

    assert said(router, 9.0) == []


def test_bundles_are_numbered_and_bounded() -> None:
    router = bundler()
    for number in range(8):
        router.hear(claim(number), bytes(MOST_BYTES // 3), 1.0)

    bundles = list(router.take(1.0))
    read = [unpacked(payload) for _, payload in bundles]
    numbers = [bundle[0] for bundle in read if bundle is not None]
    assert numbers == [2, 3, 4, 5]
    assert all(len(payload) < MOST_BYTES + 1000 for _, payload in bundles)
    assert sum(len(bundle[1]) for bundle in read if bundle is not None) == 8


def test_who_floods_loses_its_own_words() -> None:
    router = bundler()
    for number in range(3 * MOST_EACH):
        router.hear(f"swarm/{MISSION}/uav/u1/outcome/t{number}", b"", 1.0)
    router.hear(claim(2), b"honest", 1.0)

    ((*flood, last),) = said(router, 1.0)
    assert last == (claim(2), b"honest")
    assert len(flood) == MOST_EACH


def test_of_several_routers_the_first_by_name_bundles_and_the_next_loses_nothing() -> None:
    first, second = bundler("a"), bundler("b")
    at_s = 10.0
    for _ in range(20):
        at_s += 0.1
        for router in (first, second):
            router.hear(claim(1), b"%d" % int(10 * at_s), at_s)
        bundles = list(first.take(at_s))
        assert len(bundles) == 1
        for key, payload in bundles:
            second.hear(key, payload, at_s)
        for key, payload in second.take(at_s):
            first.hear(key, payload, at_s)
            raise AssertionError("both bundle")

    second.hear(claim(2), b"when the first had gone", at_s + 0.1)
    assert said(second, at_s + 0.9 * RIVAL_S) == []
    (statements,) = said(second, at_s + 1.1 * RIVAL_S)
    assert (claim(2), b"when the first had gone") in statements


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"\xc1",
        msgpack.packb(7),
        msgpack.packb([1]),
        msgpack.packb([-1, []]),
        msgpack.packb([1, [["key"]]]),
        msgpack.packb([1, [[b"key", b""]]]),
        msgpack.packb([1, [["key", "text"]]]),
        msgpack.packb({"a": 1}),
        b"\x91" * 2000,
    ],
)
def test_what_is_no_bundle_is_passed_over(data: bytes) -> None:
    assert unpacked(data) is None
    assert BundleReader().read("key", data, 0.0) == []


def steady(reader: BundleReader, router: str = "a", since_s: float = 0.0) -> float:
    """Let bundles come until it relies on them; that instant."""
    number, at_s = 0, since_s
    while not reader.relied_on:
        number, at_s = number + 1, at_s + 0.1
        reader.read(bundle_key(MISSION, router), packed(number, ()), at_s)
        reader.judge(at_s)
        assert at_s < since_s + 2.0 * STEADY_S
    return at_s


def test_a_process_relies_on_bundles_that_come_steadily() -> None:
    reader = BundleReader()

    assert steady(reader) >= STEADY_S
    assert reader.judge(2.0) is None


def test_a_bundle_that_is_missing_or_none_any_more_ends_that() -> None:
    reader = BundleReader()
    at_s = steady(reader)
    assert reader.judge(at_s + 0.9 * LATE_S) is None
    assert reader.judge(at_s + 1.1 * LATE_S) is False
    assert not reader.relied_on

    at_s = steady(reader, "b", at_s + 10.0)
    reader.read(bundle_key(MISSION, "b"), packed(99, [(claim(1), b"")]), at_s + 0.1)
    assert reader.judge(at_s + 0.1) is False
    assert reader.judge(at_s + 0.2) is None


def test_after_a_link_has_changed_bundles_have_to_be_steady_anew() -> None:
    reader = BundleReader()
    at_s = steady(reader)
    reader.forget()

    assert reader.judge(at_s) is False
    assert steady(reader, "b", at_s) >= at_s + STEADY_S


def test_another_routers_bundles_may_take_the_place_of_one_that_is_gone() -> None:
    reader = BundleReader()
    at_s = steady(reader)
    for number in range(7, 100):
        at_s += 0.1
        reader.read(bundle_key(MISSION, "c"), packed(number, ()), at_s)
        assert reader.judge(at_s) is None
    assert reader.relied_on
