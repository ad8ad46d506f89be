"""The words of a command line: found, replaced, and kept in a file that systemd reads.

systemd gives a unit the variables of an environment file, and splits ``$SWARM_OPTIONS`` into
words where it is a word of its own (systemd.service(5), systemd.exec(5)): quotes within are
respected, nothing else is expanded. Leaves out: what the words mean (the commands).
"""

from __future__ import annotations

import re
import shlex
from collections.abc import Sequence
from typing import Final

__all__ = ["VARIABLE", "kept_words", "option_value", "replaced", "with_words"]

VARIABLE: Final = "SWARM_OPTIONS"
_LINE = re.compile(rf"^{VARIABLE}=((?:.*\\\n)*.*)$", re.MULTILINE)
_ESCAPED = re.compile(r'([\\"`$])')
_UNESCAPED = re.compile(r'\\([\\"`$])')


def option_value(words: Sequence[str], option: str) -> str | None:
    """What ``option`` is given on a command line; None if it is not."""
    for i, word in enumerate(words):
        if word == option:
            return words[i + 1] if i + 1 < len(words) else None
        if word.startswith(f"{option}="):
            return word.partition("=")[2]
    return None


def replaced(words: Sequence[str], option: str, value: str) -> list[str]:
    """The command line with another value of ``option``, which is added if it is not there."""
    kept: list[str] = []
    skip = False
    for word in words:
        if skip:
            skip = False
        elif word == option:
            skip = True
        elif not word.startswith(f"{option}="):
            kept.append(word)
    return [*kept, option, value]


def with_words(text: str, words: Sequence[str]) -> str:
    """An environment file with other options; all else that is in it stays.

    Raises:
        ValueError: a word cannot be written there.
    """
    for word in words:
        if not word.isprintable():
            raise ValueError(f"{word!r} has a sign that no option needs")
    value = _ESCAPED.sub(r"\\\1", shlex.join(words))
    line = f'{VARIABLE}="{value}"'
    if _LINE.search(text) is not None:
        return _LINE.sub(lambda _: line, text, count=1)
    return f"{text}{line}\n"


def kept_words(text: str) -> list[str]:
    """The options in an environment file.

    Raises:
        ValueError: there are none, or a quote is not closed.
    """
    found = _LINE.search(text)
    if found is None:
        raise ValueError(f"there is no {VARIABLE}")
    value = found[1].replace("\\\n", " ").strip()
    if len(value) > 1 and value[0] == value[-1] == "'":
        value = value[1:-1]
    elif len(value) > 1 and value[0] == value[-1] == '"':
        value = _UNESCAPED.sub(r"\1", value[1:-1])
    return shlex.split(value)
