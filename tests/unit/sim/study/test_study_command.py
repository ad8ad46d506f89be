"""`swarm study` as it is typed: options, files, exit statuses."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest

from sim.study.policies import roster
from sim.study.trial import COLUMNS
from swarm.cli import main
from tests.support.fake_policies import FAKES, Interrupted

SMALL = ["study", "--random", "2,4", "--trials", "3", "--loss", "0.3", "--jobs", "1"]
CHEAP = ["--policies", "nearest,value-per-time"]


def run(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, str, str]:
    status = main([*arguments])
    out, err = capsys.readouterr()
    return status, out, err


def told(capsys: pytest.CaptureFixture[str], *arguments: str) -> dict[str, object]:
    status, out, _ = run(capsys, *arguments, "--json")
    assert status == 0
    found: dict[str, object] = json.loads(out)
    return found


def test_policies_are_compared_in_a_table(capsys: pytest.CaptureFixture[str]) -> None:
    status, out, err = run(capsys, *SMALL, *CHEAP)

    assert status == 0
    assert "Random missions of 2 UAVs and 4 tasks; each UAV is lost with probability 30 %" in out
    assert "J / nearest's" in out
    assert "value-per-time †" in out
    assert "clairvoyant (bound)" in out
    assert err == "random-2x4: 3 of 3 trials done\n"


def test_json_is_one_object_and_nothing_else(capsys: pytest.CaptureFixture[str]) -> None:
    found = told(capsys, *SMALL, *CHEAP, "--vary", "loss=0,0.5", "--reference", "value-per-time")

    assert found["study"] == "random-2x4"
    assert found["trials"] == 3
    assert found["reference"] == "value-per-time"
    assert found["files"] == []
    settings = found["settings"]
    assert isinstance(settings, list)
    assert [(setting["vary"], setting["at"]) for setting in settings] == [
        (None, None),
        ("loss", 0.0),
        ("loss", 0.5),
    ]
    assert set(settings[0]["policies"]) == {"nearest", "value-per-time", "clairvoyant"}


def test_same_seed_gives_the_same_numbers(capsys: pytest.CaptureFixture[str]) -> None:
    def values(*arguments: str) -> list[float]:
        found = told(capsys, *SMALL, *CHEAP, "--no-bound", *arguments)
        policies_found = found["settings"][0]["policies"]  # type: ignore[index] # plain JSON
        return [each["value"]["value"] for each in policies_found.values()]

    assert values("--seed", "4") == values("--seed", "4") != values("--seed", "5")


def test_folder_gets_study_trials_summary_and_plots(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    out = tmp_path / "made" / "here"

    found = told(capsys, *SMALL, *CHEAP, "--out", str(out), "--format", "parquet")

    names = {path.name for path in out.iterdir() if path.name != ".lock"}
    assert names == {Path(str(path)).name for path in found["files"]}  # type: ignore[attr-defined] # JSON
    assert {"study.toml", "trials.csv", "trials.parquet", "summary.md", "policies.png"} <= names
    assert (out / "trials.csv").read_text().startswith(",".join(COLUMNS))
    assert "| value-per-time † |" in (out / "summary.md").read_text()


def test_study_of_a_folder_is_itself_a_study_and_goes_on(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    kept = ["--out", str(tmp_path), "--no-plots"]
    run(capsys, "study", "table-1", *SMALL[3:], *CHEAP, *kept)

    status, _, err = run(capsys, "study", str(tmp_path / "study.toml"), "--trials", "5", *kept)

    assert status == 0
    assert err == "table-1: 2 of 2 trials done\n"
    assert not list(tmp_path.glob("*.png"))


def test_files_that_cannot_be_written_are_told_in_one_line(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    (tmp_path / "summary.md").mkdir()

    status, out, err = run(capsys, *SMALL, *CHEAP, "--out", str(tmp_path))

    assert (status, out) == (1, "")
    assert err.splitlines()[1:] == [
        f"swarm: the trials are in {tmp_path}, and the rest cannot be written: Is a directory"
    ]


def test_what_becomes_of_failed_tasks_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    _, stays, _ = run(capsys, *SMALL, *CHEAP, "--outcomes")
    _, opens, _ = run(capsys, *SMALL, *CHEAP, "--outcomes", "--reattempt")

    assert "where failed tasks stay failed" in stays
    assert "where failed tasks open again" in opens


def test_interruption_ends_with_130_and_says_what_is_kept(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(roster, "ROSTER", FAKES)
    Interrupted.flown = 0
    command = [*SMALL, "--policies", "interrupted", "--out", str(tmp_path), "--no-plots"]

    status, out, err = run(capsys, *command)
    again, _, _ = run(capsys, *command)

    assert (status, out) == (130, "")
    assert err == (
        f"interrupted after 2 of 3 trials: {tmp_path} keeps them, and the same command goes on\n"
    )
    assert again == 0


def test_table_between_the_markers_is_renewed(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    readme = tmp_path / "README.md"
    around = "# Title\n<!-- study random-2x4 -->{}<!-- end of study -->\nthe rest\n"
    readme.write_text(around.format("old"))

    first = run(capsys, *SMALL, *CHEAP, "--update", str(readme))[0]
    text = readme.read_text()

    begin, end = around.split("{}")
    assert first == 0
    assert text.startswith(begin)
    assert text.endswith(end)
    assert "| value-per-time † |" in text
    assert "old" not in text
    run(capsys, *SMALL, *CHEAP, "--update", str(readme), "--seed", "1")
    assert readme.read_text().count("| policy | J [value·s]") == 1
    assert readme.read_text() != text


def test_study_whose_fate_is_certain_is_flown_with_a_word_of_warning(
    capsys: pytest.CaptureFixture[str],
) -> None:
    status, _, err = run(capsys, "study", "table-1", "--trials", "2", "--jobs", "1", *CHEAP)

    assert status == 0
    assert err.startswith("nothing is uncertain, so all trials are alike: try --loss 0.3")


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        ([], "swarm study: no scenario or study is given; name one, or ask for --random 10,50"),
        (["medow"], "medow: no such scenario or study; did you mean 'meadow'? Shipped studies: "),
        (["meadow", "--random", "2,3"], "--random: 2,3: does not go with a scenario; leave it out"),
        (["--random", "2"], "--random: 2: is no size of a mission; give UAVs (1..1000) and tasks"),
        (["--random", "0,3"], "--random: 0,3: is no size of a mission; give UAVs"),
        (["meadow", "--policies", "gredy"], "--policies: no such policy 'gredy'; did you mean 'gr"),
        (["meadow", "--policies", "cbba,cbba"], "--policies: 'cbba' is there twice; name it once"),
        (
            ["meadow", *CHEAP, "--reference", "central"],
            "--reference: central: is none of the policies of this study; name one of the policie",
        ),
        (["meadow", "--vary", "los=1"], "--vary: los=1: varies nothing known; did you mean 'loss'"),
        (["meadow", "--vary", "loss"], "--vary: loss: varies nothing known; give NAME=VALUE,VALUE"),
        (["meadow", "--vary", "loss=2"], "--vary: loss=2: 2.0 is not within 0..1; give a probabil"),
        (["meadow", "--vary", "loss=x"], "--vary: loss=x: 'x' is not a finite number; give a prob"),
        (
            ["meadow", "--vary", "loss=0", "--vary", "loss=1"],
            "--vary: loss=1: loss is varied twice; put its values together",
        ),
        (["meadow", "--loss", "2"], "swarm study: invalid value for '--loss': "),
        (["meadow", "--trials", "0"], "swarm study: invalid value for '--trials': "),
        (["meadow", "--format", "xls"], "--format: xls: no such format; choose csv or parquet"),
        (["meadow", "--format", "parquet"], "--format: parquet: has no folder to write to; add "),
        (
            ["meadow", "--jobs", "2", "--scheduler", "tcp://127.0.0.1:1"],
            "--jobs: 2: does not go with --scheduler; leave it out",
        ),
        (
            [*SMALL[1:-2], *CHEAP, "--scheduler", "nonsense"],
            "--scheduler: nonsense: is no address; give the address that 'dask scheduler' prints",
        ),
        (
            [*SMALL[1:-2], *CHEAP, "--scheduler", "http://127.0.0.1:80"],
            "--scheduler: http://127.0.0.1:80: is no address; give the address that",
        ),
        (["meadow", "--update", "no.md"], "no.md: cannot be read: No such file or directory; give"),
    ],
)
def test_wrong_usage_is_one_clear_line_and_status_2(
    arguments: list[str], expected: str, capsys: pytest.CaptureFixture[str]
) -> None:
    status, out, err = run(capsys, "study", *arguments)

    assert (status, out) == (2, "")
    assert err.startswith(expected)
    assert err.count("\n") == 1


def test_listed_losses_want_missions_that_have_these_uavs(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    study = tmp_path / "mine.toml"
    study.write_text(
        'schema = 1\nname = "mine"\n[mission]\nrandom = { uavs = 3, tasks = 4 }\n'
        "[uncertainty]\nlost_at_s = { uav3 = 5.0 }\n"
    )

    status, _, err = run(capsys, "study", str(study), "--random", "2,4")

    assert status == 2
    assert err == (
        "--random: 2,4: has no uav3, of which the study lists lost_at_s; ask for larger missions\n"
    )


def test_help_names_every_policy(capsys: pytest.CaptureFixture[str]) -> None:
    status, out, _ = run(capsys, "study", "--help")

    assert status == 0
    words = out.replace(",", " ").replace(":", " ").replace(".", " ").split()
    assert set(roster.ROSTER.policies) <= set(words)


def test_file_without_markers_is_refused_before_anything_is_flown(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    readme = tmp_path / "README.md"
    readme.write_text("# Title\n")

    status, out, err = run(capsys, *SMALL, *CHEAP, "--update", str(readme))

    assert (status, out) == (2, "")
    assert err == (
        f"--update: {readme}: has no lines <!-- study random-2x4 --> and <!-- end of study -->; "
        "put them where the table is to stand\n"
    )


@pytest.mark.parametrize(
    ("module", "option"),
    [
        ("pyarrow", ["--format", "parquet", "--out", "unmade"]),
        ("distributed", ["--scheduler", "tcp://127.0.0.1:1"]),
    ],
)
def test_missing_extra_is_named(
    module: str,
    option: list[str],
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for name in [name for name in sys.modules if name.partition(".")[0] == module]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, module, None)

    status, out, err = run(capsys, *SMALL[:-2], *CHEAP, *option)

    assert (status, out) == (2, "")
    assert err.endswith("needs the extra study: pip install 'peckorder[study]'\n")
    assert err.count("\n") == 1
