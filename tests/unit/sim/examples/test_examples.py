"""The examples do what their docstrings say."""

from __future__ import annotations

from pathlib import Path

import pytest

from sim.examples import (
    drive_one_agent,
    monte_carlo,
    own_decision_rule,
    plan_and_plot,
    read_recording,
)

FOLDER = Path(drive_one_agent.__file__).parent
EXAMPLES = sorted(FOLDER.glob("[a-z]*.py"))


def test_plans_are_compared_and_the_best_is_drawn(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    picture = tmp_path / "best.svg"
    plan_and_plot.main("table-1", str(picture))

    said = capsys.readouterr().out.splitlines()
    assert [line.split(":")[0].strip() for line in said[1:4]] == ["greedy", "lookahead", "guided"]
    assert "100.0% of 120.33 (proven optimal)" in said[3]
    assert "<svg" in picture.read_text()


def test_a_fleet_flies_by_the_users_rule(capsys: pytest.CaptureFixture[str]) -> None:
    own_decision_rule.main()

    said = capsys.readouterr().out.splitlines()
    heads = [line for line in said if " J " in line]
    assert [line.split(":")[0].strip() for line in heads] == [
        "soonest",
        "value_per_time",
        "greedy",
        "guided",
    ]
    assert "J 118.49" in heads[2]


def test_policies_meet_the_same_futures(capsys: pytest.CaptureFixture[str]) -> None:
    monte_carlo.main(trials=3)
    first = capsys.readouterr().out
    monte_carlo.main(trials=3)

    assert capsys.readouterr().out == first
    assert "in 3 futures" in first


def test_a_recording_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    read_recording.main()

    said = capsys.readouterr().out
    assert said.startswith("table-1: 8 of 8 tasks")
    assert "uav2" in said
    assert "chose" in said


def test_an_agent_flies_its_simulated_autopilot(capsys: pytest.CaptureFixture[str]) -> None:
    drive_one_agent.main()

    said = capsys.readouterr().out
    assert said.index("VehicleReady") < said.index("Arrived") < said.index("Home")
    assert said.splitlines()[-1].startswith("done: gate, barn; J ")


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_is_short_and_says_how_to_run_it(path: Path) -> None:
    text = path.read_text()

    assert len(text.splitlines()) < 80
    if path.stem != "__init__":
        assert f"python -m sim.examples.{path.stem}" in text
        assert 'if __name__ == "__main__":' in text
