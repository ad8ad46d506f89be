"""Which edition of the format a file speaks: the words of schema 2.

Both editions have the same tables. A file of the first uses no word of the second, so that a
release which knows the first alone reads it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from swarm.scenario.findings import Document, Finding, Path

EDITIONS = (1, 2)
"""Values of ``schema``."""
NEW_KEYS: Mapping[str, Sequence[str]] = {
    "mission": ("wind_m_s", "zone_margin_m", "separation_m", "band_m"),
    "uav": (
        "acceleration_m_s2",
        "airspeed_m_s",
        "endurance_s",
        "reserve_frac",
        "charge_frac",
        "vehicle",
        "turn_radius_m",
        "landing_heading_deg",
    ),
    "task": ("due_s", "opens_s", "closes_s", "path_m", "path", "trigger_m", "height_m"),
}
"""What schema 2 adds to the tables of schema 1."""
NEW_TABLES = ("base", "zone", "area", "terrain")
"""Tables of schema 2."""


def edition_of(document: Document) -> int:
    """The edition by which ``document`` is to be read: the second as soon as it has its words."""
    given = document.get("schema")
    if given == 2 and not isinstance(given, bool):
        return 2
    return 2 if any(True for _ in _used(document, NEW_TABLES, NEW_KEYS)) else 1


def edition_faults(document: Document) -> Iterator[Finding]:
    """Words of the second edition in a file of the first."""
    given = document.get("schema")
    if given != 1 or isinstance(given, bool):
        return
    if words := list(dict.fromkeys(map(_word, _used(document, NEW_TABLES, NEW_KEYS)))):
        told = " and ".join([", ".join(words[:-1]), words[-1]] if words[1:] else words)
        verb = "are" if words[1:] else "is"
        yield Finding(("schema",), f"is 1, and {told} {verb} of schema 2", "give schema = 2")


def _used(
    document: Document, tables: Sequence[str], keys: Mapping[str, Sequence[str]]
) -> Iterator[Path]:
    """Where those tables and keys stand; of an empty array nothing is said."""
    # An empty array asks for nothing.
    yield from ((table,) for table in tables if document.get(table, []) != [])
    for name, known in keys.items():
        value = document.get(name)
        if isinstance(value, Mapping):
            yield from ((name, key) for key in known if key in value)
        for index, entry in enumerate(value if isinstance(value, list) else ()):
            if isinstance(entry, Mapping):
                yield from ((name, index, key) for key in known if key in entry)


def _word(path: Path) -> str:
    word = str(path[-1])
    if len(path) > 1:
        return word
    return "[terrain]" if word == "terrain" else f"[[{word}]]"
