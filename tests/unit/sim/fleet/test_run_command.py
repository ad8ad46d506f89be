"""`swarm run` refuses what the processes it starts would refuse."""

from __future__ import annotations

import pytest

from sim.fleet.firmware import FirmwareKind
from sim.fleet.launcher import Launcher
from swarm.cli import main


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (["--autopilot", "ardupilot"], "--autopilot: ardupilot: no firmware is known; "),
        (["--autopilot", "tcp:127.0.0.1:1"], "no URL for uav2, uav3; "),
        (["--command", "uav9=mission"], "--command: uav9=mission: no UAV 'uav9'; "),
        (["--forward", "tcp:127.0.0.1:1"], "--forward: tcp:127.0.0.1:1: 'tcp' is no kind of link"),
        (["--signing-key", "/no/such/key"], "/no/such/key: cannot be read"),
        (["--keys", "/no/such/keys"], "/no/such/keys"),
        (["--battery-reserve", "much"], "--battery-reserve"),
        (["--fence-radius-m", "0"], "--fence-radius-m"),
        (["--fence-height-m", "high"], "--fence-height-m"),
        (["--without-bus-s", "0"], "--without-bus-s"),
        (
            ["--speedup", "2", "--autopilot", "tcp:h:1,tcp:h:2,serial:/dev/ttyUSB0:57600"],
            "--speedup: 2: the vehicle of uav3 at serial:/dev/ttyUSB0:57600 is real, ",
        ),
        (["--fault", "uav1:rain@5"], "--fault: "),
        (["--fault", "uav9:pilot@5"], "--fault: "),
    ],
)
def test_a_wrong_value_is_one_clear_line_before_anything_is_started(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    arguments: list[str],
    line: str,
) -> None:
    for kind in FirmwareKind:
        monkeypatch.delenv(kind.variable, raising=False)
    started: list[object] = []
    monkeypatch.setattr(Launcher, "start", started.append)

    assert main(["run", "table-1", *arguments]) == 2

    out, err = capsys.readouterr()
    assert out == ""
    assert line in err
    assert len(err.splitlines()) == 1
    assert started == []
