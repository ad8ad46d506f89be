"""Reads a dashboard's feed as a page would, for tests that need the real thing."""

from __future__ import annotations

import json
import threading
import time
import urllib.request
from typing import Any, Self

from websockets.exceptions import WebSocketException
from websockets.sync.client import connect

KEYS = {"uavs": "id", "tasks": "id", "commands": "n"}


def post(url: str, path: str, body: dict[str, Any]) -> tuple[int, dict[str, Any]]:
    """Say something to a dashboard; its status and answer."""
    request = urllib.request.Request(
        url + path,
        data=json.dumps(body).encode(),
        headers={"Content-Type": "application/json", "Origin": url.rstrip("/")},
    )
    try:
        with urllib.request.urlopen(request, timeout=10.0) as answer:
            return answer.status, json.load(answer)
    except urllib.error.HTTPError as error:
        with error:
            return error.code, json.load(error)


def answers(url: str) -> bool:
    """Whether somebody serves there."""
    try:
        with urllib.request.urlopen(url + "healthz", timeout=2.0) as answer:
            return bool(answer.read() == b"ok\n")
    except OSError:
        return False


class FeedReader:
    """Follows one feed, and follows it anew when it breaks off, until it is told the end."""

    def __init__(self, url: str) -> None:
        self.rows: dict[str, dict[Any, dict[str, Any]]] = {name: {} for name in KEYS}
        self.head: dict[str, Any] = {}
        self.connections = 0
        self.end: str | None = None
        """Why the server has ended, once it said so."""
        self._url = url.replace("http", "ws", 1) + "feed"
        self._left = threading.Event()
        self._thread = threading.Thread(target=self._follow)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._left.set()
        self._thread.join(10.0)

    @property
    def uavs(self) -> dict[str, dict[str, Any]]:
        """Newest row of each UAV."""
        return self.rows["uavs"]

    @property
    def tasks(self) -> dict[str, dict[str, Any]]:
        """Newest row of each task."""
        return self.rows["tasks"]

    def _follow(self) -> None:
        while not self._left.is_set() and self.end is None:
            try:
                with connect(self._url, max_size=None) as feed:
                    # What the server before knew says nothing of what this one knows.
                    self.head = {}
                    self.rows = {name: {} for name in KEYS}
                    self.connections += 1
                    while not self._left.is_set() and self.end is None:
                        try:
                            self._take(json.loads(feed.recv(timeout=0.5)))
                        except TimeoutError:
                            continue
            except (OSError, WebSocketException):
                time.sleep(0.1)

    def _take(self, said: dict[str, Any]) -> None:
        if said["type"] == "end":
            self.end = said["reason"]
        if said["type"] != "frame":
            return
        for name, key in KEYS.items():
            rows = said.pop(name)
            before = {} if said["whole"] else self.rows[name]
            # A row tells what tells it apart, and of the rest what has changed.
            self.rows[name] = before | {row[key]: before.get(row[key], {}) | row for row in rows}
        self.head = said
