"""The endpoints: what is answered, to whom, and what is turned away."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from prometheus_client.parser import text_string_to_metric_families
from starlette.testclient import TestClient, WebSocketTestSession
from starlette.websockets import WebSocketDisconnect

from coordinator.dashboard.access import AccessRules
from coordinator.dashboard.app import Dashboard
from coordinator.dashboard.feed import PageSettings
from swarm.model.ids import COORDINATOR
from swarm.protocol.messages import CommandKind, OperatorCommand, TaskEdit
from swarm.protocol.uav_messages import StatusPhase
from tests.support.builders import epoch
from tests.support.desk_play import DeskPlay, FakePlayer

TOKEN = "0123456789abcdef"
NAMES = frozenset({"testserver"})
HOLD = {"command": "hold", "uav": "u1"}
POSTS: list[tuple[str, dict[str, Any]]] = [
    ("/api/command", HOLD),
    ("/api/task", {"position": [1.0, 2.0, 0.0]}),
    ("/api/task/withdraw", {"id": "t1"}),
    ("/api/zone", {"id": "pond", "polygon": [[9.0, 9.0], [12.0, 9.0], [9.0, 12.0]]}),
]


class StillClock:
    """A clock that is set by hand."""

    time_s = 0.0

    def now_s(self) -> float:
        return self.time_s

    def wall_delay_s(self, delay_s: float) -> float:
        return delay_s


@pytest.fixture
def play() -> DeskPlay:
    play = DeskPlay()
    play.begin()
    play.status("u1", StatusPhase.IDLE)
    return play


@pytest.fixture
def page(play: DeskPlay, tmp_path: Path) -> Iterator[TestClient]:
    with client(play, tmp_path) as opened:
        yield opened


@pytest.fixture
def locked(play: DeskPlay, tmp_path: Path) -> Iterator[TestClient]:
    with client(play, tmp_path, token=TOKEN) as opened:
        yield opened


def client(play: DeskPlay, static: Path, token: str | None = None) -> TestClient:
    (static / "index.html").write_text("<!doctype html><title>page</title>")
    (static / "app.js").write_text("// script")
    access = AccessRules(NAMES, any_address=False, token=token)
    display = PageSettings(token is not None, "https://{s}.tiles.example/{z}/{x}/{y}.png", "them")
    made = Dashboard(play, access, display, clock=StillClock(), static=static)
    return TestClient(made.app)


def read(socket: WebSocketTestSession, kind: str) -> dict[str, Any]:
    """The next message, which is of that kind."""
    said: dict[str, Any] = json.loads(socket.receive_text())
    assert said["type"] == kind
    return said


def test_the_page_and_its_parts_are_served_marked(page: TestClient) -> None:
    index, script = page.get("/"), page.get("/static/app.js")

    assert (index.status_code, script.status_code) == (200, 200)
    assert "<title>page" in index.text
    assert page.get("/static/../app.py").status_code == 404
    assert page.get("/healthz").text == "ok\n"
    for answer in (index, script, page.get("/none")):
        policy = answer.headers["content-security-policy"]
        assert "default-src 'none'" in policy
        assert "script-src 'self';" in policy
        assert "frame-ancestors 'none'" in policy
        assert "img-src 'self' data: https://*.tiles.example;" in policy
        assert answer.headers["x-content-type-options"] == "nosniff"
        assert answer.headers["referrer-policy"] == "no-referrer"


def test_the_feed_begins_whole_and_goes_on_with_changes(page: TestClient, play: DeskPlay) -> None:
    with page.websocket_connect("/feed") as socket:
        hello = read(socket, "hello")
        mission = read(socket, "mission")
        whole = read(socket, "frame")
        play.status("u2", StatusPhase.FLYING, east_m=4.0)
        change = read(socket, "frame")

    assert (hello["kind"], hello["commands"], hello["token"]) == ("live", True, False)
    assert hello["tiles_credit"] == "them"
    assert mission["name"] == "test"
    assert (whole["whole"], change["whole"]) == (True, False)
    assert len(whole["tasks"]) == 3
    assert change["seq"] > whole["seq"]


def test_whoever_looks_on_is_told_of_the_end(play: DeskPlay, tmp_path: Path) -> None:
    (tmp_path / "index.html").touch()
    made = Dashboard(play, AccessRules(NAMES, any_address=False, token=None), static=tmp_path)
    with (
        TestClient(made.app) as opened,
        opened.websocket_connect("/feed") as socket,
    ):
        for kind in ("hello", "mission", "frame"):
            read(socket, kind)
        assert opened.portal is not None
        opened.portal.call(made.end, "the run has ended")
        said = json.loads(socket.receive_text())
        while said["type"] == "frame":
            said = json.loads(socket.receive_text())
        with pytest.raises(WebSocketDisconnect) as closed:
            socket.receive_text()

    assert said == {"type": "end", "reason": "the run has ended"}
    assert closed.value.code == 1001


def test_a_fault_of_the_feed_ends_what_is_done_beside_it(tmp_path: Path) -> None:
    class BrokenPlay(DeskPlay):
        def now_s(self) -> float:
            raise RuntimeError("a bug")

    async def nothing() -> None:
        await asyncio.Event().wait()

    made = Dashboard(
        BrokenPlay(), AccessRules(NAMES, any_address=False, token=None), static=tmp_path
    )
    with TestClient(made.app) as opened:
        assert opened.portal is not None
        with pytest.raises(RuntimeError, match="a bug"):
            opened.portal.call(made.beside, nothing())


@pytest.mark.parametrize(("path", "body"), POSTS)
def test_an_order_is_taken_and_its_number_told(
    page: TestClient, play: DeskPlay, path: str, body: dict[str, Any]
) -> None:
    answer = page.post(path, json=body)

    assert (answer.status_code, answer.json()) == (200, {"n": 1})
    assert len(play.said) == 1
    assert [row.n for row in play.desk.rows] == [1]


def test_an_aborted_mission_takes_no_tasks(page: TestClient, play: DeskPlay) -> None:
    aborted = page.post("/api/command", json={"command": "abort", "uav": None, "reason": "storm"})
    task = page.post("/api/task", json={"position": [1, 2, 3]})

    (abort,) = (message.body for message in play.said)

    assert abort == OperatorCommand("fleet", CommandKind.ABORT, 1, "storm")
    assert play.desk.rows[0].text == "abort"
    assert (aborted.status_code, task.status_code) == (200, 400)
    assert task.json()["error"] == "the mission has ended: nothing is taken up any more"


def test_a_mission_that_runs_is_not_started_without_anybody(
    page: TestClient, play: DeskPlay
) -> None:
    late = page.post("/api/command", json={"command": "start", "uav": "u1"})

    assert (late.status_code, play.said) == (400, [])
    assert late.json()["error"] == "the mission has started already: nobody waits for u1"


def test_a_task_is_said_as_it_was_drawn(page: TestClient, play: DeskPlay) -> None:
    page.post(
        "/api/task",
        json={"id": "x", "position": [1, 2, 3], "value": 4, "service_s": 5, "kind": "photo"},
    )

    (order,) = (message.body for message in play.said)

    assert isinstance(order, TaskEdit)
    assert (order.task, order.position_enu_m, order.value) == ("x", (1.0, 2.0, 3.0), 4.0)
    assert (order.service_s, order.kind, order.withdrawn) == (5.0, "photo", False)


@pytest.mark.parametrize(
    ("path", "body", "error"),
    [
        ("/api/command", {"command": "hold", "uav": "u9"}, "no such UAV: the fleet is u1, u2"),
        ("/api/command", {"command": "hold"}, "hold concerns one UAV: name it"),
        ("/api/command", {"command": "abort", "uav": "u1"}, "abort concerns all UAVs"),
        ("/api/command", {"command": "start"}, "start concerns one UAV: name it"),
        ("/api/command", {"command": "explode", "uav": "u1"}, "command: input should be"),
        ("/api/command", {"command": "hold", "uav": "u1", "x": 1}, "x: "),
        ("/api/command", {"command": "hold", "uav": "u1", "reason": "r" * 151}, "reason: "),
        ("/api/command", {"command": "hold", "uav": "u1", "reason": "\ud800"}, "reason: "),
        ("/api/command", [HOLD], "input should be a dictionary"),
        ("/api/command", None, "input should be a dictionary"),
        ("/api/task", {"position": [0.0, 1e9, 0.0]}, "position.1: "),
        ("/api/task", {"position": [0.0, 1.0]}, "position.2: field required"),
        ("/api/task", {"position": [0, 0, 0], "value": -1}, "value: "),
        ("/api/task", {"position": [0, 0, 0], "value": "7"}, "value: "),
        ("/api/task", {"position": [0, 0, 0], "value": True}, "value: "),
        ("/api/task", {"position": [0, 0, 0], "id": "a/b"}, "id: "),
        ("/api/task", {"position": [0, 0, 0], "id": "t1"}, "that id is taken"),
        ("/api/zone", {"id": "z", "polygon": [[0, 0], [1, 0]]}, "polygon: "),
        ("/api/zone", {"id": "z", "polygon": [[0, 0], [2, 2], [2, 0], [0, 2]]}, "polygon of zone"),
        ("/api/zone", {"polygon": [[0, 0], [1, 0], [0, 1]]}, "id: field required"),
        ("/api/zone/remove", {"id": "pond"}, "no such zone"),
        ("/api/command", {"command": "ready", "uav": None}, "ready concerns one UAV"),
        ("/api/task/withdraw", {"id": "t9"}, "no such task"),
        ("/api/task/withdraw", {}, "id: field required"),
    ],
)
def test_bad_input_is_told_in_one_sentence(
    page: TestClient, play: DeskPlay, path: str, body: object, error: str
) -> None:
    answer = page.post(path, content=json.dumps(body), headers={"content-type": "application/json"})

    assert answer.status_code == 400
    assert answer.json()["error"].startswith(error)
    assert "\n" not in answer.json()["error"]
    assert play.said == []


@pytest.mark.parametrize(
    ("content", "kind", "status"),
    [
        (b"{", "application/json", 400),
        (b"\xff\xfe", "application/json", 400),
        (b"[" * 10_000, "application/json", 400),
        (b'{"position": [NaN, 0, 0]}', "application/json", 400),
        (b'{"position": [1e999, 0, 0]}', "application/json", 400),
        (b'{"position": [' + b"9" * 400 + b", 0, 0]}", "application/json", 400),
        (b"{}", "text/plain", 415),
        (b"{}", "application/x-www-form-urlencoded", 415),
        (b"{}", None, 415),
        (b"x" * 20_000, "application/json", 413),
    ],
)
def test_what_cannot_be_read_is_turned_away(
    page: TestClient, content: bytes, kind: str | None, status: int
) -> None:
    headers = {} if kind is None else {"content-type": kind}

    answer = page.post("/api/task", content=content, headers=headers)

    assert answer.status_code == status
    assert answer.json()["error"]


def test_before_a_mission_is_known_orders_come_too_early(tmp_path: Path) -> None:
    with client(DeskPlay(), tmp_path) as page:
        for path, body in POSTS:
            answer = page.post(path, json=body)
            assert (answer.status_code, answer.json()) == (
                409,
                {"error": "nothing is known of the mission"},
            )


def test_who_may_only_look_on_is_told_what_orders_need(tmp_path: Path) -> None:
    play = DeskPlay()
    play.may_order = False
    with client(play, tmp_path) as page:
        answers = [page.post(path, json=body) for path, body in POSTS]

    for answer in answers:
        assert answer.status_code == 403
        assert "with an operator's" in answer.json()["error"]


def test_a_recording_takes_no_orders_but_is_wound(tmp_path: Path) -> None:
    play = DeskPlay()
    play.player = FakePlayer()
    with client(play, tmp_path) as page:
        refused = [page.post(path, json=body).status_code for path, body in POSTS]
        wound = page.post("/api/recording", json={"speed": 4.0, "t_s": 12})
        wrong = page.post("/api/recording", json={"speed": 0.0})

    assert refused == [403] * len(POSTS)
    assert (wound.status_code, wrong.status_code) == (200, 400)
    assert (play.player.state.t_s, play.player.state.playing, play.player.state.speed) == (
        12.0,
        True,
        4.0,
    )


def test_a_living_mission_cannot_be_wound(page: TestClient) -> None:
    assert page.post("/api/recording", json={"playing": False}).status_code == 403


@pytest.mark.parametrize("headers", [{}, {"authorization": "Bearer x"}, {"authorization": TOKEN}])
def test_without_the_token_nothing_is_told_or_done(
    locked: TestClient, play: DeskPlay, headers: dict[str, str]
) -> None:
    for path, body in POSTS:
        assert locked.post(path, json=body, headers=headers).status_code == 401
    assert locked.get("/metrics", headers=headers).status_code == 401
    assert play.said == []
    assert locked.get("/").status_code == locked.get("/healthz").status_code == 200


def test_with_the_token_everything_is(locked: TestClient) -> None:
    headers = {"Authorization": f"bearer {TOKEN}"}

    for path, body in POSTS:
        assert locked.post(path, json=body, headers=headers).status_code == 200
    assert locked.get("/metrics", headers=headers).status_code == 200
    with locked.websocket_connect("/feed") as socket:
        assert read(socket, "hello")["token"]
        socket.send_json({"type": "token", "token": TOKEN})
        read(socket, "mission")


@pytest.mark.parametrize(
    "said", ['{"type": "token", "token": "no"}', '{"token": 7}', "[]", "x", "[" * 2000]
)
def test_a_wrong_token_ends_the_feed(locked: TestClient, said: str) -> None:
    with locked.websocket_connect("/feed") as socket:
        read(socket, "hello")
        socket.send_text(said)
        with pytest.raises(WebSocketDisconnect) as closed:
            socket.receive_text()

    assert closed.value.code == 4401


@pytest.mark.parametrize("host", ["evil.example", "testserver.evil.example", "127.0.0.1"])
def test_another_name_of_the_server_is_not_answered(page: TestClient, host: str) -> None:
    for path in ("/", "/metrics", "/static/app.js"):
        assert page.get(path, headers={"host": host}).status_code == 403
    assert page.post("/api/command", json=HOLD, headers={"host": host}).status_code == 403
    with (
        pytest.raises(WebSocketDisconnect),
        page.websocket_connect("/feed", headers={"host": host}),
    ):
        pass


@pytest.mark.parametrize("origin", ["http://evil.example", "null", "http://testserver:81"])
def test_another_page_can_neither_command_nor_look(
    page: TestClient, play: DeskPlay, origin: str
) -> None:
    for path, body in POSTS:
        assert page.post(path, json=body, headers={"origin": origin}).status_code == 403
    with (
        pytest.raises(WebSocketDisconnect),
        page.websocket_connect("/feed", headers={"origin": origin}),
    ):
        pass
    assert play.said == []


def test_the_own_page_may(page: TestClient) -> None:
    headers = {"origin": "http://testserver"}

    assert page.post("/api/command", json=HOLD, headers=headers).status_code == 200
    with page.websocket_connect("/feed", headers=headers) as socket:
        read(socket, "hello")


def test_only_so_many_orders_are_taken_at_once(page: TestClient) -> None:
    statuses = [page.post("/api/command", json=HOLD).status_code for _ in range(25)]

    assert statuses == [200] * 20 + [429] * 5


def test_the_metrics_are_what_prometheus_reads(page: TestClient, play: DeskPlay) -> None:
    play.time_s = 4.0
    play.dropped = {"malformed": 3}
    play.claim("u1", "t1")
    play.end("u2", "t2")
    play.say(COORDINATOR, epoch("u1", "u2", number=2, left_out={"due": ("t3", "t2")}))
    page.post("/api/command", json=HOLD)
    play.lose("u1")
    with page.websocket_connect("/feed") as socket:
        for kind in ("hello", "mission", "frame", "frame"):
            read(socket, kind)
        answer = page.get("/metrics")
    values = {
        (sample.name, *(sample.labels.get(name) for name in ("uav", "phase", "state", "reason"))): (
            sample.value
        )
        for family in text_string_to_metric_families(answer.text)
        for sample in family.samples
    }

    def value(name: str, **labels: str) -> float:
        found = (labels.get(each) for each in ("uav", "phase", "state", "reason"))
        return values[name, *found]

    assert answer.headers["content-type"].startswith("text/plain; version=")
    assert value("peckorder_mission_phase", phase="running") == 1.0
    assert value("peckorder_mission_phase", phase="ended") == 0.0
    assert value("peckorder_mission_time_seconds") == pytest.approx(4.2)
    assert value("peckorder_objective_value_seconds") == pytest.approx(996.0)
    assert value("peckorder_plan_objective_value_seconds") == pytest.approx(2970.0)
    assert value("peckorder_tasks", state="open") == 2.0
    assert value("peckorder_tasks", state="done") == 1.0
    assert value("peckorder_tasks_left_out", reason="due") == 1.0
    assert value("peckorder_uav_present", uav="u1") == 0.0
    assert value("peckorder_uav_lost", uav="u1") == 1.0
    assert value("peckorder_uav_phase", uav="u1", phase="lost") == 1.0
    assert value("peckorder_uav_battery_ratio", uav="u1") == 0.5
    assert value("peckorder_uav_silence_seconds", uav="u1") == pytest.approx(0.2)
    assert value("peckorder_uav_tasks_done_total", uav="u2") == 1.0
    assert value("peckorder_uav_dropped_messages_total", uav="u1", reason="stale") == 2.0
    assert value("peckorder_operator_commands", state="pending") == 1.0
    assert value("peckorder_dashboard_clients") == 1.0
    assert value("peckorder_dashboard_dropped_messages_total", reason="malformed") == 3.0
    assert value("process_resident_memory_bytes") > 1e6


def test_metrics_before_a_mission_say_what_there_is(tmp_path: Path) -> None:
    with client(DeskPlay(), tmp_path) as page:
        families = {f.name for f in text_string_to_metric_families(page.get("/metrics").text)}

    assert "peckorder_link_up" in families
    assert "peckorder_mission_phase" not in families
