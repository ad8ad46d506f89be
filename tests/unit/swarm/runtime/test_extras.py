"""Optional packages: named once, and asked for in one line by whoever lacks them."""

from __future__ import annotations

import ast
import json
import re
import subprocess
import sys
import tomllib
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from swarm.runtime.extras import EXTRAS, MissingExtraError, missing_extra, require_extra

ROOT = Path(__file__).parents[4]
PROJECT: dict[str, Any] = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
DATA = ROOT / "tests" / "data" / "task_files"
OWN = {"swarm", "agent", "coordinator", "sim"}
MODULES = {"eclipse_zenoh": "zenoh", "pyserial": "serial"}
"""Packages whose module has another name."""

BASE = """
    plan table-1 --json
    plan table-1 --method lookahead --json
    simulate table-1 --json
    simulate table-1 --method guided --json
    coordinator table-1 --check
    agent --mission m --uav u --mavlink tcp:127.0.0.1:5760 --check
    router --check
    soak --seeds 1
"""
"""What works without any extra; of every other command the help does."""

LACKING = f"""
    ground  swarm dashboard        : dashboard --check
    ground  swarm replay           : replay nothing.mcap
    ground  swarm explain          : explain nothing.mcap --task t1
    ground  swarm record           : record new.mcap
    ground  swarm foxglove         : foxglove --check
    ground  swarm simulate         : simulate --from nothing.mcap
    ground  --record               : simulate table-1 --record new.mcap
    ground  --record               : run table-1 --record new.mcap
    ground  --dashboard            : run table-1 --dashboard 0
    ground  --dashboard            : coordinator table-1 --dashboard 0
    ground  --plot                 : plan table-1 --plot lists.png
    ground  swarm import           : import {DATA}/parcels.zip --home 47,8,400
    ground  swarm study            : study table-1
    ground  swarm reproduce        : reproduce
    bench   --methods ortools      : bench plan --methods ortools
    ros2    swarm ros2             : ros2 --check
"""

_HIDDEN = """
import contextlib, io, json, sys
from importlib.machinery import PathFinder

hidden, find = set(json.loads(sys.argv[1])), PathFinder.find_spec
PathFinder.find_spec = lambda name, *where: (
    None if name.partition(".")[0] in hidden else find(name, *where)
)
from swarm.cli import main
for line in json.loads(sys.argv[2]):
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        status = main(line.split())
    print(json.dumps([line, status, out.getvalue(), err.getvalue()]))
for module in ("agent.runner", "coordinator.daemon", "sim.fleet.run", "sim.autopilot.server",
               "swarm.bus.router", "sim.bench.cli", "sim.fleet.doctor.cli"):
    __import__(module)
"""


@cache
def said_without(folder: Path) -> dict[str, tuple[int, str, str]]:
    """Exit status, output and errors of every command line, where no extra is installed."""
    lines = [line.strip() for line in BASE.strip().splitlines()]
    lines += [line.partition(" : ")[2].strip() for line in LACKING.strip().splitlines()]
    lines += [f"{name} --help" for name in PROJECT["entry-points"]["peckorder.commands"]]
    hidden = json.dumps([module for modules in EXTRAS.values() for module in modules])
    words = [sys.executable, "-c", _HIDDEN, hidden, json.dumps([*lines, "--help"])]
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return {line: tuple(rest) for line, *rest in map(json.loads, done.stdout.splitlines())}


@pytest.fixture(scope="module")
def said(tmp_path_factory: pytest.TempPathFactory) -> dict[str, tuple[int, str, str]]:
    return said_without(tmp_path_factory.mktemp("without-extras"))


@pytest.mark.parametrize("line", LACKING.strip().splitlines())
def test_who_lacks_an_extra_says_so_in_one_line(
    line: str, said: dict[str, tuple[int, str, str]]
) -> None:
    head, _, command = line.partition(" : ")
    extra, what = head.strip().split(maxsplit=1)

    status, out, err = said[command.strip()]
    assert (status, out) == (2, "")
    assert err == f"{what.strip()} needs the extra {extra}: pip install 'peckorder[{extra}]'\n"


@pytest.mark.parametrize("line", BASE.strip().splitlines())
def test_agents_and_coordinators_need_no_extra(
    line: str, said: dict[str, tuple[int, str, str]]
) -> None:
    status, _, err = said[line.strip()]

    assert status == 0, err


def test_help_of_every_command_needs_no_extra(said: dict[str, tuple[int, str, str]]) -> None:
    for line, (status, out, err) in said.items():
        if line.endswith("--help"):
            assert status == 0, (line, err)
            assert "annot be loaded" not in out


def test_the_extras_named_are_those_of_the_project() -> None:
    optional = PROJECT["optional-dependencies"]
    for extra, modules in EXTRAS.items():
        named = {_module(each) for each in optional[extra]} - {"peckorder"}
        assert named == set(modules)
    assert set(EXTRAS) < set(optional)
    assert optional["all"] == [f"peckorder[{','.join(EXTRAS)}]"]


def test_every_package_that_is_imported_is_installed_or_named() -> None:
    known = {_module(each) for each in PROJECT["dependencies"]} | OWN
    known |= {module for modules in EXTRAS.values() for module in modules}
    known |= sys.stdlib_module_names
    known |= {"annotated_types", "pydantic_core"}  # come with pydantic, and are parts of it
    for package in sorted(OWN):
        for path in (ROOT / package).rglob("*.py"):
            assert _imported(path) <= known, path


def test_other_failures_to_import_are_not_explained_away() -> None:
    assert missing_extra(ModuleNotFoundError("no", name="nowhere"), "swarm x") is None
    assert missing_extra(ImportError("cannot import name", name="mcap"), "swarm x") is None
    lacking = missing_extra(ModuleNotFoundError("no", name="mcap.writer"), "swarm x")
    assert isinstance(lacking, MissingExtraError)
    assert lacking.extra == "ground"


def test_what_is_installed_is_not_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    require_extra("ground", "swarm dashboard")
    monkeypatch.setitem(sys.modules, "uvicorn", None)
    with pytest.raises(MissingExtraError, match="swarm dashboard needs the extra ground"):
        require_extra("ground", "swarm dashboard")


def _module(requirement: str) -> str:
    name = re.split(r"[<>=\[;]", requirement)[0].replace("-", "_")
    return MODULES.get(name, name)


def _imported(path: Path) -> set[str]:
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found |= {each.name.partition(".")[0] for each in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module is not None:
            found.add(node.module.partition(".")[0])
    return found
