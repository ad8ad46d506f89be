"""What many UAVs say, in one sample for all: how claims and outcomes reach a large fleet.

Everybody hears every claim and every outcome, so a fleet of N brings N² of them to its processes
with each round of decisions, one by one. A router of ours therefore collects what UAVs of a large
fleet say for a moment and says it once more, together, on ``swarm/<mission>/bundle/<router>``:
MessagePack ``[number, [[key, payload], …]]``. Each statement in it is the very bytes that its
writer has said, envelope and all, so nobody has to believe a router. Who hears bundles need not
hear the statements by themselves; who misses one, by its number, or hears none any more, hears them
by themselves again and asks what there was.

Of several linked routers one bundles, the first by name: the others keep what they hear for as long
as it takes to notice that the first is gone. Leaves out: carrying them (swarm.bus.router,
swarm.bus.zenoh_bus) and the clock.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import Final

import msgpack

from swarm.protocol.timing import UNSTRETCHED_UAVS

BUNDLE_S: Final = 0.05
"""How often what has come is said together [wall s]."""
ALIVE_S: Final = 0.5
"""An empty bundle is said when none was for so long: it proves that the bundler lives."""
RIVAL_S: Final = 1.5
"""A router that has heard no bundle of one before it for so long bundles itself."""
LATE_S: Final = 5.0
"""Who has heard no bundle for so long goes without; a router on a busy machine may be late."""
STEADY_S: Final = 1.0
"""Who has heard bundles without a gap for so long hears statements by bundles alone."""
MOST_BYTES: Final = 128 << 10
"""Of the statements in one bundle; more go into another one."""
MOST_EACH: Final = 200
"""Statements of one UAV that wait to be bundled, so that no flood costs others their words."""
MOST_WRITERS: Final = 4096
"""UAVs of one mission whose statements are bundled."""
MOST_MISSIONS: Final = 64
"""Whose statements one router bundles."""
BUNDLED: Final = ("swarm/*/uav/*/claim", "swarm/*/uav/*/outcome/*")
ANY_BUNDLE: Final = "swarm/*/bundle/*"

Statement = tuple[str, bytes]
"""Key, and what was said on it."""


def bundle_key(mission: str, router: str) -> str:
    """Where a router says its bundles of a mission; ``*`` for any router."""
    return f"swarm/{mission}/bundle/{router}"


def writer_of_bundled(key: str) -> tuple[str, str] | None:
    """Mission and UAV of a statement that goes into bundles; None if ``key`` is of none."""
    match key.split("/"):
        case ["swarm", mission, "uav", uav, "claim"]:
            return mission, uav
        case ["swarm", mission, "uav", uav, "outcome", _]:
            return mission, uav
        case _:
            return None


def expression_of_bundled(key: str) -> str | None:
    """The expression for what all UAVs say of that kind; None if ``key`` is of none."""
    match key.split("/"):
        case ["swarm", mission, "uav", _, "claim"]:
            return f"swarm/{mission}/uav/*/claim"
        case ["swarm", mission, "uav", _, "outcome", _]:
            return f"swarm/{mission}/uav/*/outcome/*"
        case _:
            return None


def packed(number: int, statements: Iterable[Statement]) -> bytes:
    """One bundle."""
    data: bytes = msgpack.packb((number, [list(each) for each in statements]))
    return data


def unpacked(data: bytes) -> tuple[int, list[Statement]] | None:
    """Number and statements of a bundle; None if it is none."""
    try:
        bundle = msgpack.unpackb(data, max_ext_len=0, max_array_len=len(data))
    except (ValueError, TypeError, msgpack.exceptions.UnpackException, RecursionError):
        return None
    match bundle:
        case [int(number), list(parts)] if number >= 0:
            statements = [(part[0], part[1]) for part in parts if _is_statement(part)]
            return (number, statements) if len(statements) == len(parts) else None
        case _:
            return None


def _is_statement(part: object) -> bool:
    match part:
        case [str(), bytes()]:
            return True
        case _:
            return False


@dataclass(slots=True)
class _Collected:
    """Of one mission, what waits to be said together."""

    writers: set[str] = field(default_factory=set)
    waiting: dict[str, tuple[float, bytes]] = field(default_factory=dict)
    """By key, when it came and what was said."""
    each: Counter[str] = field(default_factory=Counter)
    """By UAV, how many of these are its."""
    number: int = 0
    said_s: float = 0.0
    rival_s: float | None = None
    """When a bundle of a router before this one was heard."""


class Bundler:
    """Bundles of one router; called from one thread.

    ``name`` tells routers apart: of several the first by name bundles.
    """

    def __init__(self, name: str) -> None:
        self._name = name
        self._missions: dict[str, _Collected] = {}

    def hear(self, key: str, payload: bytes, now_s: float) -> None:
        """Somebody says so: a UAV, of which the newest of each key is kept, or another router."""
        whose = writer_of_bundled(key)
        if whose is None:
            self._hear_bundle(key, now_s)
            return
        mission, uav = whose
        if mission not in self._missions and len(self._missions) >= MOST_MISSIONS:
            return
        collected = self._missions.setdefault(mission, _Collected())
        if uav not in collected.writers:
            if len(collected.writers) >= MOST_WRITERS:
                return
            collected.writers.add(uav)
        if key not in collected.waiting:
            if collected.each[uav] >= MOST_EACH:
                return
            collected.each[uav] += 1
        collected.waiting[key] = now_s, payload

    def _hear_bundle(self, key: str, now_s: float) -> None:
        match key.split("/"):
            case ["swarm", mission, "bundle", router] if router < self._name:
                if mission in self._missions:
                    self._missions[mission].rival_s = now_s
            case _:
                pass

    def take(self, now_s: float) -> Iterator[tuple[str, bytes]]:
        """Key and payload of what is to be said by now."""
        for mission, collected in self._missions.items():
            if len(collected.writers) <= UNSTRETCHED_UAVS:
                _forget(collected)
            elif collected.rival_s is not None and now_s - collected.rival_s < RIVAL_S:
                # Said by the other; kept for as long as it takes to see that it is gone.
                _forget(collected, until_s=now_s - RIVAL_S)
            elif collected.waiting or now_s - collected.said_s >= ALIVE_S:
                key = bundle_key(mission, self._name)
                waiting = [(key, payload) for key, (_, payload) in collected.waiting.items()]
                _forget(collected)
                collected.said_s = now_s
                for statements in _portions(waiting):
                    collected.number += 1
                    yield key, packed(collected.number, statements)


def _forget(collected: _Collected, until_s: float = float("inf")) -> None:
    """Keep nothing that came by then."""
    kept = {key: said for key, said in collected.waiting.items() if said[0] > until_s}
    if len(kept) < len(collected.waiting):
        collected.waiting = kept
        uavs = (whose[1] for whose in map(writer_of_bundled, kept) if whose is not None)
        collected.each = Counter(uavs)


def _portions(statements: list[Statement]) -> Iterator[list[Statement]]:
    """None of them larger than one bundle may be; one that is empty, of nothing."""
    portion: list[Statement] = []
    room = MOST_BYTES
    for key, payload in statements:
        room -= len(key) + len(payload)
        if room < 0 and portion:
            yield portion
            portion, room = [], MOST_BYTES - len(key) - len(payload)
        portion.append((key, payload))
    yield portion


class BundleReader:
    """What one process makes of bundles of one mission: when to rely on them, and when not."""

    def __init__(self) -> None:
        self._numbers: dict[str, int] = {}
        """By router, of its newest bundle."""
        self._heard_s: float | None = None
        self._since_s = 0.0
        self.relied_on = False
        """Whether statements need not be heard by themselves."""

    def read(self, key: str, data: bytes, now_s: float) -> list[Statement]:
        """The statements in a bundle that has come on ``key``; none where it is not one."""
        bundle = unpacked(data)
        if bundle is None:
            return []
        number, statements = bundle
        before = self._numbers.get(key)
        if len(self._numbers) >= MOST_WRITERS:
            self._numbers.clear()
        self._numbers[key] = number
        if self._heard_s is None or (before is not None and number != before + 1):
            self._since_s = now_s
        self._heard_s = now_s
        return statements

    def forget(self) -> None:
        """The link has changed: who bundled may be gone, and whoever does begins anew."""
        self._heard_s = None

    def judge(self, now_s: float) -> bool | None:
        """Whether to rely on bundles from now on, where that changes: True, or False; else None.

        With False something may have been missed.
        """
        heard_s = self._heard_s
        if not self.relied_on:
            if heard_s is None or now_s - self._since_s < STEADY_S or now_s - heard_s > ALIVE_S * 2:
                return None
            self.relied_on = True
            return True
        if heard_s is not None and now_s - heard_s < LATE_S and self._since_s < heard_s:
            return None
        self.relied_on, self._heard_s = False, None
        return False
