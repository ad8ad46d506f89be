"""The files of the dashboard's page fit together and ask nobody else for anything."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from coordinator.dashboard.app import STATIC

OURS = sorted(
    path
    for path in STATIC.rglob("*")
    if path.suffix in (".js", ".css", ".html", ".svg") and "vendor" not in path.parts
)
SCRIPTS = [path for path in OURS if path.suffix == ".js"]
INDEX = (STATIC / "index.html").read_text()


def name(path: Path) -> str:
    return str(path.relative_to(STATIC))


@pytest.mark.parametrize("path", OURS, ids=name)
def test_no_file_of_the_page_names_another_origin(path: Path) -> None:
    named = set(re.findall(r"""(?:https?:)?//[\w.-]+\.\w+[^\s"')]*""", path.read_text()))
    assert {url for url in named if not url.startswith("http://www.w3.org/")} == set()


@pytest.mark.parametrize("path", OURS, ids=name)
def test_no_file_of_the_page_needs_what_its_policy_forbids(path: Path) -> None:
    text = path.read_text()
    assert not re.search(r"\beval\(|new Function|insertAdjacentHTML|innerHTML\s*=|\son\w+=\"", text)
    assert " style=" not in text


@pytest.mark.parametrize("path", SCRIPTS, ids=name)
def test_every_import_names_what_its_module_exports(path: Path) -> None:
    for words, module in re.findall(r'import \{([^}]*)\} from "\./([^"]+)"', path.read_text()):
        exporting = (path.parent / module).read_text()
        exported = set(
            re.findall(r"export (?:async )?(?:const|function|class|let) (\w+)", exporting)
        )
        assert {word.strip() for word in words.split(",") if word.strip()} <= exported, module


@pytest.mark.parametrize("path", SCRIPTS, ids=name)
def test_every_id_that_a_script_asks_for_is_on_the_page(path: Path) -> None:
    asked = set(re.findall(r'byId\("([\w-]+)"\)', path.read_text()))
    assert asked <= set(re.findall(r'\bid="([\w-]+)"', INDEX))


def test_every_part_that_the_page_loads_is_shipped() -> None:
    loaded = re.findall(r'(?:src|href)="(static/[^"]+)"', INDEX)
    assert loaded
    assert [part for part in loaded if not (STATIC.parent / part).is_file()] == []
