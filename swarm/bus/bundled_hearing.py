"""Claims and outcomes of a large fleet, heard by a client's session by themselves or by bundles.

Both are kept by Zenoh until they are gathered. See `swarm.bus.bundles` for what bundles are.
"""

from __future__ import annotations

import contextlib
from collections import deque
from collections.abc import Callable, Iterator
from functools import partial
from typing import TYPE_CHECKING

import zenoh
from zenoh.handlers import RingChannel

from swarm.bus.bundles import (
    BundleReader,
    Statement,
    bundle_key,
    expression_of_bundled,
    writer_of_bundled,
)

if TYPE_CHECKING:
    from zenoh.handlers import Handler

MOST_WAITING = 8192
"""Samples of one subscription that wait to be gathered."""
_OWN_KEPT = 4
"""Newest statements of each own key by which they are recognised in bundles."""


class GatheredSubscriptions:
    """What one session has subscribed to gather; declared on ``call``'s thread, in order."""

    def __init__(
        self, session: zenoh.Session, call: Callable[[Callable[[], object]], None]
    ) -> None:
        self._session = session
        self._call = call
        self._rings: dict[str, zenoh.Subscriber[Handler[zenoh.Sample]]] = {}
        """By key expression; changed on that thread alone."""
        self._wanted: set[str] = set()
        self._readers: dict[str, BundleReader] = {}
        """By the key expression of a mission's bundles."""
        self._link_changes = 0
        self._own: dict[str, deque[bytes]] = {}
        """By key, what this process has said of late."""

    def said(self, key: str, payload: bytes) -> None:
        """This process says so; it is not to come back."""
        if writer_of_bundled(key) is not None:
            self._own.setdefault(key, deque(maxlen=_OWN_KEPT)).append(payload)

    def add(self, key_expr: str) -> None:
        """Keep what comes on ``key_expr``, and bundles of it if it is said in any."""
        self._wanted.add(key_expr)
        self._call(partial(self._declare, key_expr))
        whose = writer_of_bundled(key_expr)
        if whose is not None:
            bundles = bundle_key(whose[0], "*")
            if bundles not in self._readers:
                self._readers[bundles] = BundleReader()
                self._call(partial(self._declare, bundles))
            elif self._readers[bundles].relied_on:
                self._call(partial(self._undeclare, key_expr))

    def remove(self, key_expr: str) -> None:
        """Keep it no longer."""
        self._wanted.discard(key_expr)
        self._call(partial(self._undeclare, key_expr))

    def relies_on_bundles(self, mission: str) -> bool:
        """Whether statements of that mission's UAVs are heard by bundles alone."""
        reader = self._readers.get(bundle_key(mission, "*"))
        return reader is not None and reader.relied_on

    def take(self, now_s: float) -> Iterator[tuple[str, Statement]]:
        """All that waits, each with the expression by which it was subscribed to."""
        for key_expr in tuple(self._rings):
            reader = self._readers.get(key_expr)
            for sample in self._waiting(key_expr):
                key, payload = str(sample.key_expr), sample.payload.to_bytes()
                if reader is None:
                    yield key_expr, (key, payload)
                    continue
                for statement in reader.read(key, payload, now_s):
                    wanted = expression_of_bundled(statement[0])
                    if wanted in self._wanted and not self._is_own(statement):
                        yield wanted, statement

    def judge(self, now_s: float, link_changes: int) -> bool:
        """Rely on bundles, or no longer; whether something may have been missed unnoticed.

        ``link_changes`` grows with each link that comes or goes, which is noticed anyway.
        """
        missed, linked_anew = False, link_changes != self._link_changes
        self._link_changes = link_changes
        if linked_anew:
            for reader in self._readers.values():
                reader.forget()
        for bundles, reader in self._readers.items():
            change = reader.judge(now_s)
            if change is None:
                continue
            missed |= not change and not linked_anew
            for key_expr in self._wanted:
                whose = writer_of_bundled(key_expr)
                if whose is not None and bundle_key(whose[0], "*") == bundles:
                    act = self._undeclare if change else self._declare
                    self._call(partial(act, key_expr))
        return missed

    def _is_own(self, statement: Statement) -> bool:
        key, payload = statement
        return payload in self._own.get(key, ())

    def _waiting(self, key_expr: str) -> Iterator[zenoh.Sample]:
        ring = self._rings.get(key_expr)
        with contextlib.suppress(zenoh.ZError):  # undeclared just now
            for _ in range(MOST_WAITING):
                sample = None if ring is None else ring.try_recv()
                if sample is None:
                    return
                if sample.kind == zenoh.SampleKind.PUT:
                    yield sample

    def _declare(self, key_expr: str) -> None:
        if key_expr not in self._rings:
            ring: RingChannel[zenoh.Sample] = RingChannel(MOST_WAITING)
            remote = zenoh.Locality.REMOTE
            self._rings[key_expr] = self._session.declare_subscriber(
                key_expr, ring, allowed_origin=remote
            )

    def _undeclare(self, key_expr: str) -> None:
        ring = self._rings.pop(key_expr, None)
        if ring is not None:
            ring.undeclare()
