"""The pictures of the gallery can be made, are those that it shows, and are small."""

from __future__ import annotations

import re
from pathlib import Path
from xml.etree import ElementTree as ET

import sim.examples
from tests.support.gallery import draw

FOLDER = Path(sim.examples.__file__).parent
KEPT = FOLDER / "screenshots"
SVG = "{http://www.w3.org/2000/svg}"
MOST_BYTES = 300_000
"""All of them together."""


def test_one_command_makes_the_pictures_that_are_kept(tmp_path: Path) -> None:
    draw(tmp_path)

    made = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    assert made.keys() == {path.name for path in KEPT.iterdir()}
    for name, data in made.items():
        if name.endswith(".svg"):
            kept = (KEPT / name).read_bytes()
            assert words(data) == words(kept), f"{name} is old: look at it, then keep it"
        else:
            assert data.startswith(b"\x89PNG")


def words(drawing: bytes) -> list[str]:
    """What stands in a drawing of a terminal."""
    return ["".join(text.itertext()) for text in ET.fromstring(drawing).iter(f"{SVG}text")]


def test_the_page_shows_every_picture_and_each_is_there() -> None:
    page = (FOLDER / "README.md").read_text()
    shown = [(FOLDER / name).resolve() for name in re.findall(r"!\[[^\]]+\]\(([^)]+)\)", page)]

    assert [path for path in shown if not path.is_file()] == []
    assert set(KEPT.iterdir()) <= set(shown)
    assert sum(path.stat().st_size for path in KEPT.iterdir()) < MOST_BYTES
