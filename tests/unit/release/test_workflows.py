"""The workflows of GitHub: what they run exists here, and what they use is pinned."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

ROOT = Path(__file__).parents[3]
FILES = sorted((ROOT / ".github" / "workflows").glob("*.yml"))
EACH = pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
PINNED = re.compile(r"[\w.-]+/[\w.-]+@[0-9a-f]{40}")


def workflow(file: Path) -> dict[str, Any]:
    read: dict[str, Any] = yaml.safe_load(file.read_text(encoding="utf-8"))
    return read


def steps(file: Path) -> Iterator[dict[str, Any]]:
    for job in workflow(file)["jobs"].values():
        yield from job.get("steps", ())


def make_targets() -> set[str]:
    text = (ROOT / "Makefile").read_text(encoding="utf-8")
    return {
        name
        for names in re.findall(r"^([\w -]+):(?!=)", text, re.MULTILINE)
        for name in names.split()
    }


def test_there_are_workflows_for_tests_wheels_releases_and_nights() -> None:
    assert {file.stem for file in FILES} == {"test", "wheels", "release", "nightly"}


@EACH
def test_every_target_of_make_that_is_run_exists(file: Path) -> None:
    run = [step["run"] for step in steps(file) if "run" in step]
    asked = {name for text in run for name in re.findall(r"\bmake ([a-z][\w-]*)", text)}
    for job in workflow(file)["jobs"].values():
        asked.update(job.get("strategy", {}).get("matrix", {}).get("target", ()))

    assert asked <= make_targets()


@EACH
def test_what_others_have_written_is_pinned_to_a_commit_and_gets_no_credentials(file: Path) -> None:
    for step in steps(file):
        if "uses" in step:
            assert PINNED.fullmatch(step["uses"]), step["uses"]
            if step["uses"].startswith("actions/checkout@"):
                assert step["with"]["persist-credentials"] is False


@EACH
def test_a_job_may_read_only_and_ends_in_bounded_time(file: Path) -> None:
    assert workflow(file)["permissions"] == {"contents": "read"}
    for name, job in workflow(file)["jobs"].items():
        assert "uses" in job or 0 < job["timeout-minutes"] < 360, name


def test_the_versions_of_python_that_are_tested_are_the_ends_of_those_that_are_promised() -> None:
    project = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    promised = re.findall(r"Python :: (3\.\d+)\"", project)
    matrix = workflow(ROOT / ".github" / "workflows" / "test.yml")["jobs"]["test"]["strategy"]
    tested = {each["python"] for each in matrix["matrix"]["include"]}

    assert tested == {promised[0], promised[-1]}


def test_every_module_that_somebody_is_told_to_run_can_be_run() -> None:
    told = [ROOT / "Makefile", *ROOT.glob("*.md"), *(ROOT / ".github").rglob("*.*")]
    for package in ("swarm", "agent", "coordinator", "sim", "tests", "deploy"):
        for kind in ("*.py", "*.md", "*.sh", "*.yml"):
            told += (ROOT / package).rglob(kind)
    modules = {
        (module, file)
        for file in told
        for module in re.findall(
            r"python -m ((?:swarm|agent|coordinator|sim|tests)(?:\.\w+)*)(?![\w.])",
            file.read_text("utf-8"),
        )
        if module.islower()
    }

    assert {"swarm", "tests.chaos", "tests.benchmarks.fuzz_bridge"} <= {name for name, _ in modules}
    for name, file in modules:
        path = ROOT.joinpath(*name.split("."))
        module = path / "__main__.py" if path.is_dir() else path.with_suffix(".py")
        assert module.exists(), (name, file)
        assert module.name == "__main__.py" or does_something(module), (name, file)


def does_something(module: Path) -> bool:
    """Whether running it does more than to define names: by its last lines, or cell by cell."""
    text = module.read_text("utf-8")
    return "__main__" in text or any(
        isinstance(node, ast.For)
        or (isinstance(node, ast.Expr) and isinstance(node.value, ast.Call))
        for node in ast.parse(text).body
    )
