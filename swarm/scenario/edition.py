"""Which edition of the format a file speaks: the words of schema 2, and those of later ones.

Both editions have the same tables. A file of the first uses no word of the second, so that a
release which knows the first alone reads it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from swarm.scenario.findings import Document, Finding, Path

EDITIONS = (1, 2)
"""Values of ``schema``."""
NEW_KEYS: Mapping[str, Sequence[str]] = {
    "mission": ("wind_m_s", "zone_margin_m", "band_m"),
    "uav": ("acceleration_m_s2", "airspeed_m_s", "endurance_s", "reserve_frac", "charge_frac"),
    "task": ("due_s", "opens_s", "closes_s", "path_m", "path", "trigger_m", "height_m"),
}
"""What schema 2 adds to the tables of schema 1."""
NEW_TABLES = ("base", "zone", "area", "terrain")
"""Tables of schema 2."""
_LATER_KEYS: Mapping[str, Sequence[str]] = {"mission": ("separation_m",)}


def edition_of(document: Document) -> int:
    """The edition by which ``document`` is to be read: the second as soon as it has its words."""
    given = document.get("schema")
    if given == 2 and not isinstance(given, bool):
        return 2
    return 2 if any(True for _ in _used(document, NEW_TABLES, NEW_KEYS)) else 1


def edition_faults(document: Document) -> Iterator[Finding]:
    """Words of the second edition in a file of the first, and words that are not planned by yet."""
    given = document.get("schema")
    if given == 1 and not isinstance(given, bool):
        used = [
            *_used(document, NEW_TABLES, NEW_KEYS),
            *_used(document, (), _LATER_KEYS),
        ]
        if words := list(dict.fromkeys(_word(path) for path in used)):
            told = " and ".join([", ".join(words[:-1]), words[-1]] if words[1:] else words)
            verb = "are" if words[1:] else "is"
            yield Finding(("schema",), f"is 1, and {told} {verb} of schema 2", "give schema = 2")
    named: set[str] = set()
    for path in _used(document, (), _LATER_KEYS):
        if (word := _word(path)) not in named:
            named.add(word)
            yield Finding(path, f"this release does not plan by {word} yet", "leave it out")


def without_later(document: Document) -> Document:
    """``document`` without the words that are not planned by yet."""
    kept = dict(document)
    for table, keys in _LATER_KEYS.items():
        if table in kept:
            kept[table] = _without(kept[table], keys)
    return kept


def _without(value: object, keys: Sequence[str]) -> object:
    if isinstance(value, list):
        return [_without(entry, keys) for entry in value]
    if isinstance(value, Mapping) and any(key in value for key in keys):
        return {key: entry for key, entry in value.items() if key not in keys}
    return value


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
