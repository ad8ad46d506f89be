"""A Zenoh router inside this process, for clients that have no mesh.

It lets in whom the newest roster of its folder or of the bus names, less those who flood it.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import zenoh
from zenoh.handlers import Callback, RingChannel

from swarm.bus.admission import RateLimiter
from swarm.bus.bundled_hearing import MOST_WAITING
from swarm.bus.bundles import ANY_BUNDLE, BUNDLE_S, BUNDLED, Bundler
from swarm.bus.config import RouterConfig
from swarm.bus.zenoh_session import close_session, open_session, session_config, session_config_file
from swarm.identity import Identity, Role, Roster
from swarm.identity.folder import ROSTER_FILE
from swarm.identity.roster import RosterEntry
from swarm.protocol.codec import Codec
from swarm.protocol.key_space import KeySpace
from swarm.protocol.messages import SignedRoster, roster_message
from swarm.protocol.seal import UnacceptableError, seal_of
from swarm.runtime.errors import BusError
from swarm.runtime.log import get_logger
from swarm.runtime.writer_thread import WriterThread

if TYPE_CHECKING:
    from zenoh.handlers import Handler

    _Ring = zenoh.Subscriber[Handler[zenoh.Sample]]

LOOK_S = 1.0
"""How often the folder is looked into [wall s]."""
TELL_S = 30.0
"""How often the roster is repeated on the bus [wall s]."""
FLOOD_HZ, FLOOD_BURST = 500.0, 3000
"""What a UAV may say, samples and changes of its token together, before it is shut out; an honest
one says some 10 a second, and up to 1000 at once when a partition heals."""


class RosterKeeper:
    """Keeps the newest roster of one mission, on disk too; a bad one changes nothing.

    The folder of ``identity`` is looked into every ``look_s`` [wall s].

    Raises:
        OSError: its roster cannot be read any more.
        ValueError: that has been changed since the identity was loaded.
    """

    def __init__(self, identity: Identity, look_s: float = LOOK_S) -> None:
        self.identity = identity
        self._look_s = look_s
        seal = seal_of(identity)
        if seal is None:
            raise ValueError("there are no keys")
        self._seal = seal
        self._codec = Codec(identity.mission, seal)
        self._path = identity.folder / ROSTER_FILE
        self._seen: tuple[int, int] | None = None
        self._changed = asyncio.Event()
        self._shut_out: set[str] = set()
        self._heard = RateLimiter(FLOOD_HZ, FLOOD_BURST)
        self._log = get_logger("router")
        self.key = KeySpace(identity.mission).roster
        """Where rosters are said."""

    @property
    def roster(self) -> Roster:
        """In force."""
        return self._seal.roster

    @property
    def let_in(self) -> Roster:
        """The same without those who are shut out."""
        kept = (each for each in self.roster.entries if each.common_name not in self._shut_out)
        return replace(self.roster, entries=tuple(kept))

    def flooding(self, entry: RosterEntry | None, now_s: float) -> str | None:
        """Count one saying of theirs; the common name of who says too much of late.

        A UAV alone: the coordinator's token is that of several machines. May be called on any
        thread.

        thread. ``entry`` is that of the roster by which they were let in.
        """
        if entry is None or entry.role is not Role.UAV:
            return None
        return None if self._heard.allows(entry.common_name, now_s) else entry.common_name

    def shut_out(self, common_name: str) -> None:
        """Let those keys in no more, for as long as this process lives."""
        in_force = any(each.common_name == common_name for each in self.roster.entries)
        if not in_force or common_name in self._shut_out:
            return
        self._shut_out.add(common_name)
        self._changed.set()
        self._log.error(
            f"{common_name} floods the bus and is shut out; give it new keys, or start this "
            "router anew",
            limit_hz=FLOOD_HZ,
        )

    def hear(self, key: str, data: bytes) -> None:
        """Somebody says on ``key`` that this is the roster."""
        message = self._codec.decode(key, data)
        if message is None:
            self._log.debug("a bad roster was said", dropped=dict(self._codec.dropped))
        elif isinstance(message.body, SignedRoster):
            self._take(message.body.signed)

    def look(self) -> None:
        """Take the roster in the folder, if that has changed."""
        try:
            found = self._path.stat()
            seen = (found.st_mtime_ns, found.st_size)
            if seen == self._seen:
                return
            self._seen = seen
            self._take(self._path.read_bytes().decode("ascii", "replace"))
        except OSError as fault:
            self._log.debug("the roster cannot be read", problem=fault.strerror or str(fault))

    async def wait_for_change(self, tell: Callable[[str, bytes], None]) -> None:
        """Return as soon as others are to be let in than the last time; ``tell`` the roster."""
        loop = asyncio.get_running_loop()
        tell_at_s = loop.time() + self._look_s  # those who were linked before are back by then
        while not self._changed.is_set():
            self.look()
            if loop.time() >= tell_at_s:
                tell(self.key, self._said())
                tell_at_s = loop.time() + TELL_S
            try:
                async with asyncio.timeout(self._look_s):
                    await self._changed.wait()
            except TimeoutError:
                continue
        self._changed.clear()

    def _said(self) -> bytes:
        seal = self._seal
        said = roster_message(self.identity.mission, seal.roster.version, seal.signed_roster)
        return self._codec.pack(said) or b""

    def _take(self, signed: str) -> None:
        before = self.roster.version
        try:
            self._seal.put_in_force(signed)
        except UnacceptableError as fault:
            self._log.warning("a roster is not this mission's authority's", problem=fault.reason)
        except OSError as fault:
            problem = fault.strerror or str(fault)
            self._log.warning("the newest roster cannot be kept", problem=problem)
        if self.roster.version != before:
            self._changed.set()


OPEN_LIMIT_S = 10.0
CLOSE_LIMIT_S = 2.0
INFO_LIMIT_S = 2.0
AGAIN_S = 0.05
"""Between tries to listen where the session before has hardly left."""


class Router:
    """A router that serves until it is closed; made by `open_router`."""

    def __init__(
        self,
        config: RouterConfig,
        rosters: RosterKeeper | None,
        session: zenoh.Session,
        endpoints: tuple[str, ...],
    ) -> None:
        self._config = config
        self._rosters = rosters
        self._session = session
        self._closed = False
        self._bundles = WriterThread("bundles")  # a hung client holds a call up
        self.endpoints = endpoints
        """Where it really listens, one per address, ports filled in."""

    async def serve(self) -> None:
        """Serve until cancelled, by the newest roster there is.

        Raises:
            BusError: it was itself revoked, or cannot listen any more.
        """
        bundling = asyncio.get_running_loop().create_task(self._bundle())
        try:
            await self._serve()
        finally:
            bundling.cancel()
            await asyncio.gather(bundling, return_exceptions=True)

    async def _serve(self) -> None:
        rosters = self._rosters
        if rosters is None:
            await asyncio.Event().wait()
            return
        while True:
            self._hear(rosters)
            await rosters.wait_for_change(self._tell)
            roster, own = rosters.roster, rosters.identity
            entry = roster.entry(own.name)
            if entry is None or entry.common_name != own.common_name:
                raise BusError(f"roster {roster.version} revokes the keys of this router")
            get_logger("router").info(f"opening anew, by roster {roster.version}")
            await self._reopen(rosters)

    def close(self) -> None:
        """Stop serving; returns within 2 s whatever the network."""
        if not self._closed:
            self._closed = True
            self._bundles.close(0.0)
            close_session(self._session, limit_s=CLOSE_LIMIT_S)

    def _hear(self, rosters: RosterKeeper) -> None:
        """Listen for rosters, and for who floods; callbacks are Zenoh's threads'."""
        loop = asyncio.get_running_loop()
        root = KeySpace(rosters.identity.mission).root
        let_in = rosters.roster  # until it is opened anew, whoever else is in force by then

        def on_roster(sample: zenoh.Sample) -> None:
            key, data = str(sample.key_expr), sample.payload.to_bytes()
            with contextlib.suppress(RuntimeError):  # the loop has ended
                loop.call_soon_threadsafe(rosters.hear, key, data)

        def on_saying(sample: zenoh.Sample) -> None:
            _, _, _, *rest = str(sample.key_expr).split("/", 4)
            flooder = rosters.flooding(let_in.entry(rest[0]), loop.time()) if rest else None
            if flooder is not None:
                with contextlib.suppress(RuntimeError):
                    loop.call_soon_threadsafe(rosters.shut_out, flooder)

        def listen(key_expr: str, on_sample: Callable[[zenoh.Sample], None]) -> None:
            call = Callback(on_sample, indirect=False)
            remote = zenoh.Locality.REMOTE
            self._session.declare_subscriber(key_expr, call, allowed_origin=remote)

        listen(rosters.key, on_roster)
        listen(f"{root}/uav/**", on_saying)
        self._session.liveliness().declare_subscriber(
            f"{root}/alive/*", Callback(on_saying, indirect=False)
        )

    async def _bundle(self) -> None:
        """Say together what UAVs of large fleets say; see `swarm.bus.bundles`."""
        loop = asyncio.get_running_loop()
        session: zenoh.Session | None = None
        heard: list[_Ring] = []
        bundler = Bundler(str(self._session.zid()))
        while True:
            if session is not self._session:  # the first one, or it was opened anew
                session = self._session
                heard = [_ring(session, key_expr) for key_expr in (*BUNDLED, ANY_BUNDLE)]
            with contextlib.suppress(zenoh.ZError):  # it is opened anew just now
                for ring in heard:
                    for _ in range(MOST_WAITING):
                        if (sample := ring.try_recv()) is None:
                            break
                        bundler.hear(str(sample.key_expr), sample.payload.to_bytes(), loop.time())
                for key, payload in bundler.take(loop.time()):
                    self._bundles.submit(
                        partial(_say, session, key, payload), size_bytes=len(payload)
                    )
            await asyncio.sleep(BUNDLE_S)

    def _tell(self, key: str, data: bytes) -> None:
        with contextlib.suppress(zenoh.ZError):
            self._session.put(key, data, allowed_destination=zenoh.Locality.REMOTE)

    async def _reopen(self, rosters: RosterKeeper) -> None:
        listen = _as_before(self._config.listen, self.endpoints)
        close_session(self._session, limit_s=CLOSE_LIMIT_S)
        async with asyncio.timeout(OPEN_LIMIT_S):
            while True:
                try:
                    self._session = await _open(self._config, rosters, listen)
                # A session that is still closing has the port; a full disk has no place for a door.
                except (BusError, OSError) as fault:
                    get_logger("router").debug("cannot open anew yet", problem=str(fault))
                    await asyncio.sleep(AGAIN_S)
                else:
                    return


async def open_router(config: RouterConfig) -> Router:
    """Start to serve.

    Other routers to link up with need not be there yet.

    Raises:
        BusError: an endpoint is taken, or no listening endpoint came to be.
        InputError: the user's configuration file is wrong, or its keys are no router's.
    """
    rosters = None if config.identity is None else RosterKeeper(config.identity)
    session = await _open(config, rosters, config.listen)
    try:
        endpoints = _listening_endpoints(session)
        if not endpoints:
            raise BusError("the router listens nowhere; give it an endpoint with --listen")
    except BaseException:
        close_session(session, limit_s=CLOSE_LIMIT_S)
        raise
    return Router(config, rosters, session, endpoints)


async def _open(
    config: RouterConfig, rosters: RosterKeeper | None, listen: tuple[str, ...]
) -> zenoh.Session:
    zenoh_config = _zenoh_config(config, listen)
    if rosters is None:
        return await open_session(zenoh_config, timeout_s=OPEN_LIMIT_S)
    from swarm.bus.tls import door_of, secure

    roster = rosters.let_in
    with door_of(rosters.identity, roster) as door:
        secure(zenoh_config, rosters.identity, "router", roster, door)
        return await open_session(zenoh_config, timeout_s=OPEN_LIMIT_S)


def _zenoh_config(config: RouterConfig, listen: tuple[str, ...]) -> zenoh.Config:
    if config.path is None:
        zenoh_config = session_config(
            "router", listen=listen, connect=config.connect, lease_s=config.lease_s
        )
    else:
        zenoh_config = session_config_file(config.path)
        zenoh_config.insert_json5("mode", '"router"')
        if listen:
            zenoh_config.insert_json5("listen/endpoints", json.dumps(listen))
        if config.connect:
            zenoh_config.insert_json5("connect/endpoints", json.dumps(config.connect))
    # Only there a router says which port it got when asked for any.
    zenoh_config.insert_json5("adminspace/enabled", "true")
    return zenoh_config


def _ring(session: zenoh.Session, key_expr: str) -> _Ring:
    """What others say there, kept by Zenoh until it is asked for."""
    ring: RingChannel[zenoh.Sample] = RingChannel(MOST_WAITING)
    return session.declare_subscriber(key_expr, ring, allowed_origin=zenoh.Locality.REMOTE)


def _say(session: zenoh.Session, key: str, payload: bytes) -> None:
    with contextlib.suppress(zenoh.ZError):  # it is opened anew just now
        block, remote = zenoh.CongestionControl.BLOCK, zenoh.Locality.REMOTE
        session.put(key, payload, congestion_control=block, allowed_destination=remote)


def _as_before(listen: tuple[str, ...], endpoints: tuple[str, ...]) -> tuple[str, ...]:
    """``listen`` with the port that was found where any was asked for."""
    ports = (endpoint.rpartition(":")[2] for endpoint in endpoints)
    return tuple(
        f"{each.removesuffix('0')}{next(ports)}" if each.endswith(":0") else each for each in listen
    )


def _listening_endpoints(session: zenoh.Session) -> tuple[str, ...]:
    """What the router says of itself in its own administration space."""
    for reply in session.get(f"@/{session.zid()}/router", timeout=INFO_LIMIT_S):
        if reply.ok is not None:
            said = json.loads(reply.ok.payload.to_bytes())
            return tuple(sorted(said["locators"]))
    return ()
