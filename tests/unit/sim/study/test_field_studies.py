"""Studies of missions in the field: their files, and all their policies in the same futures."""

from __future__ import annotations

import pytest

from sim.study.design import Factor, RandomMissions, Study
from sim.study.field_generator import FieldShape
from sim.study.policies.roster import ROSTER
from sim.study.runner import fly_here, run_study
from sim.study.store import RowStore
from sim.study.study_file import format_study, parse_study
from sim.study.trial import COLUMNS, TrialContext, TrialRow, columns_of
from sim.world.uncertainty import Uncertainty
from swarm.runtime.errors import InputError
from tests.support.study_rows import without_wall_times

SHAPE = FieldShape(endurance_frac=0.6, bases=2.0, zones=2.0, windows_frac=0.5)
TEXT = """\
schema = 2
name = "field"
[mission]
random = { uavs = 3, tasks = 8, endurance_frac = 0.6, bases = 2, zones = 2, windows_frac = 0.5 }
[[vary]]
what = "zones"
values = [0, 4]
trials = 1
"""
POLICIES = ("guided-alone", "central", "cbba", "greedy", "frozen", "nearest", "value-per-time")


def flown(study: Study) -> list[TrialRow]:
    def no_progress(done: int, total: int) -> None:
        pass

    rows = run_study(TrialContext(study, ROSTER), RowStore(study), fly_here, no_progress)
    return [without_wall_times(row) for row in rows]


def faults(text: str) -> list[str]:
    with pytest.raises(InputError) as caught:
        parse_study(text.encode(), "s.toml", ROSTER)
    return str(caught.value).splitlines()


def test_a_study_in_the_field_is_read_and_written() -> None:
    study = parse_study(TEXT.encode(), "s.toml", ROSTER)

    assert study.missions == RandomMissions(3, 8, SHAPE)
    assert study.in_field
    assert not study.bound
    assert "central-divert" not in study.policies
    assert [point.missions.of_trial(0, 0).zones == () for point in study.points()] == [
        False,
        True,
        False,
    ]
    assert parse_study(format_study(study, "").encode(), "s.toml", ROSTER) == study


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (("schema = 2", "schema = 1"), "s.toml: mission.random.endurance_frac: needs another sch"),
        (("= 0.5 }", "= 1.5 }"), "s.toml: mission.random.windows_frac: 1.5 is not within 0..1"),
        (("[mission]", "bound = true\n[mission]"), "s.toml: bound: no bound is known of missions"),
        (
            ("[mission]", 'policies = ["central-divert"]\n[mission]'),
            "s.toml: policies[0]: does not heed the field's constraints; give one of guided, ",
        ),
    ],
)
def test_each_fault_is_a_clear_line(change: tuple[str, str], expected: str) -> None:
    assert faults(TEXT.replace(*change, 1))[0].startswith(expected)


def test_columns_of_plain_studies_stay() -> None:
    plain = Study("plain", RandomMissions(2, 3), ("greedy",), 1)
    field = Study("field", RandomMissions(2, 3, SHAPE), ("greedy",), 1)

    assert columns_of(plain) == COLUMNS
    assert COLUMNS[-1] == "decision_max_wall_s"
    assert columns_of(field) == (*COLUMNS, "required_left", "breaches")


def test_nobody_breaks_a_constraint_and_the_same_seed_tells_the_same() -> None:
    study = Study(
        "field",
        RandomMissions(3, 8, SHAPE),
        POLICIES,
        trials=2,
        reference="central",
        bound=False,
        uncertainty=Uncertainty(loss=0.3, popup=0.3),
    )

    rows = flown(study)

    assert [row.breaches for row in rows] == [0] * len(rows)
    assert all(row.required_left == row.missed for row in rows)
    assert flown(study) == rows


def test_with_nothing_uncertain_lists_are_flown_as_they_were_planned() -> None:
    policies = ("guided-alone", "central", "frozen")
    study = Study("field", RandomMissions(3, 6, SHAPE), policies, trials=2, bound=False)

    rows = flown(study)

    for trial in range(2):
        values = {row.policy: row.value for row in rows if row.trial == trial}
        assert values["frozen"] == pytest.approx(values["guided-alone"], rel=1e-6)
        assert values["central"] >= values["frozen"] * (1.0 - 1e-6)


def test_what_is_varied_of_missions_needs_missions_in_the_field() -> None:
    study = Study(
        "field", RandomMissions(3, 8, SHAPE), ("greedy",), 1, varied=(Factor("zones", (2.0, 0.0)),)
    )

    assert [point.world for point in study.points()] == [0, 0, 2]
