"""Several agents of one process begin one after the other, and none ends with another."""

from __future__ import annotations

import asyncio

import pytest

from agent.core.agent_core import AgentCore
from agent.lives import Life, live_together
from agent.runner import OnReport, Vehicle
from swarm.cli import main
from swarm.protocol.messages import MissionConfig
from swarm.runtime.store import Memory


class OwnError(Exception):
    """Stands for a bug."""


def life(uav: str) -> Life:
    def no_core(memory: Memory | None) -> AgentCore:
        raise NotImplementedError

    def no_vehicle(brief: MissionConfig, report: OnReport) -> Vehicle:
        raise NotImplementedError

    return Life(uav, no_core, no_vehicle, None)


def test_each_begins_when_the_one_before_has_joined() -> None:
    begun: list[str] = []
    joining: dict[str, asyncio.Event] = {}

    async def live_one(each: Life, joined: asyncio.Event) -> int:
        begun.append(each.uav)
        joining[each.uav] = joined
        await joined.wait()
        return 0

    async def scenario() -> None:
        lives = [life("u0"), life("u1"), life("u2")]
        running = asyncio.create_task(live_together(lives, live_one, join_s=1000.0))
        for count in (1, 2, 3):
            for _ in range(20):
                await asyncio.sleep(0)
            assert begun == ["u0", "u1", "u2"][:count]
            joining[begun[-1]].set()
        assert await running == 0

    asyncio.run(scenario())


def test_one_that_does_not_join_keeps_nobody_waiting_for_ever() -> None:
    async def live_one(each: Life, joined: asyncio.Event) -> int:
        del joined
        begun.append(each.uav)
        if len(begun) == 2:
            all_there.set()
        await all_there.wait()
        return 0

    async def scenario() -> int:
        return await live_together([life("u0"), life("u1")], live_one, join_s=0.0)

    begun: list[str] = []
    all_there = asyncio.Event()
    assert asyncio.run(scenario()) == 0
    assert begun == ["u0", "u1"]


def test_a_bug_in_one_is_told_and_ends_no_other(capsys: pytest.CaptureFixture[str]) -> None:
    async def live_one(each: Life, joined: asyncio.Event) -> int:
        joined.set()
        if each.uav == "u0":
            raise OwnError
        await asyncio.sleep(0)
        ended.append(each.uav)
        return 0

    async def scenario() -> int:
        return await live_together([life("u0"), life("u1")], live_one)

    ended: list[str] = []
    assert asyncio.run(scenario()) == 1
    assert ended == ["u1"]
    told = capsys.readouterr().err
    assert "crashed" in told
    assert "OwnError" in told
    assert "uav=u0" in told


TWO = ["agent", "--mission", "m", "--uav", "u", "--uav", "v", "--mavlink", "tcp:127.0.0.1:1"]
BOTH = [*TWO, "--mavlink", "tcp:127.0.0.1:2"]


def test_several_uavs_each_have_an_autopilot() -> None:
    assert main([*BOTH, "--check"]) == 0
    assert main([*BOTH, "--system-id", "1", "--system-id", "2", "--check"]) == 0


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (TWO, "--mavlink: 1 for 2 UAVs; give one for each, in the same order"),
        (
            [*BOTH, "--system-id", "3"],
            "--system-id: 1 for 2 UAVs; give one for each, in the same order",
        ),
        ([*BOTH, "--uav", "u"], "--uav: u, v, u: one is named twice; name each once"),
        ([*BOTH, "--uav", "*"], "--uav: '*' is no id; "),
        (
            [*BOTH, "--bus", "mesh", "--listen", "tcp/127.0.0.1:0"],
            "--bus: there is one place for 2 UAVs; let them meet at a router",
        ),
    ],
)
def test_several_uavs_that_cannot_share_a_process_are_told(
    arguments: list[str], line: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(arguments) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith(line)
    assert err.count("\n") == 1
