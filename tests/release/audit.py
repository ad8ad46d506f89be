"""Asks whether weaknesses of the packages that the runtime installs are known: `make audit`.

    python -m tests.release.audit                  as `make lint` does
    python -m tests.release.audit --must-answer    for a release: no answer is a failure, too

The packages are those that `pip install 'peckorder[all]'` brings, in the versions installed here;
pip-audit asks for them. What is known and cannot hurt is explained in pyproject.toml, under
``[tool.peckorder.audit.explained]``, by the advisory's id. Exit status 0: nothing else is
known, or there was nobody to ask, which is said. Leaves out: what only development needs.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

PROJECT = Path(__file__).parents[2] / "pyproject.toml"
PROBE = "cryptography"
"""Asked for first, and for a short time, so that nobody waits long where nobody answers."""
PROBE_S = 5.0
WHOLE_S = 300.0


class Silence(Exception):  # noqa: N818 - no error: there was nobody to ask
    """Nobody answered, and why."""


@dataclass(frozen=True, slots=True)
class Audit:
    """What an index said of some packages."""

    asked: int
    """Packages it had an answer for."""
    found: tuple[str, ...] = ()
    """One line for each known weakness that nobody has explained."""
    explained: tuple[str, ...] = ()
    """One line for each that somebody has."""
    unknown: tuple[str, ...] = ()
    """Packages it does not know."""


Ask = Callable[[Mapping[str, str], float], str]
"""Given versions by name and a time limit [s], what pip-audit prints as JSON."""


def runtime_pins(name: str = "peckorder[all]") -> dict[str, str]:
    """Installed versions of all that ``name``, extras included, needs to run; itself left out.

    Raises:
        PackageNotFoundError: one of them is not installed.
    """
    pins: dict[str, str] = {}
    waiting = [Requirement(name)]
    seen: set[tuple[str, frozenset[str]]] = set()
    while waiting:
        wanted = waiting.pop()
        place = (canonicalize_name(wanted.name), frozenset(wanted.extras))
        if place in seen:
            continue
        seen.add(place)
        installed = distribution(wanted.name)
        pins[place[0]] = installed.version
        for line in installed.requires or ():
            need = Requirement(line)
            extras = ("", *wanted.extras)
            if need.marker is None or any(need.marker.evaluate({"extra": each}) for each in extras):
                waiting.append(need)
    del pins[canonicalize_name(Requirement(name).name)]
    return dict(sorted(pins.items()))


def pip_audit(pins: Mapping[str, str], limit_s: float) -> str:
    """Let pip-audit ask for these versions; its JSON.

    Raises:
        Silence: it got no answer in time, or could not ask.
    """
    with tempfile.TemporaryDirectory(prefix="peckorder-audit-") as folder:
        listed = Path(folder) / "requirements.txt"
        listed.write_text("".join(f"{name}=={version}\n" for name, version in pins.items()))
        words = [sys.executable, "-m", "pip_audit", "--requirement", str(listed), "--no-deps"]
        words += ["--disable-pip", "--format", "json", "--progress-spinner", "off"]
        try:
            done = subprocess.run(
                words, capture_output=True, text=True, check=False, timeout=limit_s
            )
        except subprocess.TimeoutExpired:
            raise Silence(f"no answer within {limit_s:g} s") from None
    if not done.stdout.strip():
        raise Silence((done.stderr.strip().splitlines() or ["pip-audit said nothing"])[-1])
    return done.stdout


def judge(report: str, explained: Mapping[str, str]) -> Audit:
    """What pip-audit's JSON says, weighed with the explanations by advisory id."""
    found, known, unknown, asked = [], [], [], 0
    for package in json.loads(report)["dependencies"]:
        if "skip_reason" in package:
            unknown.append(package["name"])
            continue
        asked += 1
        for weakness in package["vulns"]:
            ids = [weakness["id"], *weakness.get("aliases", ())]
            fixed = ", ".join(weakness.get("fix_versions", ())) or "no version yet"
            line = f"{package['name']} {package['version']}: {' '.join(ids)}, mended in {fixed}"
            reason = next((explained[each] for each in ids if each in explained), None)
            if reason is None:
                found.append(line)
            else:
                known.append(f"{line}; {reason}")
    return Audit(asked, tuple(found), tuple(known), tuple(unknown))


def explanations(project: Path = PROJECT) -> dict[str, str]:
    """Why known weaknesses do not matter here, by advisory id.

    Raises:
        ValueError: one has no reason.
    """
    table = tomllib.loads(project.read_text())["tool"]["peckorder"]["audit"]["explained"]
    for advisory, reason in table.items():
        if not isinstance(reason, str) or not reason.strip():
            raise ValueError(f"{project.name}: {advisory} is explained by nothing")
    return dict(table)


def audit(pins: Mapping[str, str], explained: Mapping[str, str], ask: Ask) -> Audit:
    """Ask for one package and, if that is answered, for all.

    Raises:
        Silence: nobody answered.
    """
    probe = judge(ask({PROBE: pins[PROBE]}, PROBE_S), explained)
    if not probe.asked:
        raise Silence(f"it does not know {PROBE}")
    return judge(ask(pins, WHOLE_S), explained)


def main(argv: Sequence[str] | None = None, ask: Ask = pip_audit) -> int:
    """Audit the run-time packages, print what came of it, and return the exit status."""
    parser = argparse.ArgumentParser(prog="python -m tests.release.audit")
    parser.add_argument("--must-answer", action="store_true", help="no answer is a failure, too")
    strict = parser.parse_args(argv).must_answer
    try:
        pins = runtime_pins()
    except PackageNotFoundError as lack:
        print(f"not audited: {lack.name} is not installed")
        return 1
    try:
        said = audit(pins, explanations(), ask)
    except Silence as why:
        print(f"not audited: the index here gave no advisories ({why})")
        return int(strict)
    for line in said.explained:
        print(f"known and explained: {line}")
    for line in said.found:
        print(f"known: {line}")
    if said.unknown:
        print(f"not audited, the index does not know them: {', '.join(said.unknown)}")
    print(f"audited {said.asked} of {len(pins)} packages: {len(said.found)} known weaknesses")
    return int(bool(said.found) or (strict and bool(said.unknown)))


if __name__ == "__main__":
    sys.exit(main())
