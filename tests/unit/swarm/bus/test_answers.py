"""What one who answers too often may cost whoever has asked."""

from __future__ import annotations

from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any, cast

import zenoh

from swarm.bus.port import Inbox
from swarm.bus.zenoh_bus import MOST_ANSWERS, ZenohBus
from tests.support.shell_play import play


@dataclass
class Session:
    """Where a question gets some answers at once: how many from each key."""

    given: dict[str, int]
    info: Any = field(
        default_factory=lambda: SimpleNamespace(
            declare_transport_events_listener=lambda *_args, **_more: None
        )
    )

    def get(self, _key_expr: str, handler: Any, **_: object) -> None:
        for key, times in self.given.items():
            payload = SimpleNamespace(to_bytes=lambda: b"a")
            reply = SimpleNamespace(ok=SimpleNamespace(key_expr=key, payload=payload))
            for _each in range(times):
                handler.callback(reply)
        handler.drop()

    def close(self) -> None:
        pass


def test_who_answers_a_question_without_end_is_not_listened_to_without_end() -> None:
    async def whole() -> None:
        import asyncio

        session = Session({"state/u0": 10_000, "state/u1": 1})
        loop = asyncio.get_running_loop()
        bus = ZenohBus(cast("zenoh.Session", session), Inbox(loop, 10))
        try:
            answers = await bus.query("state/*", timeout_s=5.0)
        finally:
            bus.close()
        keys = [answer.key for answer in answers]
        assert keys == ["state/u0"] * MOST_ANSWERS + ["state/u1"]

    play(whole)
