"""What commands of `swarm bench` share: values between commas, sizes, buses, and progress."""

from __future__ import annotations

import contextlib
import re
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, TypeVar

from swarm.runtime.errors import Fault, InputError

if TYPE_CHECKING:
    from sim.fleet.layout import BusKind

__all__ = ["bus_of", "each", "progress", "size_of"]


T = TypeVar("T")

_SIZE = re.compile(r"([1-9]\d{0,3})[x×]([1-9]\d{0,4})")


def each(flag: str, text: str, read: Callable[[str, str], T]) -> list[T]:
    """The values between commas, each once."""
    words = [word.strip() for word in text.split(",")]
    return list(dict.fromkeys(read(flag, word) for word in words))


def size_of(flag: str, word: str) -> tuple[int, int]:
    """How many UAVs and tasks ``word`` stands for.

    Raises:
        InputError: it is no size.
    """
    match = _SIZE.fullmatch(word)
    if match is None:
        raise InputError(Fault(flag, word, "no size", "write UAVs x tasks, such as 50x500"))
    return int(match[1]), int(match[2])


@contextlib.contextmanager
def progress() -> Iterator[Callable[[str], None]]:
    """A place to say what is being done: a line that changes, on a terminal only."""
    from rich.console import Console

    from swarm.runtime.log import LogLevel, configure_logging

    configure_logging(LogLevel.ERROR)
    console = Console(stderr=True)
    with console.status("", spinner_style="dim") as status:
        yield status.update if console.is_terminal else lambda _: None


def bus_of(word: str) -> BusKind:
    """The bus of that name.

    Raises:
        InputError: it is none.
    """
    from sim.fleet.layout import BusKind

    if word not in (BusKind.MESH, BusKind.ROUTER):
        raise InputError(Fault("--bus", word, "no such bus", "choose mesh or router"))
    return BusKind(word)
