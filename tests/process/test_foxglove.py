"""`swarm foxglove` beside a mission flown by real processes: a viewer decodes every message."""

from __future__ import annotations

import contextlib
import json
import signal
import struct
from http import HTTPStatus
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from websockets.exceptions import InvalidStatus
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Origin as PageOrigin
from websockets.typing import Subprotocol

from swarm.model import Mission, Origin, Task, TaskId, Uav, UavId
from tests.process.by_hand import ByHand
from tests.process.kept_open import kept_open, let_end
from tests.process.router_processes import commanded, finish

pytestmark = [pytest.mark.process]

UAVS = ["uav1", "uav2"]
SOON_S = 100.0
"""Only bounds how long a test hangs."""
MISSION = Mission(
    "shown",
    9000.0,
    tuple(Uav(UavId(u), (15.0 * n, 0.0, 0.0), 8.0) for n, u in enumerate(UAVS)),
    tuple(Task(TaskId(f"t{n}"), (40.0 * n, 90.0, 0.0), 1.0) for n in range(4)),
    origin=Origin(46.8, 9.7, 1100.0),
)
OPEN_NAME = Subprotocol("foxglove.websocket.v1")
ELSEWHERE = PageOrigin("https://elsewhere.example")
OWN_NAME = Subprotocol("foxglove.sdk.v1")


class LiveViewer:
    """Subscribes to every channel, and holds each message against its schema."""

    def __init__(self, connection: ClientConnection) -> None:
        self.newest: dict[str, Any] = {}
        """By topic."""
        self.session: str | None = None
        self._connection = connection
        self._topics: dict[int, str] = {}
        self._checks: dict[int, Any] = {}

    def read(self) -> None:
        """One word."""
        said = self._connection.recv(timeout=SOON_S)
        if isinstance(said, str):
            self._told(json.loads(said))
            return
        opcode, subscription, log_ns = struct.unpack_from("<BIQ", said)
        assert opcode == 1
        assert log_ns > 1e18
        message = json.loads(said[13:])
        self._checks[subscription].validate(message)
        self.newest[self._topics[subscription]] = message

    def _told(self, word: dict[str, Any]) -> None:
        match word["op"]:
            case "serverInfo":
                self.session = word.get("sessionId")
            case "advertise":
                for channel in word["channels"]:
                    assert (channel["encoding"], channel["schemaEncoding"]) == (
                        "json",
                        "jsonschema",
                    )
                    shape = json.loads(channel["schema"])
                    self._topics[channel["id"]] = channel["topic"]
                    self._checks[channel["id"]] = jsonschema.Draft202012Validator(shape)
                asked = [{"id": c["id"], "channelId": c["id"]} for c in word["channels"]]
                self._connection.send(json.dumps({"op": "subscribe", "subscriptions": asked}))
            case other:
                assert other == "unadvertise", word


def test_a_viewer_sees_a_mission_from_before_its_start_to_its_end(tmp_path: Path) -> None:
    with contextlib.ExitStack() as stack:
        by_hand = ByHand(tmp_path, stack, kept_open(MISSION), speedup=6)
        server = by_hand.start("foxglove", ["foxglove", "--port", "0", "--json", *by_hand.seat])
        assert server.stdout is not None
        url = json.loads(server.stdout.readline())["url"]
        first = LiveViewer(stack.enter_context(connect(url, subprotocols=[OPEN_NAME])))
        by_hand.coordinator("coordinator")
        while first.newest.get("/progress", {}).get("done", 0) < 2:
            first.read()

        # Who comes in flight sees what was told once, long before.
        second = LiveViewer(stack.enter_context(connect(url, subprotocols=[OWN_NAME])))
        wanted = {"/scene/tasks", "/scene/lists", "/scene/uavs", "/uav/uav1/fix", "/log", "/fleet"}
        while not wanted <= second.newest.keys():
            second.read()
        let_end(*by_hand.seat)
        while second.newest["/progress"]["phase"] != "ended":
            second.read()

        by_hand.assert_all_done()
        assert server.poll() is None
        server.send_signal(signal.SIGINT)
        assert server.wait(20) == 130
    assert first.session == second.session
    assert second.newest["/progress"]["done"] == len(MISSION.tasks)
    assert [uav["id"] for uav in second.newest["/fleet"]["uavs"]] == UAVS
    assert first.newest["/swarm/shown/uav/uav1/claim"]["writer"] == "uav1"
    assert "viewer refused" not in by_hand.log("foxglove")


def test_who_may_not_look_on_is_turned_away_and_the_log_says_what_to_do() -> None:
    with commanded("foxglove", "--port", "0", SWARM_LOG_FORMAT="lines") as server:
        assert server.stdout is not None
        url = server.stdout.readline().removeprefix("foxglove: ").strip()
        with pytest.raises(InvalidStatus) as refused:
            connect(url, subprotocols=[OWN_NAME], origin=ELSEWHERE)
        assert refused.value.response.status_code == HTTPStatus.FORBIDDEN
        with pytest.raises(InvalidStatus) as nameless:
            connect(url)
        assert nameless.value.response.status_code == HTTPStatus.BAD_REQUEST
        with connect(url, subprotocols=[OWN_NAME, OPEN_NAME]) as viewer:
            assert viewer.subprotocol == OWN_NAME
            assert json.loads(viewer.recv(timeout=SOON_S))["op"] == "serverInfo"
            server.send_signal(signal.SIGINT)
            status, _, told = finish(server)
    assert status == 130
    assert "viewer refused" in told
    assert f"a page of {ELSEWHERE} may not look on; see --allow-origin" in told
