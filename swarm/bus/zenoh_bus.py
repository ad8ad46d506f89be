"""The bus on Eclipse Zenoh: a seat in a mesh of peers or at a router.

All calls into Zenoh are made by one writer thread, since a congested or dead network
makes them wait for half a second per link; all that comes back arrives on Zenoh's
threads and goes straight to the inbox, but for what is to be gathered, which Zenoh keeps
until it is asked. Callbacks are direct: an indirect one has a Python thread of its own that
keeps the process from exiting while a session hangs, and is no faster into asyncio
(measured).
"""

from __future__ import annotations

import asyncio
import atexit
import contextlib
import math
import threading
import weakref
from collections import Counter
from collections.abc import Callable, Sequence
from functools import partial

import zenoh
from zenoh.handlers import Callback

from swarm.bus.bundled_hearing import GatheredSubscriptions
from swarm.bus.config import BusConfig, ClientTopology, FileTopology, MeshTopology
from swarm.bus.own_tokens import OwnTokens
from swarm.bus.port import (
    Answer,
    Inbox,
    LinkDown,
    LinkUp,
    Query,
    Sample,
    TokenGone,
    TokenSeen,
    check_key,
    check_key_expr,
    check_payload,
)
from swarm.bus.zenoh_session import (
    LinkWatch,
    close_session,
    endpoints_of,
    mode_of,
    open_session,
    plain_error,
    session_config,
    session_config_file,
    threads_for,
)
from swarm.protocol.seal import Seal, seal_of
from swarm.runtime.errors import BusError
from swarm.runtime.log import get_logger
from swarm.runtime.writer_thread import WriterThread

REPLY_WITHIN_S = 10.0
"""A query nobody has answered for this long is given up: who asked waits no longer."""
MOST_ANSWERS = 8
"""To one question on one key: honest ones are one for each process of that name, and each may be
as long as a bus carries."""
FLUSH_LIMIT_S = 0.7
"""How long closing waits for what is published; a blocked link gives up after 0.5 s."""
WORD_AFTER_S = 1.5
"""Who waits for a bus is told for what, once it has taken so long."""
CLOSE_LIMIT_S = 1.2
"""How long closing waits for the session to say goodbye."""


async def open_zenoh_bus(
    config: BusConfig,
    *,
    timeout_s: float = 10.0,
    inbox_capacity: int = 4096,
    on_wait: Callable[[str], object] | None = None,
) -> ZenohBus:
    """Take a seat on the bus, for the running loop.

    A peer does not wait for the others: `LinkUp` tells. A client waits for one of its
    routers, which may start later than itself.

    ``on_wait`` is told once what is waited for, when it takes longer than a person expects.
    ``inbox_capacity`` events are kept for a slow reader.

    Raises:
        BusError: the bus cannot be reached in time, or the own endpoint is taken.
        InputError: the user's configuration file is wrong.
    """
    loop = asyncio.get_running_loop()
    word = None
    if on_wait is not None:
        text = f"waiting for {config.place}, up to {timeout_s:g} s"
        word = loop.call_later(WORD_AFTER_S, on_wait, text)
    try:
        session = await _open(config, timeout_s)
    finally:
        if word is not None:
            word.cancel()
    inbox = Inbox(loop, inbox_capacity)
    return ZenohBus(session, inbox, seal_of(config.identity))


async def _open(config: BusConfig, timeout_s: float) -> zenoh.Session:
    settings, identity = _zenoh_config(config), config.identity
    mode = mode_of(settings)
    if identity is not None:  # the others need not load this
        from swarm.bus.tls import secure

        secure(settings, identity, mode, identity.roster)
    try:
        with threads_for(mode):
            return await open_session(settings, timeout_s=timeout_s)
    except BusError as fault:
        from swarm.bus.tls import why_refused, with_keys_only

        routers = endpoints_of(settings, "connect")
        if mode != "client" or not routers:
            raise
        if identity is not None:
            reason = await why_refused(routers, identity)
        elif not (reason := await with_keys_only(routers)):
            raise
        raise BusError(f"cannot reach the bus within {timeout_s:g} s: {reason}") from fault


def _zenoh_config(config: BusConfig) -> zenoh.Config:
    match config.topology:
        case MeshTopology(listen, dial):
            return session_config("peer", listen=[listen], connect=dial, lease_s=config.lease_s)
        case ClientTopology(routers):
            return session_config("client", listen=[], connect=routers, lease_s=config.lease_s)
        case FileTopology(path):
            return session_config_file(path)


class _Reply:
    """The way back to one who asked; given up when it is called, dropped or forgotten."""

    def __init__(self, query: zenoh.Query, key: str, writer: WriterThread) -> None:
        self._query: zenoh.Query | None = query
        self._key = key
        self._writer = writer
        self._lock = threading.Lock()

    def __call__(self, payload: bytes) -> None:
        """Answer; every call but the first goes nowhere."""
        check_payload(payload)
        query = self._release()
        if query is not None:
            send = partial(self._send, query, bytes(payload))
            self._writer.submit(send, size_bytes=len(payload))

    def drop(self) -> None:
        """Give up without an answer."""
        query = self._release()
        if query is not None:
            query.drop()

    def _release(self) -> zenoh.Query | None:
        with self._lock:
            query, self._query = self._query, None
        return query

    def _send(self, query: zenoh.Query, payload: bytes) -> None:
        with contextlib.suppress(zenoh.ZError):  # who asked has gone
            query.reply(self._key, payload)
        query.drop()


class ZenohBus:
    """One session on the bus; see `swarm.bus.port.Bus`. Made by `open_zenoh_bus`."""

    def __init__(self, session: zenoh.Session, inbox: Inbox, seal: Seal | None = None) -> None:
        self.seal = seal
        """Of whoever sits here."""
        self._session = session
        self._inbox = inbox
        self._loop = asyncio.get_running_loop()
        self._writer = WriterThread("zenoh writer")
        self._closed = False
        self._subscribed: dict[str, tuple[bool, bool]] = {}
        """By key expression, whether the latest of each key is enough, and whether to gather."""
        self._subscribers: dict[str, zenoh.Subscriber[None]] = {}
        """By key expression, but for what is gathered; the writer's thread alone looks at them."""
        self._gathered = GatheredSubscriptions(session, self._call)
        self._watched: set[str] = set()
        self._served: set[str] = set()
        self._queryables: dict[str, zenoh.Queryable[None]] = {}
        """By key; the writer's thread alone looks at them."""
        self._tokens: dict[str, zenoh.LivelinessToken] = {}
        """By key; kept, or they would be undeclared. The writer's thread alone looks at them."""
        self._own = OwnTokens()
        # A thread that comes back from Zenoh while the interpreter ends aborts the process.
        atexit.register(self.close)
        self._replies: weakref.WeakSet[_Reply] = weakref.WeakSet()
        self._links = LinkWatch(session, inbox, self._loop)
        self._call(
            lambda: session.info.declare_transport_events_listener(
                _direct(self._links.on_event), history=True
            )
        )

    @property
    def inbox(self) -> Inbox:
        """Where everything arrives."""
        return self._inbox

    @property
    def unsent(self) -> int:
        """Samples and answers thrown away because the network took none."""
        return self._writer.dropped

    def publish(self, key: str, payload: bytes, *, reliable: bool = True) -> None:
        """Send ``payload`` on ``key``; see `swarm.bus.port.Bus.publish`."""
        self._check_open()
        check_key(key)
        check_payload(payload)
        how = zenoh.CongestionControl.BLOCK if reliable else zenoh.CongestionControl.DROP
        put = partial(
            self._session.put,
            key,
            bytes(payload),
            congestion_control=how,
            allowed_destination=zenoh.Locality.REMOTE,
        )
        self._gathered.said(key, bytes(payload))
        self._writer.submit(partial(self._try, put), size_bytes=len(payload), spare=not reliable)

    def subscribe(self, key_expr: str, *, latest: bool = False, gathered: bool = False) -> None:
        """Receive a `Sample` for everything others publish on ``key_expr``."""
        self._check_open()
        check_key_expr(key_expr)
        before = self._subscribed.get(key_expr)
        self._subscribed[key_expr] = latest, gathered  # before the first sample can arrive
        if before is not None and before[1] is gathered:
            return
        # The new one first: what comes twice meanwhile does no harm.
        if gathered:
            self._gathered.add(key_expr)
        else:
            self._call(partial(self._declare_subscriber, key_expr))
        if before is not None:
            self._withdraw(key_expr, gathered=before[1])

    def gather(self) -> None:
        """Hand over what waits; never for longer than there was room for."""
        self._check_open()
        now_s = self._loop.time()
        for key_expr, (key, payload) in self._gathered.take(now_s):
            self._offer(key_expr, Sample(key, payload))
        if self._gathered.judge(now_s, self._links.changes) and self._links.linked:
            # As after a link that was down: others may have said what did not come here.
            self._inbox.offer_threadsafe(LinkDown())
            self._call(lambda: self._inbox.offer_threadsafe(LinkUp()))

    def relies_on_bundles(self, mission: str) -> bool:
        """Whether claims and outcomes of that mission are heard by bundles alone."""
        return self._gathered.relies_on_bundles(mission)

    def unsubscribe(self, key_expr: str) -> None:
        """Receive nothing more by that very subscription."""
        self._check_open()
        how = self._subscribed.pop(key_expr, None)
        if how is not None:
            self._withdraw(key_expr, gathered=how[1])

    def _withdraw(self, key_expr: str, *, gathered: bool) -> None:
        if gathered:
            self._gathered.remove(key_expr)
        else:
            self._call(lambda: self._subscribers.pop(key_expr).undeclare())

    def declare_token(self, key: str) -> None:
        """Hold a liveliness token on ``key``."""
        self._check_open()
        check_key(key)
        if self._own.hold(key):
            self._call(partial(self._declare_token, key))

    def release_token(self, key: str) -> None:
        """Hold the token on ``key`` no longer; see `swarm.bus.shared_seats.SharedBus`."""
        self._check_open()
        if self._own.let_go(key):
            self._call(partial(self._undeclare_token, key))

    def watch_tokens(self, key_expr: str) -> None:
        """Receive `TokenSeen` and `TokenGone`."""
        self._check_open()
        check_key_expr(key_expr)
        if key_expr not in self._watched:
            self._watched.add(key_expr)
            watch = self._session.liveliness().declare_subscriber
            on_token = _direct(self._on_token)
            self._call(lambda: watch(key_expr, on_token, history=True))

    def serve(self, key: str) -> None:
        """Receive a `Query` whenever somebody else asks on ``key``."""
        self._check_open()
        check_key(key)
        if key not in self._served:
            self._served.add(key)
            self._call(partial(self._declare_queryable, key))

    def stop_serving(self, key: str) -> None:
        """Receive no further `Query` on ``key``."""
        self._check_open()
        if key in self._served:
            self._served.discard(key)
            self._call(lambda: self._queryables.pop(key).undeclare())

    async def query(
        self, key_expr: str, payload: bytes = b"", *, timeout_s: float
    ) -> Sequence[Answer]:
        """Ask all others who serve a key matching ``key_expr``."""
        self._check_open()
        check_key_expr(key_expr)
        check_payload(payload)
        if not 0.0 < timeout_s < math.inf:
            raise ValueError(f"timeout_s must be positive and finite, not {timeout_s}")
        answers: list[Answer] = []
        given: Counter[str] = Counter()
        complete = asyncio.Event()

        def on_reply(reply: zenoh.Reply) -> None:
            if reply.ok is not None:
                key = str(reply.ok.key_expr)
                given[key] += 1
                if given[key] > MOST_ANSWERS:
                    return
                data = reply.ok.payload.to_bytes()
                answer = Answer(key, data, self._loop.time())
                self._hand_over(lambda: answers.append(answer))

        get = partial(
            self._session.get,
            key_expr,
            Callback(on_reply, lambda: self._hand_over(complete.set), indirect=False),
            payload=bytes(payload),
            target=zenoh.QueryTarget.ALL,
            consolidation=zenoh.ConsolidationMode.NONE,
            congestion_control=zenoh.CongestionControl.BLOCK,
            allowed_destination=zenoh.Locality.REMOTE,
            timeout=timeout_s,
        )
        self._writer.submit(partial(self._try, get), size_bytes=len(payload))
        with contextlib.suppress(TimeoutError):  # what has come until then is the answer
            async with asyncio.timeout(timeout_s):
                await complete.wait()
        return tuple(answers)

    def close(self) -> None:
        """Send what is published, undeclare everything and leave, within 2 s."""
        atexit.unregister(self.close)
        if self._closed:
            return
        self._closed = True
        if not self._writer.close(FLUSH_LIMIT_S):
            get_logger("swarm.bus").warning(
                "the network is stuck; not all that was published went out"
            )
        for reply in list(self._replies):
            reply.drop()
        close_session(self._session, limit_s=CLOSE_LIMIT_S)

    def _check_open(self) -> None:
        if self._closed:
            raise BusError("the bus is closed")

    def _call(self, declare: Callable[[], object]) -> None:
        self._writer.submit(partial(self._try, declare), must_run=True)

    def _try(self, call: Callable[[], object]) -> None:
        """Make a call on the writer thread."""
        try:
            call()
        except zenoh.ZError as fault:
            get_logger("swarm.bus").warning("the bus refused a call", problem=plain_error(fault))

    def _declare_subscriber(self, key_expr: str) -> None:
        call = _direct(partial(self._on_sample, key_expr))
        remote = zenoh.Locality.REMOTE
        self._subscribers[key_expr] = self._session.declare_subscriber(
            key_expr, call, allowed_origin=remote
        )

    def _declare_token(self, key: str) -> None:
        self._tokens[key] = self._session.liveliness().declare_token(key)

    def _undeclare_token(self, key: str) -> None:
        token = self._tokens.pop(key, None)
        try:
            if token is not None:
                token.undeclare()
        finally:
            # Until a question has gone to the router and back, this process's own token is found.
            self._find_token(key, lambda _: self._call(partial(self._find_others, key)))

    def _find_others(self, key: str) -> None:
        """Tell of who else holds it: nothing was told as long as this process did."""
        self._own.hear_of_others(key)
        self._find_token(key, lambda found: self._own.release(key, found, self._tell_token))

    def _find_token(self, key: str, then: Callable[[bool], object]) -> None:
        found: list[zenoh.Reply] = []
        # A question that nobody answers in time is answered by an error.
        ask = Callback(
            found.append, lambda: then(any(r.ok is not None for r in found)), indirect=False
        )
        self._session.liveliness().get(key, ask, timeout=REPLY_WITHIN_S)

    def _declare_queryable(self, key: str) -> None:
        on_query = _direct(partial(self._on_query, key))
        remote = zenoh.Locality.REMOTE
        queryable = self._session.declare_queryable(key, on_query, allowed_origin=remote)
        self._queryables[key] = queryable

    # Zenoh's threads call what follows.

    def _on_sample(self, key_expr: str, sample: zenoh.Sample) -> None:
        if sample.kind == zenoh.SampleKind.PUT and not self._closed:
            key, payload = str(sample.key_expr), sample.payload.to_bytes()
            self._offer(key_expr, Sample(key, payload, self._loop.time()))

    def _offer(self, key_expr: str, event: Sample) -> None:
        if (how := self._subscribed.get(key_expr)) is not None:
            self._inbox.offer_threadsafe(event, latest=how[0])

    def _on_token(self, sample: zenoh.Sample) -> None:
        if self._closed:
            return
        seen = sample.kind == zenoh.SampleKind.PUT
        if not seen:
            self._links.look()
        self._own.hear(str(sample.key_expr), seen, self._tell_token)

    def _tell_token(self, key: str, seen: bool) -> None:
        self._inbox.offer_threadsafe(TokenSeen(key) if seen else TokenGone(key))

    def _on_query(self, key: str, query: zenoh.Query) -> None:
        reply = _Reply(query, key, self._writer)
        payload = b"" if query.payload is None else query.payload.to_bytes()
        if not self._inbox.offer_threadsafe(Query(key, reply, payload)):
            reply.drop()
            return
        given_up = weakref.WeakMethod(reply.drop)
        self._hand_over(lambda: self._loop.call_later(REPLY_WITHIN_S, _call_if_alive, given_up))
        self._hand_over(partial(self._replies.add, reply))

    def _hand_over(self, call: Callable[[], object]) -> None:
        """Make a call on the loop's thread; an ended loop needs it no more."""
        with contextlib.suppress(RuntimeError):
            self._loop.call_soon_threadsafe(call)


def _direct(on_event: Callable[..., None]) -> Callback[object]:
    return Callback(on_event, indirect=False)


def _call_if_alive(method: weakref.WeakMethod[Callable[[], None]]) -> None:
    call = method()
    if call is not None:
        call()
