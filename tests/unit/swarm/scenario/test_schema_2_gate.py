"""No command passes over a word of schema 2: those that do not heed it yet say so."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from swarm.cli import main
from swarm.runtime.errors import InputError
from swarm.scenario import parse_scenario, require_plain
from tests.support.small_scenario import VALID as SCHEMA_1
from tests.unit.swarm.scenario.test_schema_2_read import VALID as SCHEMA_2

ALL = (
    "airspeed_m_s, endurance_s, due_s, opens_s, closes_s, path_m, trigger_m, height_m, "
    "wind_m_s, [[base]], [[zone]] and band_m"
)


@pytest.mark.parametrize("command", [["turnaround", "FILE"], ["plan", "FILE", "--scaling"]])
def test_commands_name_what_they_do_not_heed(
    command: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "field.toml"
    path.write_text(SCHEMA_2)

    status = main(["bench", *(word.replace("FILE", str(path)) for word in command)])

    told = capsys.readouterr()
    line = f"swarm bench: does not heed {ALL} of mission field yet"
    assert (status, line in told.err) == (2, True)


def test_one_word_and_a_task_that_nobody_can_do_are_named() -> None:
    plain = parse_scenario(SCHEMA_1.encode(), "s.toml")
    calm = replace(plain, zone_margin_m=5.0, wind_enu_m_s=(0.0, 0.0))
    require_plain(plain, "swarm plan")
    require_plain(calm, "swarm plan")  # without zones it asks for nothing

    with pytest.raises(InputError) as caught:
        require_plain(replace(plain, wind_enu_m_s=(0.0, 1.0)), "swarm plan")
    assert str(caught.value) == (
        "swarm plan: does not heed wind_m_s of mission small yet; leave it out"
    )
    unable = replace(plain.uavs[1], success={"t2": 0.0, "t1": 0.0})
    with pytest.raises(InputError, match="does not heed task t1, at which nobody can succeed of"):
        require_plain(replace(plain, uavs=(unable,)), "swarm plan")
