"""The order of the house: one name for one class, short functions, and the way of one claim."""

from __future__ import annotations

import ast
import re
import statistics
import subprocess
import sys
from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from types import FrameType

from agent.vehicle.conversation import SendBytes
from swarm.protocol.codec import Codec
from swarm.protocol.encoding import encode
from swarm.protocol.events import MessageReceived, Publish
from swarm.protocol.uav_messages import Claim
from tests.support.bridge_flight import BridgeFlight
from tests.support.builders import MISSION, OUT, entry, uav
from tests.support.lone_agent import LoneAgent, orders

ROOT = Path(__file__).parents[2]
PACKAGES = ("swarm", "agent", "coordinator", "sim")
LONGEST_FUNCTION = 80
MOST_FILES_OF_A_CLAIM = 20


TOP_LEVEL = {
    *(*PACKAGES, "tests", "deploy"),
    *("pyproject.toml", "README.md", "Makefile", "CHANGELOG.md", "DECISIONS.md", "LICENSE"),
}


@cache
def modules() -> list[tuple[Path, ast.Module]]:
    paths = [path for package in PACKAGES for path in sorted((ROOT / package).rglob("*.py"))]
    return [(path, ast.parse(path.read_text(encoding="utf-8"))) for path in paths]


def test_every_class_name_stands_for_one_class() -> None:
    homes = defaultdict(list)
    for path, tree in modules():
        for node in tree.body:
            if isinstance(node, ast.ClassDef):
                homes[node.name].append(str(path.relative_to(ROOT)))

    assert {name: places for name, places in homes.items() if len(places) > 1} == {}


def test_no_function_is_longer_than_a_screen_or_two() -> None:
    """Signatures of commands are: each of their options has a line and its help."""
    long = []
    for path, tree in modules():
        for node in ast.walk(tree):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                is_command = path.name == "cli.py" or path.name.endswith("_commands.py")
                lines = body_lines(node) if is_command else length(node)
                if lines > LONGEST_FUNCTION:
                    long.append((lines, f"{path.relative_to(ROOT)}:{node.name}"))

    assert long == []


def body_lines(node: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    """Imports, comments and empty lines included; without signature and docstring."""
    does = node.body[1:] if ast.get_docstring(node) is not None else node.body
    return (node.end_lineno or 0) - does[0].lineno + 1 if does else 0


def length(node: ast.stmt) -> int:
    return (node.end_lineno or node.lineno) - node.lineno + 1


def test_a_module_is_one_idea_neither_a_fragment_nor_a_book() -> None:
    lines = [
        path.read_text(encoding="utf-8").count("\n")
        for path, tree in modules()
        if path.name != "__init__.py" or tree.body[1:]
    ]

    assert 120 <= statistics.median(lines) <= 300
    assert max(lines) <= 500


def test_nothing_lies_about_on_the_top_level() -> None:
    command = ["git", "-c", f"safe.directory={ROOT}", "ls-files", "--cached"]
    kept = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout
    top = {name.partition("/")[0] for name in kept.splitlines()}

    assert {name for name in top if not name.startswith(".")} == TOP_LEVEL


def test_every_file_that_a_page_names_is_there() -> None:
    pages = [ROOT / "README.md", *(ROOT / ".github").glob("*.md")]
    for folder in (*PACKAGES, "deploy", "tests"):
        pages += (ROOT / folder).rglob("*.md")
    names = {path.name for folder in (*PACKAGES, "tests") for path in (ROOT / folder).rglob("*.*")}
    missing = []
    for page in pages:
        text = page.read_text(encoding="utf-8")
        for file in re.findall(r"`([\w./-]+\.(?:py|hpp|cpp))`", text):
            places = (page.parent / file, ROOT / file)
            if not any(place.exists() for place in places) and ("/" in file or file not in names):
                missing.append((str(page.relative_to(ROOT)), file))

    assert missing == []


def test_a_claim_is_followed_in_twenty_files() -> None:
    """From the step that decides to another agent's replica and to the bytes for the autopilot.

    What `swarm/README.md` tells of it happens, and between its steps nothing of ours lies that it
    does not tell of: whoever calls a function of the table is in a file of the table.
    """
    page = (ROOT / "swarm" / "README.md").read_text(encoding="utf-8")
    rows = re.findall(
        r"^\| `([\w/]+\.py)` \| ([^|]+) \|",
        page.partition("## The way of a claim")[2],
        re.MULTILINE,
    )
    told = {file for file, _ in rows}
    steps = {(file, name) for file, names in rows for name in re.findall(r"`(\w+)`", names)}
    mine, other = LoneAgent(uav("u0"), uav("u1")), LoneAgent(uav("u1"), uav("u0"))
    for agent in (mine, other):
        agent.fly_to(entry("near", east_m=10.0), entry("far", east_m=20.0, number=1))
    mine.hear("u1", OUT)
    mine.start_mission("u0", "u1")
    flight = BridgeFlight().prepared()
    codec = Codec(MISSION)

    with calls_traced() as calls:
        actions = mine.arrive(10.5)
        (claim,) = (
            action.message
            for action in actions
            if isinstance(action, Publish) and isinstance(action.message.body, Claim)
        )
        heard = codec.decode(claim.key, encode(claim))
        assert heard is not None
        other.core.step(MessageReceived(heard), other.now_s)
        (order,) = orders(actions)
        said = flight.bridge.step(order, flight.now_s)

    assert any(isinstance(action, SendBytes) for action in said)
    assert len(told) <= MOST_FILES_OF_A_CLAIM
    reached = {(call[-1][0], call[-1][1]) for call in calls if {file for file, _ in call} <= told}
    assert steps <= reached, steps - reached


Call = tuple[tuple[str, str], ...]
"""(file from the root, function or class) of ours, from the outermost caller to what is called."""


@contextmanager
def calls_traced() -> Iterator[list[Call]]:
    """Collects the calls of functions of ours meanwhile, and of classes that are made."""
    calls: list[Call] = []

    def note(frame: FrameType, what: str, _: object) -> None:
        if what == "call" and (called := place_of(frame)) is not None:
            callers: list[tuple[str, str]] = [called]
            outer = frame.f_back
            while outer is not None and outer.f_code is not place_of.__code__:
                if (place := place_of(outer)) is not None:
                    callers.append(place)
                outer = outer.f_back
            calls.append(tuple(reversed(callers)))

    sys.setprofile(note)
    try:
        yield calls
    finally:
        sys.setprofile(None)


def place_of(frame: FrameType) -> tuple[str, str] | None:
    """File and function of ours; a class's name where a dataclass is made."""
    file, name = frame.f_code.co_filename, frame.f_code.co_name
    if file == "<string>":
        kind = type(frame.f_locals.get("self"))
        file = getattr(sys.modules.get(kind.__module__), "__file__", None) or ""
        name = kind.__name__
    path = Path(file)
    if not path.is_relative_to(ROOT) or path.relative_to(ROOT).parts[0] not in PACKAGES:
        return None
    return str(path.relative_to(ROOT)), name
