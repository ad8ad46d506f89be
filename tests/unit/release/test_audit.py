"""What an audit makes of an index's answers; the index is played."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

import pytest

from tests.release.audit import (
    PROBE,
    PROBE_S,
    Ask,
    Audit,
    Silence,
    explanations,
    judge,
    main,
    pip_audit,
    runtime_pins,
)

WEAKNESS = {"id": "GHSA-1", "aliases": ["CVE-2"], "fix_versions": ["9.1"], "description": "bad"}


def index(weak: Mapping[str, object] | None = None, unknown: tuple[str, ...] = ()) -> Ask:
    """An index with a weakness of msgpack, or none, that does not know some packages."""

    def ask(pins: Mapping[str, str], _limit_s: float) -> str:
        told: list[dict[str, object]] = []
        for name, version in pins.items():
            if name in unknown:
                told.append({"name": name, "skip_reason": "not found"})
            else:
                vulns = [weak] if weak is not None and name == "msgpack" else []
                told.append({"name": name, "version": version, "vulns": vulns})
        return json.dumps({"dependencies": told, "fixes": []})

    return ask


def silent(_pins: Mapping[str, str], _limit_s: float) -> str:
    raise Silence("no answer within 5 s")


def test_all_that_runs_is_audited_and_nothing_that_only_develops() -> None:
    pins = runtime_pins()

    assert pins.keys() >= {PROBE, "eclipse-zenoh", "msgpack", "numpy", "pydantic-core", "h11"}
    assert pins.keys().isdisjoint({"peckorder", "pytest", "ruff", "hypothesis", "playwright"})


def test_nothing_known_passes(capsys: pytest.CaptureFixture[str]) -> None:
    assert main([], index()) == 0
    count = len(runtime_pins())
    assert capsys.readouterr().out == f"audited {count} of {count} packages: 0 known weaknesses\n"


@pytest.mark.parametrize("options", [[], ["--must-answer"]])
def test_a_known_weakness_fails_and_is_named(
    options: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(options, index(WEAKNESS)) == 1
    version = runtime_pins()["msgpack"]
    assert f"known: msgpack {version}: GHSA-1 CVE-2, mended in 9.1\n" in capsys.readouterr().out


@pytest.mark.parametrize("named", ["GHSA-1", "CVE-2"])
def test_an_explained_weakness_is_told_with_its_reason_and_passes(named: str) -> None:
    said = judge(index(WEAKNESS)({"msgpack": "9.0"}, 1.0), {named: "nobody sends such"})

    line = "msgpack 9.0: GHSA-1 CVE-2, mended in 9.1; nobody sends such"
    assert said == Audit(asked=1, explained=(line,))


@pytest.mark.parametrize("ask", [silent, index(unknown=tuple(runtime_pins()))])
def test_an_index_without_advisories_is_told_and_fails_a_release_only(
    ask: Ask, capsys: pytest.CaptureFixture[str]
) -> None:
    assert (main([], ask), main(["--must-answer"], ask)) == (0, 1)
    told = capsys.readouterr().out.splitlines()
    assert [line.partition(" (")[0] for line in told] == [
        "not audited: the index here gave no advisories"
    ] * 2


def test_where_nobody_answers_only_one_package_is_asked_for_and_briefly() -> None:
    asked: list[tuple[list[str], float]] = []

    def ask(pins: Mapping[str, str], limit_s: float) -> str:
        asked.append((list(pins), limit_s))
        return silent(pins, limit_s)

    main([], ask)

    assert asked == [([PROBE], PROBE_S)]


def test_packages_that_the_index_does_not_know_are_told_and_fail_a_release(
    capsys: pytest.CaptureFixture[str],
) -> None:
    ask = index(unknown=("lz4", "msgpack"))

    assert (main([], ask), main(["--must-answer"], ask)) == (0, 1)
    assert "not audited, the index does not know them: lz4, msgpack" in capsys.readouterr().out


def test_every_explanation_gives_a_reason(tmp_path: Path) -> None:
    assert all(explanations().values())
    project = tmp_path / "pyproject.toml"
    project.write_text('[tool.peckorder.audit.explained]\nGHSA-1 = " "\n')

    with pytest.raises(ValueError, match="GHSA-1 is explained by nothing"):
        explanations(project)


def test_who_answers_too_late_is_not_waited_for() -> None:
    with pytest.raises(Silence, match=r"no answer within 0.001 s"):
        pip_audit({PROBE: "1"}, 0.001)
