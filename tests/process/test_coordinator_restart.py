"""The coordinator's process dies, hangs, starts anew, or another one takes its place.

Every process is started by hand, as an operator does, and flies the same short mission, which is
kept open until the other coordinator has come. One task appears late.
"""

from __future__ import annotations

import contextlib
import signal
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from swarm.model import Mission, Origin, Task, TaskId, Uav, UavId
from tests.process.by_hand import LIMIT_S, ByHand
from tests.process.kept_open import kept_open, let_end

pytestmark = [pytest.mark.process]

UAVS = ["uav1", "uav2"]
POPUP_S = 30.0
STANDS_BY = "stands by for the coordinator"
TAKES_OVER = "takes the coordinator's place"


def _flown() -> Mission:
    rng = np.random.default_rng(3)
    places = [(float(x), float(y), 0.0) for x, y in rng.uniform(0.0, 150.0, (8, 2))]
    tasks = [Task(TaskId(f"t{n}"), place, 1.0, service_s=2.0) for n, place in enumerate(places)]
    popup = Task(TaskId("popup"), (60.0, 60.0, 0.0), 1.0, service_s=1.0, appears_s=POPUP_S)
    uavs = [Uav(UavId(u), (12.0 * n, 0.0, 0.0), 10.0) for n, u in enumerate(UAVS)]
    origin = Origin(46.8, 9.7, 1100.0)
    return kept_open(Mission("restart", 600.0, tuple(uavs), (*tasks, popup), origin=origin))


FLOWN = _flown()


@pytest.fixture
def by_hand(tmp_path: Path) -> Iterator[ByHand]:
    with contextlib.ExitStack() as stack:
        yield ByHand(tmp_path, stack, FLOWN, speedup=6)


@pytest.mark.parametrize("keeps_state", [True, False])
def test_a_killed_coordinator_started_anew_ends_the_mission(
    by_hand: ByHand, keeps_state: bool
) -> None:
    options = ["--state", str(by_hand.folder / "state")] if keeps_state else []
    first = by_hand.coordinator("first", *options)
    by_hand.wait_for_done(2)
    first.kill()
    first.wait()
    by_hand.wait_for("uav1", "lost")
    by_hand.wait_for_done(4)

    second = by_hand.coordinator("second", *options)
    by_hand.wait_for("second", "resumes the mission")
    let_end("--connect", by_hand.endpoint)
    assert second.wait(LIMIT_S) == 0, by_hand.log("second")
    by_hand.assert_all_done()
    assert second.stdout is not None
    assert second.stdout.read() == "", "it has made no plan to begin with"


def test_one_that_stands_by_takes_over_and_ends_the_mission(by_hand: ByHand) -> None:
    first = by_hand.coordinator("first")
    second = by_hand.coordinator("second", "--standby")
    by_hand.wait_for("second", STANDS_BY)
    by_hand.wait_for_done(2)
    assert second.poll() is None
    assert TAKES_OVER not in by_hand.log("second")
    first.kill()
    first.wait()
    by_hand.wait_for("second", TAKES_OVER)
    by_hand.wait_for("second", "resumes the mission")

    let_end("--connect", by_hand.endpoint)
    assert second.wait(LIMIT_S) == 0, by_hand.log("second")
    by_hand.assert_all_done()


def test_one_that_hung_gives_way_and_stands_by_for_the_one_that_took_over(by_hand: ByHand) -> None:
    first = by_hand.coordinator("first", "--standby")
    by_hand.wait_for("first", TAKES_OVER)
    second = by_hand.coordinator("second", "--standby")
    by_hand.wait_for("second", STANDS_BY)
    by_hand.wait_for_done(2)
    first.send_signal(signal.SIGSTOP)
    by_hand.wait_for("second", "resumes the mission")
    first.send_signal(signal.SIGCONT)
    by_hand.wait_for("first", "stands down")
    by_hand.wait_for("first", STANDS_BY)
    second.kill()
    second.wait()
    by_hand.wait_for("first", TAKES_OVER, times=2)

    let_end("--connect", by_hand.endpoint)
    assert first.wait(LIMIT_S) == 0, by_hand.log("first")
    by_hand.assert_all_done()
    assert by_hand.log("first").count(TAKES_OVER) == 2


def test_beside_a_living_coordinator_another_one_ends_with_a_clear_line(by_hand: ByHand) -> None:
    first = by_hand.coordinator("first")
    by_hand.wait_for_done(1)
    second = by_hand.coordinator("second")

    assert second.wait(60) == 1
    last = by_hand.log("second").splitlines()[-1]
    assert last == "a coordinator is already there; add --standby to wait for its loss"
    let_end("--connect", by_hand.endpoint)
    assert first.wait(LIMIT_S) == 0
    by_hand.assert_all_done()
