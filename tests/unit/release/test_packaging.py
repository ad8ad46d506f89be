"""The settings of builds and wheels agree with each other; `make check-dist` builds them."""

from __future__ import annotations

import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[3]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
TOOLS = PROJECT["tool"]


def test_wheels_hold_every_package_that_is_checked() -> None:
    packages = set(TOOLS["scikit-build"]["wheel"]["packages"])

    assert packages == set(TOOLS["importlinter"]["root_packages"])
    assert packages == set(TOOLS["mypy"]["packages"]) - {"tests"}


def test_wheels_are_built_for_every_python_that_is_promised() -> None:
    builds = {name.partition("-")[0] for name in TOOLS["cibuildwheel"]["build"]}
    marker = "Programming Language :: Python :: 3."
    told = [each.removeprefix(marker) for each in PROJECT["project"]["classifiers"]]
    minors = sorted(int(each) for each in told if each.isdigit())

    assert builds == {f"cp3{minor}" for minor in minors}
    assert PROJECT["project"]["requires-python"] == f">=3.{minors[0]}"


def test_wheels_are_built_for_the_processors_of_companions_and_tried() -> None:
    settings = TOOLS["cibuildwheel"]

    assert settings["linux"]["archs"] == ["x86_64", "aarch64"]
    assert "*-musllinux_*" in settings["skip"]
    assert "swarm plan table-1 --json" in settings["test-command"]
    assert "SOURCE_DATE_EPOCH" in settings["linux"]["environment-pass"]
