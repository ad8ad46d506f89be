"""The command `swarm ros2`: what is wrong is told in one line, and who may take orders."""

from __future__ import annotations

from pathlib import Path

import pytest

from sim.fleet.keys import fresh_keys
from swarm.cli import main
from tests.support.builders import mission, task, uav

FLEET = mission([uav("u1")], [task("t0", 1.0)])
WRONG = {
    ("--ros-router", "tcp/192.168.1.2:7447"): (
        "--ros-router: tcp/192.168.1.2:7447 is another machine's or encrypted; "
        "say how in a Zenoh configuration file, and give that as --ros-config"
    ),
    ("--ros-router", "nowhere"): (
        "--ros-router: not an endpoint: 'nowhere'; "
        "write PROTOCOL/HOST:PORT with tcp, tls, quic or ws, as in tcp/127.0.0.1:7447"
    ),
    ("--node", "2fast"): (
        "--node: '2fast' cannot name a node of ROS 2; "
        "use letters, digits and single underscores, beginning with no digit"
    ),
    ("--ros-config", "missing.json5"): "--ros-config: no such file: missing.json5; give one",
}


@pytest.mark.parametrize(("words", "fault"), WRONG.items())
def test_what_is_wrong_is_told_in_one_line(
    words: tuple[str, ...], fault: str, capsys: pytest.CaptureFixture[str]
) -> None:
    status = main(["ros2", *words])

    assert status == 2
    assert capsys.readouterr() == ("", f"{fault}\n")


def test_a_viewer_may_look_on_and_an_operator_alone_takes_orders(
    capsys: pytest.CaptureFixture[str],
) -> None:
    with fresh_keys(FLEET) as keys:
        viewer, operator = keys.of_observer("onlooker"), keys.of_operator()

        def status(folder: Path, *words: str) -> int:
            seat = ["--keys", str(folder), "--connect", "tls/127.0.0.1:7447"]
            return main(["ros2", *seat, *words, "--check"])

        assert status(viewer) == 0
        assert status(operator, "--services") == 0
        assert capsys.readouterr().err == 2 * "swarm: these options are right\n"
        assert status(viewer, "--services") == 2
        told = capsys.readouterr().err
    assert told.count("\n") == 1
    assert told.endswith("whose role is viewer; give those of one whose role is operator\n")
