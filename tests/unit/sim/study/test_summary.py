from __future__ import annotations

import json
import math
from dataclasses import replace
from io import StringIO
from itertools import pairwise

import numpy as np
import pytest
from rich.console import Console

from sim.study.statistics import Estimate, mean_of, ratio_of, share_of
from sim.study.summary import StudyDescription, StudySummary, summarise
from sim.study.trial import BOUND
from sim.world.uncertainty import Uncertainty
from tests.support.study_rows import study_rows

ABOUT = StudyDescription(
    missions="random missions of 3 UAVs and 9 tasks",
    uncertainty=Uncertainty(loss=0.3),
    seed=7,
    machine="a machine",
    ideal=frozenset({"central"}),
    what={"greedy": "takes the best now"},
)


def terminal(summary: StudySummary, width: int = 100) -> str:
    console = Console(file=StringIO(), width=width)
    console.print(summary.table())
    assert isinstance(console.file, StringIO)
    return console.file.getvalue()


# -- figures ----------------------------------------------------------------------------


def test_policies_are_compared_with_the_reference_trial_by_trial() -> None:
    rows = study_rows(("central", "greedy"), trials=20)
    found = summarise(rows, "central").settings[0].policies

    central, greedy, bound = (
        [row.value for row in rows if row.policy == name] for name in ("central", "greedy", BOUND)
    )
    assert found["greedy"].value == mean_of(greedy)
    assert found["greedy"].ratio == ratio_of(greedy, central)
    assert found["greedy"].of_bound == ratio_of(greedy, bound)
    assert found["greedy"].better == share_of(int(np.greater(greedy, central).sum()), 20)
    churn = [(row.moved or 0) + (row.released or 0) for row in rows if row.policy == "greedy"]
    assert found["greedy"].means["churn"] == mean_of(churn)


def test_reference_differs_from_itself_by_exactly_nothing() -> None:
    found = summarise(study_rows(("central", "greedy"), trials=9), "central").settings[0]

    assert found.policies["central"].ratio == Estimate(1.0, 1.0, 1.0, 9)
    assert found.policies["central"].difference == Estimate(0.0, 0.0, 0.0, 9)
    assert found.policies["central"].better == share_of(0, 9)


def test_only_trials_that_both_flew_are_compared() -> None:
    rows = study_rows(("central", "greedy"), trials=10)
    some = [row for row in rows if row.policy != "greedy" or row.trial >= 4]
    late = [row for row in rows if row.trial >= 4]

    found = summarise(some, "central").settings[0]

    assert found.trials == 10
    assert found.policies["central"].trials == 10
    assert found.policies["greedy"].trials == 6
    alone = summarise(late, "central").settings[0].policies["greedy"]
    assert found.policies["greedy"] == alone


def test_order_of_rows_changes_nothing() -> None:
    rows = study_rows(("central", "greedy", "guided"), {"loss": (0.0, 0.5)}, trials=6)

    one, other = summarise(rows, "central"), summarise(rows[::-1], "central")

    assert one.as_json() == other.as_json()
    assert one.markdown() == other.markdown()


def test_study_without_its_reference_or_bound_has_values_alone() -> None:
    rows = [row for row in study_rows(("central", "greedy"), trials=5) if row.policy == "greedy"]
    summary = summarise(rows, "central")

    found = summary.settings[0].policies["greedy"]
    assert (found.ratio, found.difference, found.better, found.of_bound) == (None,) * 4
    assert found.value.n == 5
    assert "| greedy |" in summary.markdown()
    assert "bound" not in summary.markdown()


def test_policies_are_listed_best_first_and_the_bound_last() -> None:
    rows = study_rows(("greedy", "central", "guided"), {"loss": (0.1,)}, trials=5)

    assert summarise(rows, "central").policies == ["guided", "central", "greedy", BOUND]
    worthless = [replace(row, value=row.value - 1e6) for row in rows]
    assert summarise(worthless, "central").policies == ["guided", "central", "greedy", BOUND]


def test_wall_times_are_medians_over_trials_and_the_longest_of_all() -> None:
    rows = study_rows(("central",), trials=5)
    wall = summarise(rows, "central").settings[0].policies["central"].wall

    def column(name: str) -> list[float]:
        return [getattr(row, name) for row in rows if row.policy == "central"]

    assert wall is not None
    assert wall.median_s == np.median(column("decision_median_wall_s"))
    assert wall.p99_s == np.median(column("decision_p99_wall_s"))
    assert wall.max_s == max(column("decision_max_wall_s"))


def test_settings_are_grouped_by_what_is_varied_and_sorted_by_its_value() -> None:
    rows = study_rows(("central",), {"loss": (0.5, 0.1), "popup": (0.2,)}, trials=2)
    summary = summarise(rows, "central")

    assert summary.own is summary.settings[0]
    assert {name: [each.at for each in them] for name, them in summary.varied.items()} == {
        "loss": [0.1, 0.5],
        "popup": [0.2],
    }


# -- as JSON ----------------------------------------------------------------------------


def test_json_is_finite_or_null_even_for_one_trial() -> None:
    summary = summarise(study_rows(("central", "greedy"), {"loss": (0.1,)}, trials=1), "central")

    text = json.dumps(summary.as_json(), allow_nan=False)

    greedy = json.loads(text)["settings"][1]["policies"]["greedy"]
    assert greedy["ratio"]["value"] > 0.0
    assert greedy["ratio"]["low_95"] is None
    assert greedy["ratio"]["n"] == 1


def test_json_has_the_keys_that_are_promised() -> None:
    found = summarise(study_rows(("central",), trials=3), "central", ABOUT).as_json()

    assert list(found) == [
        "reference", "missions", "uncertainty", "seed", "machine", "ideal_communication",
        "settings",
    ]  # fmt: skip
    (setting,) = json.loads(json.dumps(found["settings"]))
    assert list(setting) == ["point", "vary", "at", "trials", "policies"]
    central, bound = setting["policies"].values()
    assert list(central) == [
        "trials", "value", "ratio", "difference", "better", "of_bound", "complete", "means",
        "decision_wall_s",
    ]  # fmt: skip
    assert set(central["means"]) == {
        "done", "failed", "missed", "duplicate_visits", "makespan_s", "lost_uavs", "epochs",
        "moved", "released", "churn", "messages", "decisions",
    }  # fmt: skip
    assert (bound["means"], bound["complete"], bound["decision_wall_s"]) == ({}, None, None)


# -- as text ----------------------------------------------------------------------------


def test_document_says_what_was_flown_and_shows_every_policy() -> None:
    text = summarise(study_rows(("central", "greedy"), trials=4), "central", ABOUT).markdown()

    assert text.startswith(
        "Random missions of 3 UAVs and 9 tasks; each UAV is lost with probability 30 %; "
        "4 trials, seed 7.\n"
    )
    assert "| policy | J [value·s] | J / central's | better in | J / bound | all done in |" in text
    assert "| central † |" in text
    assert "| clairvoyant (bound) |" in text
    assert "- `greedy`: takes the best now" in text
    assert text.count("a machine") == 1
    lines = text.splitlines()
    for above, below in pairwise(lines):  # tables are whole
        if above.startswith("|") and below.startswith("|"):
            assert above.count("|") == below.count("|")


def test_document_shows_what_is_varied_in_columns_and_other_settings_on_request() -> None:
    rows = study_rows(("central", "greedy"), {"loss": (0.1, 0.4)}, trials=4)
    summary = summarise(rows, "central")

    assert "| policy | 10 % | 40 % |" in summary.markdown()
    assert "J of central [value·s]" in summary.markdown()
    assert "UAVs lost: 40 %" not in summary.markdown()
    assert "**Per mission, UAVs lost: 40 %**" in summary.markdown(every_setting=True)


@pytest.mark.parametrize("width", [60, 80, 100])
def test_terminal_shows_all_policies_and_values_in_parts_that_fit(width: int) -> None:
    values = tuple(0.1 * i for i in range(8))
    rows = study_rows(("central", "greedy", "value-per-time"), {"loss": values}, trials=3)
    text = terminal(summarise(rows, "central", ABOUT), width)

    assert max(len(line) for line in text.splitlines()) <= width
    assert "…" not in text
    for value in values:
        assert f"{100.0 * value:g} %" in text
    assert text.count("value-per-time") >= 4


def test_rounding_makes_nobody_better() -> None:
    rows = study_rows(("central",), trials=8)
    same = [
        replace(row, policy="same", value=row.value * (1.0 + 1e-14))
        for row in rows
        if row.policy == "central"
    ]
    found = summarise([*rows, *same], "central").settings[0].policies["same"]

    assert found.better == share_of(0, 8)


def test_study_without_rows_says_so() -> None:
    summary = summarise([], "central")

    assert "No trials yet." in summary.markdown()
    assert "No trials yet." in terminal(summary)
    assert summary.as_json()["settings"] == []


@pytest.mark.parametrize("trials", [1, 2])
def test_few_trials_are_shown_as_few(trials: int) -> None:
    text = summarise(study_rows(("central", "greedy"), trials=trials), "central").markdown()

    assert ("[−∞, ∞]" in text) == (trials == 1)
    assert f"{trials} trial" in text
    assert str(math.nan) not in text
