"""What another implementation sees of `swarm ros2`: `python -m … PORT DEFINITIONS [TASK …]`.

Keys, tokens, hashes, attachments and calls by zenoh-ros2-sdk, bytes by mcap-ros2-support: neither
is used where messages are written. It lists the graph of the router at that port, reads every
topic, adds a task, waits until it is done, withdraws each named TASK, waits for the end of the
mission, and prints what it has seen as JSON. It is a process, as the SDK has one session in each.
"""

from __future__ import annotations

import json
import sys
import threading
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import zenoh
from mcap.records import Schema
from mcap_ros2.decoder import DecoderFactory
from zenoh_ros2_sdk import ROS2ServiceClient, get_service_names_and_types, get_topic_names_and_types
from zenoh_ros2_sdk.attachment import Attachment
from zenoh_ros2_sdk.keyexpr import topic_keyexpr
from zenoh_ros2_sdk.message_registry import get_registry
from zenoh_ros2_sdk.session import ZenohSession
from zenoh_ros2_sdk.utils import get_type_hash, load_dependencies_recursive, ros2_to_dds_type

from swarm.runtime.clock import unix_s
from tests.process.mission import wait_until

LIMIT_S = 150.0
HOST = "127.0.0.1"
ADDED_AT = (20.0, 30.0, 0.0)


class RosReader:
    """All that is heard on the topics of a graph."""

    def __init__(self, port: int, definitions: Path) -> None:
        self.newest: dict[str, Any] = {}
        """By topic, the newest message."""
        self.counts = Counter[str]()
        self.faults: list[str] = []
        self._port = port
        self._sequences: dict[str, int] = {}
        self._lock = threading.Lock()
        self._session = ZenohSession.get_instance(HOST, port)
        self._subscribers: dict[str, object] = {}
        get_registry().messages_dir = definitions

    def topics(self) -> dict[str, list[str]]:
        """The types of each topic."""
        return dict(get_topic_names_and_types(0, HOST, self._port, timeout=2.0))

    def services(self) -> dict[str, list[str]]:
        """The types of each service."""
        return dict(get_service_names_and_types(0, HOST, self._port, timeout=2.0))

    def follow(self) -> None:
        """Read every topic that is there and is not read yet."""
        for topic, (typ,) in self.topics().items():
            if topic not in self._subscribers:
                key = topic_keyexpr(0, topic, ros2_to_dds_type(typ), hash_of(typ))
                decode = self._decoder(typ)
                self._subscribers[topic] = self._session.session.declare_subscriber(
                    key, self._listener(topic, decode)
                )

    def call(self, name: str, typ: str, **asked: Any) -> dict[str, Any]:
        """Ask a service; the fields of its answer."""
        client = ROS2ServiceClient(
            name, typ, domain_id=0, router_ip=HOST, router_port=self._port, timeout=60.0
        )
        try:
            answer = client.call(**asked)
        finally:
            client.close()
        assert answer is not None, f"{name} has not answered"
        fields = [name for name in answer.__dataclass_fields__ if not name.startswith("_")]
        return {name: getattr(answer, name) for name in fields}

    def made(self, typ: str, *values: Any) -> Any:
        """A message for a request."""
        self._session.register_message_type(None, typ)
        return self._session.store.types[typ](*values)

    def _decoder(self, typ: str) -> Callable[[bytes], Any]:
        texts = [text_of(typ)]
        for name, text in dependencies_of(typ).items():
            package, _, short = name.split("/")
            texts.append(f"{'=' * 80}\nMSG: {package}/{short}\n{text}")
        schema = Schema(id=1, name=typ, encoding="ros2msg", data="\n".join(texts).encode())
        decoder = DecoderFactory().decoder_for("cdr", schema)  # it keeps one for each id
        assert decoder is not None
        return decoder

    def _listener(
        self, topic: str, decode: Callable[[bytes], Any]
    ) -> Callable[[zenoh.Sample], None]:
        def listen(sample: zenoh.Sample) -> None:
            try:
                assert sample.attachment is not None
                told = Attachment.from_bytes(sample.attachment.to_bytes())
                message = decode(sample.payload.to_bytes())
                assert len(told.gid) == 16
                assert abs(told.timestamp_ns / 1e9 - unix_s()) < LIMIT_S
            except Exception as fault:  # noqa: BLE001 - whatever it is, the test shall tell it
                with self._lock:
                    self.faults.append(f"{topic}: {fault!r}")
                return
            with self._lock:
                before = self._sequences.get(topic)
                if before is not None and told.sequence_id <= before:
                    self.faults.append(f"{topic}: {told.sequence_id} after {before}")
                self._sequences[topic] = told.sequence_id
                self.newest[topic] = message
                self.counts[topic] += 1

        return listen


def text_of(typ: str) -> str:
    path = get_registry().get_msg_file_path(typ)
    assert path is not None, typ
    return str(path.read_text())


def dependencies_of(typ: str) -> dict[str, str]:
    return dict(load_dependencies_recursive(typ, text_of(typ), get_registry()))


def hash_of(typ: str) -> str:
    return str(get_type_hash(typ, text_of(typ), dependencies_of(typ)))


def main(port: int, definitions: Path, withdrawn: list[str]) -> dict[str, Any]:
    reader = RosReader(port, definitions)
    status, tasks = "/peckorder/status", "/peckorder/tasks"

    def running() -> bool:
        reader.follow()
        assert reader.faults == []
        told = reader.newest.get(status)
        return told is not None and told.phase == "running" and tasks in reader.newest

    wait_until(running, LIMIT_S, "a running mission")
    added = reader.call(
        "/peckorder/add_task",
        "peckorder_msgs/srv/AddTask",
        points=[reader.made("geometry_msgs/msg/Point", *ADDED_AT)],
        geo_points=[],
        use_altitude=False,
        task="",
        value=50.0,
        service_s=0.0,
        kind="",
        opens_s=0.0,
        closes_s=0.0,
        due_s=0.0,
        reason="smoke",
    )

    def stands(task: str) -> str:
        reader.follow()
        board = {each.id: each.state for each in reader.newest[tasks].tasks}
        return str(board.get(task))

    wait_until(lambda: stands(added["task"]) == "done", LIMIT_S, f"the end of {added}")
    unknown = reader.call("/peckorder/hold", "peckorder_msgs/srv/CommandUav", uav="uav9", reason="")
    gone = [
        reader.call(
            "/peckorder/withdraw_task", "peckorder_msgs/srv/WithdrawTask", task=task, reason=""
        )
        for task in withdrawn
    ]
    wait_until(lambda: reader.newest[status].phase == "ended", LIMIT_S, "the end of the mission")
    types = reader.topics()
    wait_until(lambda: reader.counts.keys() >= types.keys(), LIMIT_S, "a message of every topic")
    board = {each.id: each.state for each in reader.newest[tasks].tasks}
    uav = reader.newest["/peckorder/uav/uav1/odometry"]
    return {
        "topics": types,
        "services": reader.services(),
        "counts": dict(reader.counts),
        "faults": reader.faults,
        "added": added,
        "unknown": unknown,
        "withdrawn": gone,
        "tasks": board,
        "frame": uav.header.frame_id,
        "mission": reader.newest[status].mission,
    }


if __name__ == "__main__":
    try:
        print(json.dumps(main(int(sys.argv[1]), Path(sys.argv[2]), sys.argv[3:])), flush=True)
    finally:
        ZenohSession.get_instance().close()  # else it would not end
