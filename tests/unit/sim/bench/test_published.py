"""Published instances are read as their literature reads them, and their values reckoned anew."""

from __future__ import annotations

import itertools
import json
from importlib.metadata import EntryPoint
from pathlib import Path

import pytest

from sim.bench.instances import Family, read_instances
from sim.bench.route_solvers import METHODS
from sim.bench.routes import measure_routes, search_instance
from swarm.cli import main
from swarm.runtime.errors import InputError

SQUARE = """NAME : square
EDGE_WEIGHT_TYPE : EUC_2D
NODE_COORD_SECTION
1 0 0
2 0 1.9
3 1.9 1.9
4 1.9 0
EOF
"""
COMMANDS = {"bench": EntryPoint("bench", "sim.bench.cli:bench", "peckorder.commands")}
PROFITS = """3 2
0 0 0
0 1.5 10
4 3 20
100 0 5
"""


def folder_of(at: Path, **files: str) -> Path:
    for name, text in files.items():
        (at / name.replace("__", ".")).write_text(text)
    return at


def published(at: Path) -> Path:
    (at / "trp").mkdir()
    (at / "mtrpp" / "deeper").mkdir(parents=True)
    folder_of(at / "trp", square__tsp=SQUARE, best__csv="file,best_known\nsquare.tsp,6\n")
    folder_of(at / "mtrpp", profits__csv="file,upper,best_known\nprofits_2.txt,,23.5\n")
    folder_of(at / "mtrpp" / "deeper", profits_2__txt=PROFITS)
    return at


def test_distances_are_rounded_as_each_literature_does(tmp_path: Path) -> None:
    profits, square = read_instances(published(tmp_path))

    assert (square.family, square.n_uav, square.n_task) == (Family.TRP, 1, 3)
    assert square.distance.tolist()[0] == [0, 1, 2, 1]  # 1.9 and 2.69 rounded down
    assert (profits.family, profits.n_uav, profits.n_task) == (Family.MTRPP, 2, 3)
    assert profits.distance.tolist()[0] == [0, 2, 5, 100]  # 1.5 rounded up


def test_att_distances_are_rounded_up(tmp_path: Path) -> None:
    text = SQUARE.replace("EUC_2D", "ATT").replace("1.9", "10")
    at = folder_of(tmp_path, a__tsp=text, best__csv="file,best_known\na.tsp,6\n")

    (found,) = read_instances(at)

    assert found.distance.tolist()[0] == [0, 4, 5, 4]  # 10 / √10 = 3.16, 14.1 / √10 = 4.47


def test_values_are_the_published_objectives(tmp_path: Path) -> None:
    profits, square = read_instances(published(tmp_path))

    assert square.value([[2, 3, 4]]) == 1 + 2 + 3
    assert square.gap(6.6) == pytest.approx(0.1)
    assert profits.value([[2], [3]]) == (10 - 2) + (20 - 5)
    assert profits.value([[2, 3], []]) == (10 - 2) + (20 - 6)
    assert profits.gap(20.0) == pytest.approx(3.5 / 23.5)


def test_what_is_found_is_optimal_and_can_be_recomputed(tmp_path: Path) -> None:
    instances = read_instances(published(tmp_path))

    done = measure_routes(instances, [0, 4], 0.05)

    for found in done.found:
        (instance,) = [each for each in instances if each.file == found.file]
        assert len(found.routes) == instance.n_uav
        assert instance.value(found.routes) == found.value
    values = {found.file: found.value for found in done.found}
    assert values == {"square.tsp": 6.0, "profits_2.txt": 23.0}
    nodes = [sorted(itertools.chain(*found.routes)) for found in done.found]
    assert nodes == [[2, 3]] * 2 + [[2, 3, 4]] * 2  # a task beyond its profit is left out
    told = done.as_json()["instances"]
    assert {"file", "best_known", "value", "gap", "seconds", "seed", "routes"} <= told[0].keys()


@pytest.mark.parametrize("method", [name for name, each in METHODS.items() if each.module])
def test_others_do_all_tasks_of_a_repairman_once(tmp_path: Path, method: str) -> None:
    if not METHODS[method].is_installed():
        pytest.skip(f"{method} has no wheel here")
    instance = read_instances(published(tmp_path))[1]

    found = search_instance(instance, None, 1.0, method)

    assert sorted(itertools.chain(*found.routes)) == [2, 3, 4]
    assert found.value == instance.value(found.routes) == 6.0
    assert (found.method, found.seed) == (method, None)


def test_or_tools_weighs_profits_against_arrivals(tmp_path: Path) -> None:
    instance = read_instances(published(tmp_path))[0]

    assert search_instance(instance, None, 0.2, "ortools").value == 23.0


def test_what_a_published_bound_proves_ends_the_search(tmp_path: Path) -> None:
    published(tmp_path)
    (tmp_path / "mtrpp" / "profits.csv").write_text(
        "file,upper_bound,best_known\nprofits_2.txt,23,20\n"
    )
    instance = read_instances(tmp_path, "profits_2.txt")[0]

    found = search_instance(instance, 0, 600.0)  # the suite would notice ten minutes

    assert instance.upper_bound == 23.0
    assert (found.value, found.gap) == (23.0, -0.15)


def test_new_best_values_are_told_with_their_routes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    published(tmp_path)
    (tmp_path / "mtrpp" / "profits.csv").write_text("file,best_known\nprofits_2.txt,20\n")
    told = tmp_path / "new.json"
    arguments = ["bench", "routes", "--instances", str(tmp_path), "--time-limit-s", "0.05"]

    assert main([*arguments, "--seeds", "0,1", "--new-best", str(told)], commands=COMMANDS) == 0

    (found,) = json.loads(told.read_text())  # square.tsp is only as good as the best known
    assert (found["file"], found["value"], found["best_known"]) == ("profits_2.txt", 23.0, 20.0)
    assert sorted(itertools.chain(*found["routes"])) == [2, 3]
    shown = " ".join(capsys.readouterr().out.split())
    assert "better than the best known: profits_2.txt 23 (known: 20)" in shown


def test_many_instances_have_a_row_per_size(tmp_path: Path) -> None:
    names = [f"square-{k}.tsp" for k in range(41)]
    for name in names:
        (tmp_path / name).write_text(SQUARE)
    best = [f"{name},{7 if k == 0 else 6}" for k, name in enumerate(names)]
    (tmp_path / "best.csv").write_text("\n".join(["file,best_known", *best]))

    done = measure_routes(read_instances(tmp_path), [0], 0.01)

    (row,) = done.grid().cells()
    assert row[:4] == ["trp", "3", "1", "41"]
    assert row[6:8] == ["100", "1"]  # all reach the best known, one surpasses it
    (size,) = done.sizes()
    assert (size.searches, size.worst_gap) == (41, 0.0)
    assert size.mean_gap == pytest.approx(-1 / 7 / 41)


def test_methods_stand_side_by_side_but_for_what_they_cannot_state(tmp_path: Path) -> None:
    published(tmp_path)
    plot, out = tmp_path / "gaps.svg", tmp_path / "gaps.md"
    arguments = ["bench", "routes", "--instances", str(tmp_path), "--time-limit-s", "0.1"]
    arguments += ["--seeds", "0,1", "--methods", "guided,ortools"]

    assert main([*arguments, "--plot", str(plot), "--out", str(out)], commands=COMMANDS) == 0

    shown = out.read_text()
    assert "trp, guided: mean gap 0.000 % of 2 searches" in shown
    assert "trp, ortools: mean gap 0.000 % of 1 searches" in shown
    assert "| profits_2.txt | ortools | 3 | 2 | 23 | 2.128 | 2.128 |" in shown
    assert plot.stat().st_size > 1000


def test_files_are_chosen_by_name(tmp_path: Path) -> None:
    at = published(tmp_path)

    assert [each.file for each in read_instances(at, "squ*, *.txt")] == [
        "profits_2.txt",
        "square.tsp",
    ]
    assert [each.file for each in read_instances(at, "square.tsp")] == ["square.tsp"]
    with pytest.raises(InputError, match=r"--only: squire.tsp: names no instance.* square.tsp"):
        read_instances(at, "profits_2.txt,squire.tsp")


@pytest.mark.parametrize(
    ("file", "text", "said"),
    [
        ("a.tsp", SQUARE.replace("2 0 1.9", "2 0 x"), "a.tsp: line 5: '2 0 x' is not 3 numbers"),
        ("a.tsp", SQUARE.replace("2 0 1.9", "7 0 1"), "a.tsp: line 5: node 7 is out of turn"),
        ("a.tsp", SQUARE.replace("EUC_2D", "GEO"), "'GEO' is not known; give EUC_2D or ATT"),
        ("a.tsp", "EOF\n", "fewer than two nodes"),
        ("a.tsp", SQUARE.replace("1.9", "inf"), "line 5: '2 0 inf' is not 3 numbers"),
        ("a.txt", "", "a.txt: line 1: no number of tasks and of UAVs"),
        ("a.txt", "3 0\n" + PROFITS[4:], "4 nodes and 0 UAVs for 3 tasks"),
        ("a.txt", PROFITS + "1 1 1\n", "5 nodes and 2 UAVs for 3 tasks"),
        ("a.txt", PROFITS.replace("100 0 5", "100 0"), "line 5: '100 0' is not 3 numbers"),
        ("a.txt", b"\xff\xfe".decode("latin1"), "no number of tasks"),
    ],
)
def test_instances_that_cannot_be_read_are_refused(
    tmp_path: Path, file: str, text: str, said: str
) -> None:
    folder_of(tmp_path, **{file: text, "best.csv": f"file,best_known\n{file},6\n"})

    with pytest.raises(InputError) as refused:
        read_instances(tmp_path)

    assert said in str(refused.value)


@pytest.mark.parametrize(
    ("table", "said"),
    [
        ("file,best\na.tsp,1\n", "best.csv: line 1: no columns file and best_known"),
        ("file,best_known\na.tsp,least\n", "best.csv: line 2: best_known is 'least'"),
        ("file,best_known\nb.tsp,1\n", "best.csv: line 2: no file 'b.tsp' here or below"),
        ("file,best_known\n../../b.tsp,1\n", "best.csv: line 2: no file '../../b.tsp'"),
        ("file,best_known\n/a.tsp,1\n", "best.csv: line 2: no file '/a.tsp' here or below"),
        ("file,best_known,upper_bound\na.tsp,1,x\n", "line 2: upper_bound is 'x'; give a number"),
        ("file,best_known\n", "no table *.csv of instances in it or below"),
    ],
)
def test_tables_that_cannot_be_used_are_refused(tmp_path: Path, table: str, said: str) -> None:
    folder_of(tmp_path, **{"best.csv": table, "a.tsp": SQUARE})

    with pytest.raises(InputError) as refused:
        read_instances(tmp_path)

    assert said in str(refused.value)


def test_the_command_shows_a_table_or_routes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    published(tmp_path)
    arguments = ["bench", "routes", "--instances", str(tmp_path), "--time-limit-s", "0.05"]

    assert main([*arguments, "--seeds", "0,1"], commands=COMMANDS) == 0
    shown = capsys.readouterr().out
    assert main([*arguments, "--only", "*.tsp", "--seeds", "2", "--json"], commands=COMMANDS) == 0
    told = json.loads(capsys.readouterr().out)

    assert "seeds 0, 1; gaps in the published objective" in " ".join(shown.split())
    assert "trp, guided: mean gap 0.000 % of 2 searches" in shown
    assert "mtrpp, guided: mean gap 2.128 % of 2 searches" in shown
    (found,) = told["instances"]
    assert (found["file"], found["value"], found["gap"], found["seed"]) == ("square.tsp", 6, 0, 2)
    assert sorted(found["routes"][0]) == [2, 3, 4]


def test_the_command_refuses_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["bench", "routes", "--instances", str(tmp_path)], commands=COMMANDS) == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_a_folder_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="not a folder"):
        read_instances(tmp_path / "none")
