"""A ground station at one port sees a fleet of real processes, and is heeded as far as it may be.

By a client of our own, and by MAVProxy where `SWARM_MAVPROXY` names it, such as
``~/mavproxy/bin/mavproxy.py`` of an environment of its own.
"""

from __future__ import annotations

import contextlib
import os
import re
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Self

import pytest

from agent.vehicle.station_desk import ASK, CONFIRM, WISHES
from tests.process.by_hand import ByHand
from tests.process.long_fleet import UAVS, does, long_mission_of_three
from tests.process.mission import wait_until
from tests.support.udp_station import UdpStation, hostile_words

pytestmark = [pytest.mark.process]

LIMIT_S = 120.0
HOLD, RESUME, RETURN, _, ABORT = WISHES
ACCEPTED, NOT_NOW = 0, 1
MAVPROXY = os.environ.get("SWARM_MAVPROXY")


@contextlib.contextmanager
def shown(folder: Path, url: str) -> Iterator[ByHand]:
    """Three vehicles of a fleet that is under way, shown to a ground station."""
    with contextlib.ExitStack() as stack:
        options = ["--forward", url, "--station-actions"]
        mission = long_mission_of_three("shown")
        by_hand = ByHand(folder, stack, mission, speedup=4, agent_options=options)
        by_hand.coordinator("coordinator")
        for uav in UAVS:
            by_hand.wait_for(uav, "event=decided")
        yield by_hand


def test_a_ground_station_sees_a_fleet_at_one_port_and_moves_it_by_its_actions_alone(
    tmp_path: Path,
) -> None:
    with UdpStation() as station, shown(tmp_path, station.url) as by_hand:
        wait_until(lambda: station.systems == {1, 2, 3}, LIMIT_S, "three vehicles")
        wait_until(lambda: (2, "tasks_open") in station.values, LIMIT_S, "named values")
        assert station.values[2, "tasks_open"] == 6
        wait_until(
            lambda: any(
                text.startswith("uav2 flying t") for system, text in station.texts if system == 2
            ),
            LIMIT_S,
            "a text of what it does",
        )

        before = dict(station.modes)
        beats = station.counts.copy()
        for _ in range(5):
            for word in hostile_words():
                station.say(word)
        wait_until(
            lambda: all(
                station.counts[n, 1, "HEARTBEAT"] >= beats[n, 1, "HEARTBEAT"] + 12
                for n in (1, 2, 3)
            ),
            LIMIT_S,
            "more heartbeats",
        )
        assert station.modes == before, "no mode has changed, nobody was disarmed"
        assert station.acks == [], "and nobody has answered"

        station.act(HOLD, 2)
        wait_until(lambda: station.results(2, HOLD) == [ACCEPTED], LIMIT_S, "an answer")
        by_hand.wait_for("uav2", "event=released")
        wait_until(lambda: does(by_hand, "uav2") == "holding", LIMIT_S, "a hold")
        assert {does(by_hand, uav) for uav in ("uav1", "uav3")}.isdisjoint({"holding"})
        station.act(RESUME, 2)
        wait_until(lambda: station.results(2, RESUME) == [ACCEPTED], LIMIT_S, "an answer")
        by_hand.wait_for("uav2", "event=decided", times=2)

        station.act(RETURN, 3)
        assert by_hand.agents[2].wait(LIMIT_S) == 0, by_hand.log("uav3")
        assert station.results(3, RETURN) == [ACCEPTED]

        station.act(ABORT, 1, CONFIRM)
        wait_until(lambda: station.results(1, ABORT) == [NOT_NOW], LIMIT_S, "a refusal")
        station.act(ABORT, 1, ASK)
        station.act(ABORT, 1, CONFIRM)
        assert [by_hand.agents[n].wait(LIMIT_S) for n in (0, 1)] == [0, 0]
        assert station.results(1, ABORT) == [NOT_NOW, ACCEPTED, ACCEPTED]
        assert station.results(2, ABORT) == [], "it was not addressed, though it heeds it"
        assert by_hand.done() == []


@pytest.mark.skipif(MAVPROXY is None, reason="SWARM_MAVPROXY names no mavproxy.py")
def test_mavproxy_sees_three_vehicles_at_one_port_and_its_actions_are_obeyed(
    tmp_path: Path,
) -> None:
    assert MAVPROXY is not None
    with UdpStation() as unused:
        port = unused.url.rpartition(":")[2]
    with (
        shown(tmp_path, f"udp:127.0.0.1:{port}") as by_hand,
        Mavproxy(MAVPROXY, port, tmp_path) as mavproxy,
    ):
        for system in (1, 2, 3):
            mavproxy.wait_for(rf"Detected vehicle {system}:1\b")
        mavproxy.type("vehicle 2", "mode LAND", "arm throttle", "disarm force", "mode RTL")
        mavproxy.wait_for("Set vehicle 2")
        mavproxy.type("vehicle 2:191", f"long {HOLD}")
        mavproxy.wait_for("Got COMMAND_ACK: USER_1: ACCEPTED")
        wait_until(lambda: does(by_hand, "uav2") == "holding", LIMIT_S, "a hold")
        mavproxy.wait_for("held at a ground station")
        for uav in UAVS:
            assert "vehicle given up" not in by_hand.log(uav)
        mavproxy.type(f"long {RESUME}")
        mavproxy.wait_for("Got COMMAND_ACK: USER_2: ACCEPTED")
        by_hand.wait_for("uav2", "event=decided", times=2)
        mavproxy.type(f"long {ABORT} {ASK:g}", f"long {ABORT} {CONFIRM:g}")
        assert [agent.wait(LIMIT_S) for agent in by_hand.agents] == [0, 0, 0]


class Mavproxy:
    """MAVProxy at a UDP port, typed to as by a person. Use it in ``with``."""

    def __init__(self, program: str, port: str, folder: Path) -> None:
        assert shutil.which(program), program
        self._log = folder / "mavproxy.log"
        self._file = self._log.open("w")
        master = ["--master", f"udpin:127.0.0.1:{port}", "--no-state", "--mav20"]
        self._process = subprocess.Popen(
            [program, *master, "--default-modules", "cmdlong,arm,mode,misc"],
            stdin=subprocess.PIPE,
            stdout=self._file,
            stderr=subprocess.STDOUT,
            text=True,
            cwd=folder,
            env={**os.environ, "PYTHONUNBUFFERED": "1"},
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        assert self._process.stdin is not None
        self._process.stdin.close()
        self._process.kill()
        self._process.wait()
        self._file.close()

    def type(self, *lines: str) -> None:
        """At its prompt."""
        assert self._process.stdin is not None
        for line in lines:
            self._process.stdin.write(f"{line}\n")
            self._process.stdin.flush()

    def wait_for(self, pattern: str) -> None:
        """Until it has printed that."""
        wait_until(
            lambda: re.search(pattern, self._log.read_text()) is not None,
            LIMIT_S,
            f"{pattern!r} in {self._log.read_text()}",
        )
