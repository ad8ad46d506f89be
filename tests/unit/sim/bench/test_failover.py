"""`swarm bench failover` and `swarm bench flood`: what is shown, and what is refused."""

from __future__ import annotations

import json
from collections.abc import Sequence

import pytest
from rich.console import Console

from coordinator.mission_view.results import MissionResult
from sim.bench.failover import (
    FailoverResults,
    FailoverSettings,
    bound_s,
)
from sim.bench.fleets import survey_mission
from sim.bench.latency import DecisionLatencies
from sim.bench.links import BAD_LINKS, FalseLosses, PartitionResult, Traffic
from sim.bench.machine import MachineInfo
from sim.bench.security import FloodBench
from sim.bench.takeover import FailureMode, Takeovers
from sim.fleet.faults.flood import RATE_HZ, Flood, long_mission, times_for
from sim.fleet.faults.forgery import Malformation
from sim.fleet.layout import BusKind
from swarm.cli import main
from swarm.model import TaskId, UavId
from swarm.protocol.timing import LinkKind

MACHINE = MachineInfo("a processor", 2, 2**32, "Linux x86_64", {"Python": "3.11"}, 0.5)
DONE = FailoverResults(
    MACHINE,
    FailoverSettings(seed=7),
    (
        Takeovers(FailureMode.KILL, LinkKind.NORMAL, BusKind.ROUTER, (0.51, 0.53), 0),
        Takeovers(FailureMode.HANG, LinkKind.CLEAN, BusKind.MESH, (1.2,), 1),
    ),
    (
        FalseLosses(BAD_LINKS[0], 5, 120.0, "tun", 0, 4000, 200),
        FalseLosses(BAD_LINKS[2], 5, 120.0, "relay", 3, 0, 0),
    ),
    (PartitionResult(10, 120, 30.0, 17, 0.8, 120, ()),),
    (Traffic(10, 20.0, {"Status": 1000, "Claim": 200}, {"Status": 200_000, "Claim": 20_000}),),
    (DecisionLatencies("guided", 5, 40, (0.002, 0.004)),),
)


def test_everything_measured_is_shown_in_80_columns() -> None:
    console = Console(width=80, color_system=None)
    with console.capture() as capture:
        console.print(DONE)
    lines = [" ".join(line.split()) for line in capture.get().splitlines()]

    assert max(len(line) for line in capture.get().splitlines()) <= 80
    assert "seed 7" in lines
    assert "kill normal router 2 0 0.51 0.53 0.53 1.00" in lines
    assert "hang clean mesh 2 1 1.20 never never 4.00" in lines
    assert "5% 30 normal 5 120 real 0 4000 200" in lines
    assert "20% 100 bad 5 120 imitated 3" in lines
    assert "10 30 120 120 17 0.80 0" in lines
    assert "10 6.0 5.0 1100 1000" in lines
    assert "guided 5 40 2 2.00 4.00 4.00" in lines


def test_json_holds_the_same_and_every_time() -> None:
    told = json.loads(json.dumps(DONE.as_json(), allow_nan=False))

    kill, hang = told["takeovers"]
    assert (kill["p99_s"], kill["bound_s"], kill["times_s"]) == (0.53, 1.0, [0.51, 0.53])
    assert (hang["trials"], hang["missed"], hang["p99_s"]) == (2, 1, None)
    assert [each["path"] for each in told["losses"]] == ["tun", "relay"]
    assert told["partitions"][0]["duplicates"] == 17
    assert told["traffic"][0]["messages_per_uav_s"] == 6.0
    assert told["latencies"][0]["p50_s"] == 0.002
    assert told["machine"]["cpu"] == "a processor"


def test_silent_agents_may_take_lease_and_silence() -> None:
    assert bound_s(FailureMode.KILL, LinkKind.BAD) == 1.0
    assert bound_s(FailureMode.HANG, LinkKind.NORMAL) == 6.5
    assert bound_s(FailureMode.DEADLOCK, LinkKind.BAD) == 28.0


def test_surveys_are_as_dense_whatever_their_size() -> None:
    small, large = survey_mission(3, 18, 0), survey_mission(100, 600, 0)

    assert (len(large.uavs), len(large.tasks)) == (100, 600)
    for mission in (small, large):
        side_m = max(max(task.position_enu_m) for task in mission.tasks)
        assert 0.8 * 40.0 <= side_m / len(mission.tasks) ** 0.5 <= 40.0


# -- flood ----------------------------------------------------------------------------------


def flooded(stale: int = 24, executed: Sequence[str] = ("t1",), fates: Sequence[str] = ()) -> Flood:
    routes = {UavId("uav1"): tuple(TaskId(task) for task in executed)}
    dropped = {"malformed": 27, "stale": stale}
    return Flood(
        result=MissionResult(routes, {}, 1.0, (TaskId("t1"),), (), (), 0, 1.0, (), 1),
        planned={UavId("uav1"): ("t1",)},
        sent={Malformation.RANDOM: 24, Malformation.OLD: 24},
        answers=5,
        flood_s=1.0,
        before={"uav1": {"malformed": 3}},
        after={"uav1": dropped},
        shown={"uavs": [{"id": "uav1", "dropped": dropped}]},
        fates=tuple(fates),
    )


def test_a_flood_is_survived_when_nothing_changes_and_all_is_counted() -> None:
    assert flooded().counted == {"uav1": {"malformed": 24, "stale": 24}}
    assert flooded().expected == {"malformed": 24, "stale": 24}
    assert flooded().ok
    assert not flooded(stale=10).ok
    assert not flooded(executed=("t2",)).ok
    assert not flooded(fates=["uav1: killed by SIGSEGV"]).ok


def test_a_flood_is_shown_with_all_counts() -> None:
    console = Console(width=80, color_system=None)
    with console.capture() as capture:
        console.print(FloodBench(MACHINE, 3, flooded()))
    lines = [" ".join(line.split()) for line in capture.get().splitlines()]
    told = json.loads(json.dumps(FloodBench(MACHINE, 3, flooded()).as_json()))

    assert "random bytes 24 malformed" in lines
    assert "stale 24 24" in lines
    assert lines[-1] == "nothing has changed and everything was counted"
    assert told["ok"]
    assert told["counted"] == {"uav1": {"malformed": 24, "stale": 24}}


def test_the_flooded_mission_decides_as_the_paper_does() -> None:
    short, long = long_mission(1.0), long_mission(20.0)

    assert long.horizon_s == 20.0 * short.horizon_s
    assert times_for(60.0) > times_for(20.0) >= 0.5
    assert RATE_HZ == 24.0


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["failover", "--what", "kill,luck"], "luck"),
        (["failover", "--bus", "pigeon"], "choose mesh or router"),
        (["failover", "--sizes", "3,many"], "many"),
        (["failover", "--trials", "0"], "trials"),
        (["flood", "--seconds", "1"], "seconds"),
    ],
)
def test_wrong_options_are_refused_in_one_line(
    words: list[str], told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["bench", *words]) == 2

    out, err = capsys.readouterr()
    assert out == ""
    assert told in err
    assert len(err.splitlines()) == 1
