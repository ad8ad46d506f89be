"""Study files: what they may say, and one clear line for each thing that is wrong."""

from __future__ import annotations

from pathlib import Path

import pytest

from sim.study.design import Factor, RandomMissions, SameMission, Study
from sim.study.policies.roster import ROSTER
from sim.study.request import shipped_studies
from sim.study.study_file import format_study, load_study, parse_study
from sim.world.uncertainty import Uncertainty
from swarm.model import TaskId, UavId
from swarm.runtime.errors import InputError
from swarm.scenario import format_scenario, load_scenario, shipped_scenarios

LEAST = 'schema = 1\nname = "mine"\n[mission]\nrandom = { uavs = 2, tasks = 3 }\n'
WHOLE = """
schema = 1
name = "whole"
trials = 7
seed = 3
policies = ["greedy", "interval:30"]
reference = "interval:30"
bound = false
[mission]
random = { uavs = 2, tasks = 3 }
[uncertainty]
loss = 0.3
outcomes = true
lost_at_s = { uav1 = 12.5 }
withdrawn_at_s = { t3 = 40 }
reattempt = true
[[vary]]
what = "loss"
values = [0, 0.5]
trials = 5
[[vary]]
what = "wind_m_s"
values = [3.0]
"""


def faults(text: str, folder: Path = Path()) -> list[str]:
    with pytest.raises(InputError) as caught:
        parse_study(text.encode(), "s.toml", ROSTER, folder)
    return str(caught.value).splitlines()


def test_everything_a_file_says_is_read() -> None:
    assert parse_study(WHOLE.encode(), "s.toml", ROSTER) == Study(
        name="whole",
        missions=RandomMissions(2, 3),
        policies=("greedy", "interval:30"),
        trials=7,
        seed=3,
        reference="interval:30",
        bound=False,
        uncertainty=Uncertainty(
            loss=0.3,
            outcomes=True,
            lost_at_s={UavId("uav1"): 12.5},
            withdrawn_at_s={TaskId("t3"): 40.0},
        ),
        reattempt=True,
        varied=(Factor("loss", (0.0, 0.5), 5), Factor("wind_m_s", (3.0,))),
    )


def test_little_is_needed() -> None:
    study = parse_study(LEAST.encode(), "s.toml", ROSTER)

    assert study.policies == tuple(ROSTER.policies)
    assert study.uncertainty == Uncertainty()
    assert study.bound


@pytest.mark.parametrize("text", [LEAST, WHOLE])
def test_text_of_a_study_reads_back_as_the_same_study(text: str) -> None:
    study = parse_study(text.encode(), "s.toml", ROSTER)

    assert parse_study(format_study(study, "").encode(), "s.toml", ROSTER) == study


def test_scenario_beside_the_file_wins_over_a_shipped_one(tmp_path: Path) -> None:
    meadow = load_scenario(shipped_scenarios()["meadow"])
    (tmp_path / "table-1").write_text("is a name without .toml")
    (tmp_path / "mine.toml").write_text(format_scenario(meadow))
    text = 'schema = 1\nname = "x"\n[mission]\nscenario = "{}"\n'

    beside = parse_study(text.format("mine.toml").encode(), "s.toml", ROSTER, tmp_path)
    shipped = parse_study(text.format("meadow").encode(), "s.toml", ROSTER, tmp_path)

    assert beside.missions == SameMission(meadow) == shipped.missions


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (("schema = 1", "schema = 3"), "s.toml: schema: version 3 of the format is not known; "),
        (
            ("schema = 1", "schema = 2"),
            "s.toml: schema: does not fit: these missions are plain; say schema = 1",
        ),
        (("schema = 1\n", ""), "s.toml: schema: is missing; give schema = 1"),
        (('"mine"', '"a b"'), "s.toml: name: 'a b' is not an id; give an id of "),
        (('"mine"', '"mine"\ntrails = 9'), "s.toml: trails: unknown key; did you mean 'trials'?"),
        (('"mine"', '"mine"\nxyzzy = 9'), "s.toml: xyzzy: unknown key; the keys here are schema, "),
        (('"mine"', '"mine"\ntrials = 0'), "s.toml: trials: 0 is not >= 1; give an integer with"),
        (('"mine"', '"mine"\ntrials = 1.5'), "s.toml: trials: 1.5 is not an integer; give an "),
        (('"mine"', '"mine"\nseed = -1'), "s.toml: seed: -1 is not >= 0; give an integer with"),
        (('"mine"', '"mine"\nbound = 1'), "s.toml: bound: 1 is not true or false; give true or f"),
        (
            ('"mine"', '"mine"\npolicies = ["gredy"]'),
            "s.toml: policies[0]: no such policy 'gredy'; did you mean 'greedy'?",
        ),
        (
            ('"mine"', '"mine"\npolicies = ["greedy:3"]'),
            "s.toml: policies[0]: 'greedy:3' has a number, and greedy takes none; write 'greedy'",
        ),
        (
            ('"mine"', '"mine"\npolicies = ["interval:-3"]'),
            "s.toml: policies[0]: 'interval:-3' has no number > 0 behind the colon; give an ",
        ),
        (
            ('"mine"', '"mine"\npolicies = ["cbba", "cbba"]'),
            "s.toml: policies[1]: 'cbba' is there twice; name it once",
        ),
        (('"mine"', '"mine"\npolicies = []'), "s.toml: policies: is empty; give at least one in "),
        (('"mine"', '"mine"\npolicies = [3]'), "s.toml: policies[0]: 3 is not a string in quotes"),
        (
            ('"mine"', '"mine"\npolicies = ["cbba"]\nreference = "greedy"'),
            "s.toml: reference: 'greedy' is not one of them; give one of cbba",
        ),
        (("random = { uavs = 2, tasks = 3 }", ""), "s.toml: mission: is empty; give [mission] wit"),
        (("random = {", 'scenario = "meadow"\nrandom = {'), "s.toml: mission: has both a scenar"),
        (("uavs = 2", "uavs = 0"), "s.toml: mission.random.uavs: 0 is not >= 1; give an integer"),
        ((", tasks = 3", ""), "s.toml: mission.random.tasks: is missing; give an integer within"),
        (("tasks = 3 }", "tasks = 3, n = 1 }"), "s.toml: mission.random.n: unknown key; the key"),
        (
            ("3 }", "3 }\n[uncertainty]\nloss = 1.5"),
            "s.toml: uncertainty.loss: 1.5 is not within 0..1; give a probability within 0..1",
        ),
        (
            ("3 }", "3 }\n[uncertainty]\nwind_m_s = -1"),
            "s.toml: uncertainty.wind_m_s: -1 is not >= 0; give a number >= 0",
        ),
        (
            ("3 }", "3 }\n[uncertainty]\nwind_m_s = inf"),
            "s.toml: uncertainty.wind_m_s: inf is not a finite number; give a number >= 0",
        ),
        (
            ("3 }", '3 }\n[uncertainty]\noutcomes = "yes"'),
            "s.toml: uncertainty.outcomes: 'yes' is not true or false; give true or false",
        ),
        (
            ("3 }", "3 }\n[uncertainty]\nmesage_loss = 0.1"),
            "s.toml: uncertainty.mesage_loss: unknown key; did you mean 'message_loss'?",
        ),
        (
            ("3 }", "3 }\n[uncertainty]\nlost_at_s = { uav9 = 3 }"),
            "s.toml: uncertainty.lost_at_s.uav9: is not in the mission; did you mean 'uav",
        ),
        (
            ("3 }", "3 }\n[uncertainty]\nlost_at_s = { uav1 = -3 }"),
            "s.toml: uncertainty.lost_at_s.uav1: -3 is not >= 0; give a mission time >= 0 [s]",
        ),
        (
            ("3 }", '3 }\n[[vary]]\nwhat = "los"\nvalues = [1]'),
            "s.toml: vary[0].what: 'los' is not one of them; did you mean 'loss'?",
        ),
        (
            ("3 }", '3 }\n[[vary]]\nwhat = "loss"\nvalues = [0.1, 2]'),
            "s.toml: vary[0].values[1]: 2 is not within 0..1; give a probability within 0..1",
        ),
        (
            ("3 }", '3 }\n[[vary]]\nwhat = "loss"\nvalues = [0.1, 0.1]'),
            "s.toml: vary[0].values[1]: 0.1 is there twice; give it once",
        ),
        (
            ("3 }", '3 }\n[[vary]]\nwhat = "loss"'),
            "s.toml: vary[0].values: is missing; give at least one in an array, such as values",
        ),
        (
            ("[mission]", "vary = 3\n[mission]"),
            "s.toml: vary: 3 is not an array; give a table [[",
        ),
        (("[mission]", "vary = [3]\n[mission]"), "s.toml: vary[0]: 3 is not a table; give a tab"),
        (("schema", "= schema"), "s.toml: line 1, column 1: is not TOML: "),
    ],
)
def test_each_fault_is_one_clear_line(change: tuple[str, str], expected: str) -> None:
    (line,) = faults(LEAST.replace(*change, 1))

    assert line.startswith(expected)


def test_all_faults_are_told_at_once_in_the_order_of_the_file() -> None:
    text = LEAST.replace("uavs = 2", "uavs = 0") + '[uncertainty]\npopup = "a"\nloss = -1\n'

    places = [line.split(": ")[1] for line in faults(text)]

    assert places == ["mission.random.uavs", "uncertainty.popup", "uncertainty.loss"]


def test_same_number_is_not_varied_twice() -> None:
    table = '[[vary]]\nwhat = "loss"\nvalues = [0.1]\n'

    assert faults(LEAST + 2 * table) == [
        "s.toml: vary[1].what: loss is varied twice; put its values together"
    ]


def test_unknown_scenario_is_told_with_what_there_is(tmp_path: Path) -> None:
    text = 'schema = 1\nname = "x"\n[mission]\nscenario = "medow"\n'

    (line,) = faults(text, tmp_path)

    assert line.startswith("medow: no such scenario file; did you mean 'meadow'?")


@pytest.mark.parametrize("name", shipped_studies())
def test_shipped_study_is_right_and_bears_the_name_of_its_file(name: str) -> None:
    study = load_study(shipped_studies()[name], ROSTER)

    assert study.name == name
    assert study.compared_to == "central"


def test_table_of_the_readme_is_of_the_mission_that_is_promised() -> None:
    study = load_study(shipped_studies()["readme"], ROSTER)

    assert study.missions == RandomMissions(10, 50)
    assert study.uncertainty == Uncertainty(loss=0.3, popup=0.3)
    assert study.trials == 200
    assert not study.varied
