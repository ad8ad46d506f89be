"""The scenario `ridge` flown over its hills by real processes."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.process.mission import SwarmRun
from tests.process.pace import pace

pytestmark = [pytest.mark.process]


def test_a_fleet_that_is_told_of_the_ground_keeps_from_it(tmp_path: Path) -> None:
    with SwarmRun(["ridge", "--speedup", f"{pace(8.0):g}"], tmp_path) as run:
        status, told = run.result()
        run.assert_nothing_left()

    assert status == 0, run.story()
    assert (told["open"], told["failed"], told["lost_uavs"]) == ([], [], [])
    # Statuses come once in some metres of flight, and are joined by chords.
    assert told["lowest_clearance_m"] >= 15.0 - 1.0, run.story()
    planned = [entry for entries in told["schedule"].values() for entry in entries]
    assert all(len(entry["up_m"]) == 1 + len(entry["via_m"]) for entry in planned)
