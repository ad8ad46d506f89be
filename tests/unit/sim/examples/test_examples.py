"""The examples run, do what they say, and are notebooks."""

from __future__ import annotations

import ast
import runpy
from pathlib import Path

import jupytext
import pytest

import sim.examples

FOLDER = Path(sim.examples.__file__).parent
EXAMPLES = sorted(FOLDER.glob("[a-z]*.py"))


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing that an example writes stays."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))


def run(name: str, capsys: pytest.CaptureFixture[str]) -> list[str]:
    """The lines that ``python -m sim.examples.NAME`` prints."""
    runpy.run_module(f"sim.examples.{name}", run_name="__main__")
    return capsys.readouterr().out.splitlines()


def test_plans_are_compared_and_the_best_is_drawn(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    said = run("plan_a_mission", capsys)

    assert [line.split(":")[0].strip() for line in said[1:4]] == ["greedy", "lookahead", "guided"]
    assert "100.0% of 120.33 (proven optimal)" in said[3]
    assert [line.split(":")[0] for line in said[4:7]] == ["uav1", "uav2", "uav3"]
    assert (tmp_path / "plan.png").read_bytes().startswith(b"\x89PNG")


def test_a_fleet_flies_by_the_users_rule(capsys: pytest.CaptureFixture[str]) -> None:
    said = run("own_decision_rule", capsys)

    heads = [line for line in said if " J " in line]
    assert [line.split(":")[0].strip() for line in heads] == [
        "soonest",
        "value_per_time",
        "greedy",
        "guided",
    ]
    assert "J 118.49" in heads[2]


def test_policies_meet_the_same_futures(capsys: pytest.CaptureFixture[str]) -> None:
    first = run("compare_policies", capsys)

    assert run("compare_policies", capsys) == first
    assert first[-1].endswith("in 20 futures")


def test_a_recording_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    said = "\n".join(run("read_recording", capsys))

    assert said.startswith("table-1: 8 of 8 tasks")
    assert "uav2" in said
    assert "chose" in said


def test_an_agent_flies_its_simulated_autopilot(capsys: pytest.CaptureFixture[str]) -> None:
    said = run("drive_one_agent", capsys)

    order = [
        next(n for n, line in enumerate(said) if news in line)
        for news in ("VehicleReady", "Arrived", "Home")
    ]
    assert order == sorted(order)
    assert said[-1].startswith("done: gate, barn; J ")


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_is_a_notebook_in_which_words_and_code_take_turns(path: Path) -> None:
    text = path.read_text()
    cells = jupytext.reads(text, fmt="py:percent").cells

    assert cells[0].source.startswith("# ")
    assert f"python -m sim.examples.{path.stem}" in cells[0].source
    kinds = [cell.cell_type for cell in cells]
    assert kinds[::2] == ["markdown"] * len(kinds[::2])
    assert kinds[1::2] == ["code"] * len(kinds[1::2])
    code = "\n".join(cell.source for cell in cells if cell.cell_type == "code")
    assert ast.dump(ast.parse(code)) == ast.dump(ast.parse(without_words(text)))
    assert len(text.splitlines()) < 100


def without_words(text: str) -> str:
    """The program without the strings that stand by themselves."""
    tree = ast.parse(text)
    tree.body = [
        node
        for node in tree.body
        if not (isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant))
    ]
    return ast.unparse(tree)


def test_the_page_names_every_example() -> None:
    page = (FOLDER / "README.md").read_text()

    assert [name for name in (path.stem for path in EXAMPLES) if f"`{name}`" not in page] == []
