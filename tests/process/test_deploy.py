"""The Zenoh files of deploy/ open, and carry the settings the runtime uses by itself."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import zenoh

from swarm.bus.config import DEFAULT_LEASE_S
from swarm.bus.zenoh_session import session_config
from tests.process.mission import wait_until
from tests.process.router_processes import HOLDER, router, started

pytestmark = pytest.mark.process

FOLDER = Path(__file__).parents[2] / "deploy" / "zenoh"
SETTINGS = (
    "connect/retry",
    "scouting/delay",
    "scouting/multicast/enabled",
    "scouting/gossip/enabled",
    "transport/shared_memory/enabled",
    "transport/link/tx/lease",
    "transport/link/tx/keep_alive",
    "transport/link/tx/queue/congestion_control/block/wait_before_close",
    "transport/link/rx/max_message_size",
    "transport/unicast/open_timeout",
    "transport/unicast/accept_timeout",
)


@pytest.mark.parametrize("mode", ["router", "client"])
def test_file_says_what_the_runtime_does_by_itself(mode: str) -> None:
    file = zenoh.Config.from_file(FOLDER / f"{mode}.json5")
    own = session_config(mode, listen=[], connect=[], lease_s=DEFAULT_LEASE_S)

    assert json.loads(file.get_json("mode")) == mode
    for setting in SETTINGS:
        assert file.get_json(setting) == own.get_json(setting), setting


def test_fleet_meets_at_a_router_of_the_shipped_files(tmp_path: Path) -> None:
    with router("--config", str(FOLDER / "router.json5"), "--listen", "tcp/127.0.0.1:0") as (
        _,
        endpoint,
    ):
        client = tmp_path / "client.json5"
        text = (FOLDER / "client.json5").read_text()
        client.write_text(text.replace("tcp/127.0.0.1:7447", endpoint))
        config = zenoh.Config.from_file(client)
        with (
            started("-c", HOLDER, "client", "a/token", endpoint) as holder,
            zenoh.open(config) as session,
        ):
            assert holder.stdout is not None
            assert holder.stdout.readline() == "ready\n"

            def tokens() -> list[str]:
                replies = session.liveliness().get("a/*", timeout=5.0)
                return [str(reply.ok.key_expr) for reply in replies if reply.ok is not None]

            wait_until(lambda: tokens() == ["a/token"], 10.0, "the token")
