"""Studies as they are flown: common random numbers, rows, and going on where they stopped."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from sim.study.design import Factor, RandomMissions, SameMission, Study, fate_seed, span_s
from sim.study.runner import fly_here, run_study
from sim.study.store import FolderStore, RowStore, read_rows, write_parquet
from sim.study.summary import summarise
from sim.study.trial import (
    BOUND,
    COLUMNS,
    TrialContext,
    TrialJob,
    TrialRow,
    jobs_of,
)
from sim.world.uncertainty import Uncertainty
from swarm.runtime.errors import InputError
from swarm.scenario import load_scenario, shipped_scenarios
from tests.support.fake_policies import FAKES, Interrupted
from tests.support.study_rows import without_wall_times

STUDY = Study(
    name="test",
    missions=RandomMissions(3, 5),
    policies=("in-order:20", "same"),
    trials=3,
    uncertainty=Uncertainty(loss=0.3, popup=0.3, outcomes=True),
    varied=(Factor("loss", (0.0, 0.3, 0.6), trials=4), Factor("popup", (1.0,))),
)


def no_progress(done: int, total: int) -> None:
    pass


def flown(study: Study) -> list[TrialRow]:
    rows = run_study(TrialContext(study, FAKES), RowStore(study), fly_here, no_progress)
    return [without_wall_times(row) for row in rows]


def test_rows_are_those_of_every_point_trial_and_policy_in_order() -> None:
    rows = flown(STUDY)

    expected = [
        (point, trial, policy)
        for point, trials in ((0, 3), (1, 4), (2, 4), (3, 4), (4, 3))
        for trial in range(trials)
        for policy in (BOUND, "in-order:20", "same")
    ]
    assert [row.key for row in rows] == expected
    assert {(row.point, row.vary, row.at) for row in rows} == {
        (0, "", None),
        (1, "loss", 0.0),
        (2, "loss", 0.3),
        (3, "loss", 0.6),
        (4, "popup", 1.0),
    }


def test_points_with_the_same_setting_share_what_is_flown() -> None:
    own, same = ([row for row in flown(STUDY) if row.point == point] for point in (0, 2))

    assert TrialJob(0, 2) not in jobs_of(STUDY)
    assert [replace(row, point=0, vary="", at=None) for row in same if row.trial < 3] == own


def test_numbers_follow_from_the_seed() -> None:
    again = flown(replace(STUDY, trials=2, varied=()))

    assert again == [row for row in flown(STUDY) if row.point == 0 and row.trial < 2]
    assert again != flown(replace(STUDY, trials=2, varied=(), seed=1))


def test_trials_of_one_seed_meet_other_fates_than_those_of_the_next() -> None:
    seeds = {fate_seed(seed, trial) for seed in range(3) for trial in range(100)}

    assert len(seeds) == 300


def test_random_mission_of_a_trial_is_that_of_seed_and_trial_together() -> None:
    missions = RandomMissions(2, 4)

    assert missions.of_trial(5, 2).uavs == missions.of_trial(7, 0).uavs
    assert missions.of_trial(5, 2).tasks != missions.of_trial(5, 3).tasks


def test_chance_strikes_within_the_time_the_whole_mission_takes() -> None:
    mission = load_scenario(shipped_scenarios()["table-1"])
    slow = tuple(replace(uav, speed_m_s=uav.speed_m_s / 2.0) for uav in mission.uavs)

    assert span_s(mission) > 0.0
    assert span_s(replace(mission, uavs=slow)) == pytest.approx(2.0 * span_s(mission))


def test_policy_compared_with_itself_differs_by_exactly_zero() -> None:
    study = replace(STUDY, policies=("in-order:10", "same"), trials=5)

    summary = summarise(flown(study), "same")

    for setting in summary.settings:
        measured = setting.policies["in-order:10"]
        assert measured.difference is not None
        assert measured.ratio is not None
        assert measured.difference.as_json() == {
            "value": 0.0,
            "low_95": 0.0,
            "high_95": 0.0,
            "n": setting.trials,
        }
        assert measured.ratio.value == measured.ratio.low == measured.ratio.high == 1.0


def test_reattempts_are_as_the_study_says() -> None:
    mission = load_scenario(shipped_scenarios()["table-1"])
    study = replace(STUDY, missions=SameMission(mission))

    assert study.mission(0) == mission
    assert replace(study, reattempt=True).mission(0) == replace(mission, reattempt_failed=True)


def test_offline_plan_is_worked_out_once_for_missions_that_begin_alike() -> None:
    mission = load_scenario(shipped_scenarios()["table-1"])
    study = replace(STUDY, missions=SameMission(mission), policies=("by-plan",), varied=())

    rows = flown(study)  # the policy itself checks that it is given the same plan again

    assert len(rows) == 6


# -- folders --------------------------------------------------------------------------------


def run_in(folder: Path, study: Study = STUDY) -> tuple[list[TrialRow], list[TrialJob]]:
    """The rows without wall times, and the jobs that were flown for them."""
    seen: list[TrialJob] = []

    def fly(briefing: TrialContext, jobs: Sequence[TrialJob]) -> Generator[list[TrialRow]]:
        seen.extend(jobs)
        yield from fly_here(briefing, jobs)

    store = FolderStore(folder, study, FAKES)
    try:
        rows = run_study(TrialContext(study, FAKES), store, fly, no_progress)
    finally:
        store.close()
    assert read_rows(folder / "trials.csv") == rows
    return [without_wall_times(row) for row in rows], seen


def test_folder_holds_what_memory_does(tmp_path: Path) -> None:
    rows, jobs = run_in(tmp_path)

    assert rows == flown(STUDY)
    assert jobs == jobs_of(STUDY)


def test_finished_study_flies_nothing_again(tmp_path: Path) -> None:
    rows, _ = run_in(tmp_path)
    text = (tmp_path / "trials.csv").read_text()

    assert run_in(tmp_path) == (rows, [])
    assert (tmp_path / "trials.csv").read_text() == text


def test_file_cut_off_anywhere_goes_on_to_the_same_rows(tmp_path: Path) -> None:
    study = replace(STUDY, varied=(), trials=2)
    rows, _ = run_in(tmp_path, study)
    data = (tmp_path / "trials.csv").read_bytes()

    for end in range(0, len(data), 61):
        (tmp_path / "trials.csv").write_bytes(data[:end])
        again, jobs = run_in(tmp_path, study)
        assert again == rows
        assert jobs


def test_job_is_flown_again_unless_all_its_rows_are_there(tmp_path: Path) -> None:
    rows, _ = run_in(tmp_path)
    lines = (tmp_path / "trials.csv").read_text().splitlines(keepends=True)
    left = [line for line in lines if not line.startswith("3,loss,0.6,2,same,")]
    (tmp_path / "trials.csv").write_text("".join(left))

    assert run_in(tmp_path) == (rows, [TrialJob(2, 3)])


def test_interrupted_study_keeps_what_is_done_and_goes_on(tmp_path: Path) -> None:
    Interrupted.flown = 0
    study = replace(STUDY, policies=("interrupted",), varied=())

    with pytest.raises(KeyboardInterrupt):
        run_in(tmp_path, study)
    kept = read_rows(tmp_path / "trials.csv")
    rows, jobs = run_in(tmp_path, study)

    assert {row.trial for row in kept} == {0, 1}
    assert jobs == [TrialJob(2, 0)]
    assert len(rows) == 6


def test_more_trials_go_on_from_those_there_are(tmp_path: Path) -> None:
    run_in(tmp_path, replace(STUDY, varied=()))

    rows, jobs = run_in(tmp_path, replace(STUDY, varied=(), trials=5))

    assert jobs == [TrialJob(3, 0), TrialJob(4, 0)]
    assert rows == flown(replace(STUDY, varied=(), trials=5))


@pytest.mark.parametrize(
    ("other", "problem"),
    [
        (replace(STUDY, name="other"), "holds a study with another name"),
        (replace(STUDY, seed=1), "holds a study with another seed"),
        (replace(STUDY, policies=("same",)), "holds a study with other policies"),
        (replace(STUDY, bound=False), "holds a study with another choice of the bound"),
        (replace(STUDY, missions=RandomMissions(3, 6)), "holds a study with other missions"),
        (replace(STUDY, uncertainty=Uncertainty()), "holds a study with another uncertainty"),
        (replace(STUDY, varied=()), "holds a study that varies something else"),
        (replace(STUDY, trials=2), "holds a study with more trials"),
    ],
)
def test_folder_of_another_study_is_refused(tmp_path: Path, other: Study, problem: str) -> None:
    run_in(tmp_path)
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}

    with pytest.raises(InputError) as caught:
        FolderStore(tmp_path, other, FAKES)

    remedy = "name another folder, or remove this one"
    assert str(caught.value) == f"--out: {tmp_path}: {problem}; {remedy}"
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_another_reference_is_the_same_study(tmp_path: Path) -> None:
    rows, _ = run_in(tmp_path)

    assert run_in(tmp_path, replace(STUDY, reference="same")) == (rows, [])


def test_scenario_is_kept_beside_the_study(tmp_path: Path) -> None:
    mission = load_scenario(shipped_scenarios()["table-1"])
    study = replace(STUDY, missions=SameMission(mission), varied=(), policies=("same",))

    run_in(tmp_path, study)
    other = replace(study, missions=SameMission(replace(mission, horizon_s=9.0)))

    assert load_scenario(tmp_path / "scenario.toml") == mission
    with pytest.raises(InputError, match="holds a study with other missions"):
        FolderStore(tmp_path, other, FAKES)


def test_rows_without_their_study_are_refused(tmp_path: Path) -> None:
    (tmp_path / "trials.csv").write_text("mine\n")

    with pytest.raises(InputError, match=r"holds trials\.csv without study\.toml; name another"):
        FolderStore(tmp_path, STUDY, FAKES)

    assert (tmp_path / "trials.csv").read_text() == "mine\n"


@pytest.mark.parametrize(
    ("line", "text", "expected"),
    [
        (1, "a,b\n", "line 1: has not the columns of a study; "),
        (2, "0,,,x,same,1.0,,,,,,,,,,,,,,\n", "line 2: is no row of a study: "),
        (3, "0,,,1\n", "line 3: is no row of a study: "),
    ],
)
def test_file_that_is_damaged_in_its_midst_is_refused(
    tmp_path: Path, line: int, text: str, expected: str
) -> None:
    run_in(tmp_path)
    path = tmp_path / "trials.csv"
    lines = path.read_text().splitlines(keepends=True)
    path.write_text("".join([*lines[: line - 1], text, *lines[line:]]))

    with pytest.raises(InputError) as caught:
        FolderStore(tmp_path, STUDY, FAKES)

    assert str(caught.value).startswith(f"{path}: {expected}")


def test_folder_in_use_is_refused(tmp_path: Path) -> None:
    store = FolderStore(tmp_path, STUDY, FAKES)
    try:
        with pytest.raises(InputError, match="another process is at work there; wait for its end"):
            FolderStore(tmp_path, STUDY, FAKES)
    finally:
        store.close()
    FolderStore(tmp_path, STUDY, FAKES).close()


def test_folder_that_cannot_be_made_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")

    with pytest.raises(InputError, match=r"cannot be written: .*; name a folder that can be"):
        FolderStore(tmp_path / "file", STUDY, FAKES)


def test_parquet_holds_the_same_rows(tmp_path: Path) -> None:
    import pyarrow.parquet as pq

    rows, _ = run_in(tmp_path)

    table = pq.read_table(write_parquet(tmp_path, rows))

    assert tuple(table.column_names) == COLUMNS
    assert [TrialRow(**found) for found in table.to_pylist()] == rows
    assert not list(tmp_path.glob("*.next"))
