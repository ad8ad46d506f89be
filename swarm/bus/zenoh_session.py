"""Zenoh sessions: configured as measured, opened in time, watched, and closed in time."""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import re
import threading
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Future
from pathlib import Path
from typing import Final

import zenoh

from swarm.bus.config import config_file_fault
from swarm.bus.port import MAX_PAYLOAD_BYTES, Inbox, LinkDown, LinkUp
from swarm.runtime.errors import BusError
from swarm.runtime.log import get_logger
from swarm.runtime.process import call_in_background

OPEN_TIMEOUT_S = 2.0
"""How long an endpoint that does not answer delays the next one; a bad link needs about 1 s."""
KEEP_ALIVES_PER_LEASE = 4
RECONNECT_FIRST_S = 0.1
RECONNECT_SLOWEST_S = 0.5
BLOCKED_CLOSE_S = 0.5
"""A link whose queue does not move for this long is closed, so that one hung reader holds
the others up no longer."""
HEADERS_BYTES = 64 << 10
_RUNTIME: Final = "ZENOH_RUNTIME"
_CLIENT_RUNTIME: Final = (
    "(rx: (handover: net), tx: (handover: net), app: (handover: net), acc: (handover: net),"
    " net: (worker_threads: 2))"
)
"""A client's threads do all its work by turns; by default each sample wakes three of them. Routers
and peers wait on theirs for congested links, so that others must be there to send."""
DEFAULT_MODE = "peer"
"""Of a Zenoh configuration file that names none."""


def session_config(
    mode: str, *, listen: Sequence[str], connect: Sequence[str], lease_s: float
) -> zenoh.Config:
    """A configuration that finds nobody but those named.

    ``mode`` is ``peer``, ``client`` or ``router``; a client uses the first endpoint that answers.
    """
    retry = {
        "period_init_ms": _ms(RECONNECT_FIRST_S),
        "period_max_ms": _ms(RECONNECT_SLOWEST_S),
        "period_increase_factor": 2,
    }
    blocked = round(BLOCKED_CLOSE_S * 1e6)
    settings: dict[str, object] = {
        "mode": mode,
        "listen/endpoints": list(listen),
        "connect/endpoints": list(connect),
        "connect/retry": retry,
        "scouting/multicast/enabled": False,
        # Gossip dials in both directions, and mutual dialing hides cuts for 10 s.
        "scouting/gossip/enabled": False,
        "scouting/delay": 1,
        # Saves a thread and its memory; only payloads of 3 kB and more would gain.
        "transport/shared_memory/enabled": False,
        "transport/link/tx/lease": _ms(lease_s),
        "transport/link/tx/keep_alive": KEEP_ALIVES_PER_LEASE,
        "transport/link/tx/queue/congestion_control/block/wait_before_close": blocked,
        "transport/link/rx/max_message_size": MAX_PAYLOAD_BYTES + HEADERS_BYTES,
        "transport/unicast/open_timeout": _ms(OPEN_TIMEOUT_S),
        "transport/unicast/accept_timeout": _ms(OPEN_TIMEOUT_S),
    }
    config = zenoh.Config()
    lay_over(config, settings)
    return config


def lay_over(config: zenoh.Config, settings: Mapping[str, object]) -> None:
    """Put ``settings``, by path, in the place of what ``config`` says."""
    for key, value in settings.items():
        config.insert_json5(key, json.dumps(value))


def session_config_file(path: Path) -> zenoh.Config:
    """A configuration file of the user's, as it is.

    Raises:
        InputError: it cannot be read or is none.
    """
    if not path.is_file():
        raise config_file_fault(path, "there is no such file")
    try:
        return zenoh.Config.from_file(path)
    except zenoh.ZError as fault:
        raise config_file_fault(path, plain_error(fault)) from fault


def mode_of(config: zenoh.Config) -> str:
    """``client``, ``peer`` or ``router``."""
    return str(json.loads(config.get_json("mode")) or DEFAULT_MODE)


def endpoints_of(config: zenoh.Config, side: str) -> list[str]:
    """Endpoints that a session of ``config`` has on one side: ``connect`` or ``listen``."""
    mode = mode_of(config)
    if side == "listen" and mode == "client":
        return []
    named = json.loads(config.get_json(f"{side}/endpoints")) or []
    if isinstance(named, dict):
        named = named.get(mode) or []
    return [str(each) for each in named]


@contextlib.contextmanager
def threads_for(mode: str) -> Iterator[None]:
    """In it Zenoh gets the threads that it keeps in this process, with the first session.

    What a user has set stays. What is set here is for nobody that this process starts.
    """
    if mode != "client" or _RUNTIME in os.environ:
        yield
        return
    os.environ[_RUNTIME] = _CLIENT_RUNTIME
    try:
        yield
    finally:
        os.environ.pop(_RUNTIME, None)


async def open_session(config: zenoh.Config, *, timeout_s: float) -> zenoh.Session:
    """Open a session; a client waits until one of its routers is there.

    Raises:
        BusError: it could not be opened within ``timeout_s``, or at all.
    """
    waits = mode_of(config) == "client"
    problem = "no answer"
    try:
        async with asyncio.timeout(timeout_s):
            pause_s = RECONNECT_FIRST_S
            while True:
                opening = call_in_background(lambda: zenoh.open(config), "zenoh open")
                try:
                    return await asyncio.wrap_future(opening)
                except asyncio.CancelledError:
                    opening.add_done_callback(_close_unwanted)
                    raise
                except zenoh.ZError as fault:
                    problem = plain_error(fault)
                    if not waits:
                        raise BusError(f"cannot open the bus: {problem}") from fault
                await asyncio.sleep(pause_s)
                pause_s = min(2 * pause_s, RECONNECT_SLOWEST_S)
    except TimeoutError:
        hint = "is a router running there, or is --connect to name another one?"
        text = f"cannot reach the bus within {timeout_s:g} s: {problem} {hint}"
        raise BusError(text) from None


def close_session(session: zenoh.Session, *, limit_s: float) -> bool:
    """Close ``session``, waiting at most ``limit_s``; whether it closed in that time.

    Into a dead network closing takes 10 s. Then it goes on in the background, and
    `swarm.runtime.process.leave` does not wait for it.
    """
    try:
        call_in_background(session.close, "zenoh close").result(limit_s)
    except TimeoutError:
        get_logger("swarm.bus").warning("the network does not answer; left without saying goodbye")
        return False
    except zenoh.ZError as fault:
        get_logger("swarm.bus").warning("closing the bus failed", problem=plain_error(fault))
    return True


_TAKEN = re.compile(r"listener bound to (\S+?): .*Address already in use")


def plain_error(fault: zenoh.ZError) -> str:
    """What went wrong, without the places in Zenoh's sources and its types."""
    text = re.sub(r"\s+at /\S+?\.rs:\d+\.?", "", str(fault)).strip()
    text = re.sub(r"\bSingle\(([^()]*)\)", r"\1", text)
    if (taken := _TAKEN.search(text)) is not None:
        return f"{taken[1]} is already in use by another process"
    return re.sub(r"to any of \[([^\[\]]*)\]!", r"to \1:", text)


def _close_unwanted(opening: Future[zenoh.Session]) -> None:
    """Close a session that opened after nobody waited for it any more; runs on its thread."""
    if opening.exception() is None:
        try:
            opening.result().close()
        except zenoh.ZError:
            return  # nobody is interested


def _ms(duration_s: float) -> int:
    return round(duration_s * 1000)


LOOK_GAP_S = 0.005
"""Shortest interval between two looks at the links [wall s]."""


class LinkWatch:
    """Tells the first and the last transport from the others; used on Zenoh's threads."""

    def __init__(
        self, session: zenoh.Session, inbox: Inbox, loop: asyncio.AbstractEventLoop
    ) -> None:
        self._session = session
        self._inbox = inbox
        self._loop = loop
        self._lock = threading.Lock()
        self._others: set[str] = set()
        self._linked = False
        self._changes = 0
        self._look_again_s = 0.0

    @property
    def linked(self) -> bool:
        """Whether there is a transport to anybody."""
        return self._linked

    @property
    def changes(self) -> int:
        """How many transports have come and gone so far."""
        return self._changes

    def on_event(self, event: zenoh.TransportEvent) -> None:
        """A transport to one of the others came or went."""
        other = str(event.transport.zid)
        with self._lock:
            self._changes += 1
            if event.kind == zenoh.SampleKind.PUT:
                self._others.add(other)
            else:
                self._others.discard(other)
            self._set(bool(self._others))

    def look(self) -> None:
        """Notice a lost link before its event: tokens go a little earlier than transports.

        Not for every token of a flood: looking takes a while, and all else waits meanwhile.
        """
        now_s = self._loop.time()
        with self._lock:
            changes = self._changes
            if not self._linked or now_s < self._look_again_s:
                return
            self._look_again_s = now_s + LOOK_GAP_S
        if self._session.info.links():  # not under the lock: it may wait for Zenoh's
            return
        with self._lock:
            if changes == self._changes:
                self._set(False)

    def _set(self, linked: bool) -> None:
        if linked != self._linked:
            self._linked = linked
            self._inbox.offer_threadsafe(LinkUp() if linked else LinkDown())
