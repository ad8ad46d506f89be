"""Module docstrings point to what there is."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PACKAGES = ("swarm", "coordinator", "agent", "sim")
POINTER = re.compile(rf"\b(?:{'|'.join(PACKAGES)})(?:\.[A-Za-z_]\w*)+")


def modules() -> list[Path]:
    return [path for package in PACKAGES for path in sorted((ROOT / package).rglob("*.py"))]


def is_there(name: str) -> bool:
    """Whether that is a module, or something that a module or package names."""
    place = ROOT.joinpath(*name.split("."))
    if place.is_dir() or place.with_suffix(".py").is_file():
        return True
    owner, _, last = name.rpartition(".")
    place = ROOT.joinpath(*owner.split("."))
    sources = [place.with_suffix(".py"), place / "__init__.py"]
    return any(
        source.is_file() and re.search(rf"\b{last}\b", source.read_text()) is not None
        for source in sources
    )


@pytest.mark.parametrize("package", PACKAGES)
def test_what_a_module_leaves_to_another_is_there(package: str) -> None:
    missing = []
    for path in modules():
        if path.relative_to(ROOT).parts[0] != package:
            continue
        text = ast.get_docstring(ast.parse(path.read_text())) or ""
        missing += [(str(path), name) for name in POINTER.findall(text) if not is_there(name)]
    assert missing == []
