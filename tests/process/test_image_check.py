"""The check of the images says what it did not try, and fails by what it did.

The engine is a stand-in here, which only knows how to fail; with a real one: `make check-image`.
"""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import pytest

pytestmark = pytest.mark.process

CHECK = Path(__file__).parents[2] / "deploy" / "checks" / "image.sh"
BASE = "docker.io/library/python:3.12-slim-bookworm"


def checked(folder: Path, *words: str, fails: str) -> subprocess.CompletedProcess[str]:
    """The check with an engine that cannot do what a word of its command line says."""
    engine = folder / "docker"
    engine.write_text(
        '#!/bin/sh\necho "$@" >>"$ASKED"\n'
        f'for word in "$@"; do [ "$word" != "{fails}" ] || exit 1; done\n'
    )
    engine.chmod(0o755)
    return subprocess.run(
        [CHECK, *words],
        env={"PATH": f"{folder}:{os.environ['PATH']}", "ENGINE": "docker",
             "FOLDER": str(folder / "check"),
             "ASKED": str(folder / "asked")},
        capture_output=True,
        text=True,
        check=False,
    )  # fmt: skip


def test_without_an_engine_that_answers_it_says_that_nothing_was_tried(tmp_path: Path) -> None:
    end = checked(tmp_path, fails="info")

    assert end.returncode == 0, end.stderr
    first, why, *_ = end.stdout.splitlines()
    assert first == "not tried  anything of: demo workshop compose machines"
    assert "No engine answers" in why
    assert (tmp_path / "asked").read_text().splitlines() == ["info"]


def test_without_a_base_image_it_says_that_nothing_was_tried(tmp_path: Path) -> None:
    end = checked(tmp_path, "demo", fails=BASE)

    assert end.returncode == 0, end.stderr
    assert end.stdout.startswith("not tried  anything of: demo\n")
    assert BASE in end.stdout
    assert f"pull {BASE}" in (tmp_path / "asked").read_text()
    assert "build" not in (tmp_path / "asked").read_text()


@pytest.mark.parametrize("part", ["demo", "workshop"])
def test_a_build_that_fails_fails_the_check(part: str, tmp_path: Path) -> None:
    end = checked(tmp_path, part, fails="build")

    assert end.returncode == 1, end.stdout
    assert f"FAILS      {part}: it is built" in end.stdout
    assert end.stdout.splitlines()[-1] == "1 checks have failed"


def test_a_part_that_does_not_exist_is_an_error(tmp_path: Path) -> None:
    end = checked(tmp_path, "everything", fails="info")

    assert (end.returncode, end.stdout) == (1, "")
    assert "no part everything" in end.stderr
