"""HTTP and websocket of the dashboard: who asks is checked, then answered.

README.md has the words.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
from collections.abc import AsyncIterator, Awaitable, Callable, Coroutine
from pathlib import Path
from typing import Any, TypeVar
from urllib.parse import urlsplit

from pydantic import TypeAdapter, ValidationError
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, PlainTextResponse, Response
from starlette.routing import Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from starlette.websockets import WebSocket, WebSocketDisconnect

from coordinator.dashboard.access import AccessRules, RateLimit
from coordinator.dashboard.feed import Feed, PageSettings
from coordinator.dashboard.hub import Hub
from coordinator.dashboard.metrics import Metrics
from coordinator.dashboard.page_input import (
    CommandInput,
    PlaybackInput,
    TaskInput,
    WithdrawalInput,
    ZoneInput,
    ZoneRemovalInput,
    fault_of,
)
from coordinator.dashboard.source import DashboardSource, Refusal, RefusedError
from swarm.runtime.clock import Clock, SystemClock

STATIC = Path(__file__).parent / "static"
MAX_BODY_BYTES = 16 * 1024
MAX_CLIENTS = 64
MAX_STRANGERS = 256
"""Connections that have not given the token yet."""
TOKEN_S = 120.0
"""Wall time a page may take to give the token: a person may have to look for it."""
SEND_S = 20.0
"""Wall time a client may take to read one message; then it is given up."""
END_S = 0.5
"""Wall time that those who look on have to hear that it is over."""
_WRONG_TOKEN, _FULL, _GOING_AWAY = 4401, 1013, 1001
_STATUS = {Refusal.WRONG: 400, Refusal.TOO_EARLY: 409}
Said = TypeVar("Said")


class _HttpError(Exception):
    """The answer to a request that cannot be served."""

    def __init__(self, status: int, text: str) -> None:
        super().__init__(text)
        self.status = status


class Dashboard:
    """The dashboard of ``source``; serve its ``app``, and tell its ``hub`` when it ends.

    Args:
        display: what the page is told of itself; plain when None.
        clock: by which the pace of requests is judged; the machine's when None.
    """

    def __init__(
        self,
        source: DashboardSource,
        access: AccessRules,
        display: PageSettings | None = None,
        *,
        clock: Clock | None = None,
        static: Path = STATIC,
    ) -> None:
        display = display or PageSettings(token=access.token is not None)
        self.hub = Hub(Feed(source, display))
        self._source = source
        self._access = access
        self._clock = clock or SystemClock()
        self._static = static
        self._pace = RateLimit()
        self._strangers = 0
        self._looking: asyncio.Task[None] | None = None
        self._metrics = Metrics(source, self.hub)
        routes = [
            Route("/", self._page),
            Route("/healthz", self._health),
            Route("/metrics", self._measured),
            Route("/api/command", self._taking(CommandInput, self._give), methods=["POST"]),
            Route("/api/task", self._taking(TaskInput, self._give), methods=["POST"]),
            Route(
                "/api/task/withdraw", self._taking(WithdrawalInput, self._give), methods=["POST"]
            ),
            Route("/api/zone", self._taking(ZoneInput, self._give), methods=["POST"]),
            Route("/api/zone/remove", self._taking(ZoneRemovalInput, self._give), methods=["POST"]),
            Route("/api/recording", self._taking(PlaybackInput, self._play), methods=["POST"]),
            WebSocketRoute("/feed", self._feed),
            Mount("/static", StaticFiles(directory=static, check_dir=False)),
        ]
        app = Starlette(routes=routes, lifespan=self._lifespan)
        self.app: ASGIApp = _Guard(app, access, _policy(display.tiles))

    @contextlib.asynccontextmanager
    async def _lifespan(self, _: Starlette) -> AsyncIterator[None]:
        self._looking = asyncio.get_running_loop().create_task(self.hub.run())
        try:
            yield
        finally:
            self.hub.end("the server has ended")
            self._looking.cancel()
            await asyncio.gather(self._looking, return_exceptions=True)

    async def beside(self, work: Coroutine[None, None, None]) -> None:
        """Do ``work`` while the application is served; a fault of the feed ends it, too.

        Raises:
            Exception: what went wrong, here or there.
        """
        working = asyncio.get_running_loop().create_task(work)
        running = {working} if self._looking is None else {working, self._looking}
        try:
            await asyncio.wait(running, return_when=asyncio.FIRST_COMPLETED)
            for task in running:
                if task.done():
                    task.result()
        finally:
            working.cancel()
            await asyncio.gather(working, return_exceptions=True)

    async def end(self, reason: str) -> None:
        """Tell everyone who looks on that it is over, and let them leave."""
        self.hub.end(reason)
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(END_S):
                await self.hub.deserted.wait()

    # -- looking ----------------------------------------------------------------------

    async def _page(self, _: Request) -> Response:
        index = self._static / "index.html"
        if not index.is_file():
            return PlainTextResponse("this installation has no page\n", status_code=404)
        return FileResponse(index)

    async def _health(self, _: Request) -> Response:
        return PlainTextResponse("ok\n")

    async def _measured(self, request: Request) -> Response:
        if not self._access.admits(_bearer(request)):
            return _refuse(401, "the token is missing or wrong")
        text, content_type = self._metrics.page(request.headers.get("accept", ""))
        return Response(text, headers={"content-type": content_type})

    async def _feed(self, socket: WebSocket) -> None:
        await socket.accept()
        with contextlib.suppress(WebSocketDisconnect, TimeoutError):  # it is gone or does not read
            await _send(socket, self.hub.feed.hello())
            if self._access.token is not None and not await self._hear_token(socket):
                await socket.close(_WRONG_TOKEN, "the token is missing or wrong")
            elif self.hub.clients >= MAX_CLIENTS:
                await socket.close(_FULL, "too many look on")
            else:
                with self.hub.following():
                    await self._tell(socket)

    async def _hear_token(self, socket: WebSocket) -> bool:
        if self._strangers >= MAX_STRANGERS:
            return False
        self._strangers += 1
        try:
            async with asyncio.timeout(TOKEN_S):
                said = json.loads(await socket.receive_text())
        except (TimeoutError, ValueError, KeyError, RecursionError):
            return False
        finally:
            self._strangers -= 1
        token = said.get("token") if isinstance(said, dict) else None
        return isinstance(token, str) and self._access.admits(token)

    async def _tell(self, socket: WebSocket) -> None:
        """Tell a client all there is to tell, until it leaves or the server ends."""
        leaving = asyncio.get_running_loop().create_task(_left(socket))
        telling = asyncio.get_running_loop().create_task(self._tell_all(socket))
        try:
            await asyncio.wait((leaving, telling), return_when=asyncio.FIRST_COMPLETED)
            if telling.done():
                telling.result()
        finally:
            leaving.cancel()
            telling.cancel()

    async def _tell_all(self, socket: WebSocket) -> None:
        feed, seen, mission = self.hub.feed, None, 0
        while True:
            await self.hub.after(seen)
            if self.hub.ended is not None:
                await _send(socket, json.dumps({"type": "end", "reason": self.hub.ended}))
                await socket.close(_GOING_AWAY)
                return
            if mission != feed.mission_seq:
                mission = feed.mission_seq
                if feed.mission is not None:
                    await _send(socket, feed.mission)
            # What happened while that was sent is told with it.
            frame, now_seen = feed.frame(seen), feed.seq
            if mission == feed.mission_seq:
                await _send(socket, frame)
                seen = now_seen

    # -- commanding -------------------------------------------------------------------

    def _taking(
        self, kind: type[Said], act: Callable[[Said, str], dict[str, int]]
    ) -> Callable[[Request], Awaitable[Response]]:
        """An endpoint that acts on a ``kind``."""
        shape = TypeAdapter(kind)

        async def endpoint(request: Request) -> Response:
            who = "unknown" if request.client is None else request.client.host
            try:
                if not self._pace.allows(who, self._clock.now_s()):
                    raise _HttpError(429, "too many requests at once; wait a second")
                if not self._access.admits(_bearer(request)):
                    raise _HttpError(401, "the token is missing or wrong")
                said = shape.validate_python(await _body(request))
                return JSONResponse(act(said, who))
            except ValidationError as error:
                return _refuse(400, fault_of(error))
            except RefusedError as error:
                return _refuse(_STATUS[error.why], str(error))
            except _HttpError as error:
                return _refuse(error.status, str(error))

        return endpoint

    def _give(
        self,
        said: CommandInput | TaskInput | WithdrawalInput | ZoneInput | ZoneRemovalInput,
        who: str,
    ) -> dict[str, int]:
        if (orders := self._source.orders) is None:
            recorded = self._source.player is not None
            keys = "these keys only look on: start swarm dashboard with an operator's"
            raise _HttpError(403, "a recording takes no orders" if recorded else keys)
        n = orders.give(said.wish, who)
        self.hub.nudge()
        return {"n": n}

    def _play(self, said: PlaybackInput, _: str) -> dict[str, int]:
        if (player := self._source.player) is None:
            raise _HttpError(403, "only a recording can be wound")
        player.control(playing=said.playing, speed=said.speed, t_s=said.t_s)
        self.hub.nudge()
        return {}


class _Guard:
    """Turns away who asks for another host or from another page, and marks what is answered."""

    def __init__(self, app: ASGIApp, access: AccessRules, policy: str) -> None:
        self._app = app
        self._access = access
        self._headers = [
            (b"content-security-policy", policy.encode()),
            (b"x-content-type-options", b"nosniff"),
            (b"referrer-policy", b"no-referrer"),
            (b"cross-origin-opener-policy", b"same-origin"),
            (b"cross-origin-resource-policy", b"same-origin"),
            (b"cache-control", b"no-cache"),
        ]

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        headers = dict(scope["headers"])
        host, origin = (
            None if (header := headers.get(name)) is None else header.decode("latin-1")
            for name in (b"host", b"origin")
        )
        reads = scope["type"] == "http" and scope["method"] in ("GET", "HEAD")
        if not self._access.knows_host(host):
            refusal = _refuse(403, "this server has another name; see --allow-host")
        elif not reads and not self._access.same_origin(origin, host):
            refusal = _refuse(403, "another page may not ask this")
        else:
            await self._app(scope, receive, self._marked(send))
            return
        if scope["type"] == "websocket":
            await send({"type": "websocket.close", "code": 4403, "reason": "not allowed"})
        else:
            await refusal(scope, receive, self._marked(send))

    def _marked(self, send: Send) -> Send:
        async def marked(message: Message) -> None:
            if message["type"] == "http.response.start":
                message["headers"] = [*message.get("headers", ()), *self._headers]
            await send(message)

        return marked


def _policy(tiles: str | None) -> str:
    """What the page may load: its own parts, and map tiles of one host."""
    images = "'self' data:"
    if tiles is not None:
        parts = urlsplit(tiles)
        images += f" {parts.scheme}://{parts.netloc.replace('{s}', '*')}"
    return (
        "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; "
        f"font-src 'self'; manifest-src 'self'; img-src {images}; base-uri 'none'; "
        "form-action 'none'; frame-ancestors 'none'"
    )


async def _body(request: Request) -> Any:
    kind = request.headers.get("content-type", "").partition(";")[0].strip().lower()
    if kind != "application/json":
        raise _HttpError(415, "say it in JSON, with Content-Type: application/json")
    body = b""
    async for chunk in request.stream():
        body += chunk
        if len(body) > MAX_BODY_BYTES:
            raise _HttpError(413, f"at most {MAX_BODY_BYTES} bytes are read")
    try:
        return json.loads(body)
    except (ValueError, RecursionError):
        raise _HttpError(400, "this is no JSON") from None


def _bearer(request: Request) -> str | None:
    scheme, _, token = request.headers.get("authorization", "").partition(" ")
    return token.strip() if scheme.lower() == "bearer" and token else None


def _refuse(status: int, text: str) -> Response:
    headers = {"www-authenticate": "Bearer"} if status == 401 else None
    return JSONResponse({"error": text}, status_code=status, headers=headers)


async def _send(socket: WebSocket, text: str) -> None:
    async with asyncio.timeout(SEND_S):
        await socket.send_text(text)


async def _left(socket: WebSocket) -> None:
    """Return when the client has left; whatever it says is thrown away."""
    with contextlib.suppress(WebSocketDisconnect):
        while (await socket.receive())["type"] != "websocket.disconnect":
            pass
