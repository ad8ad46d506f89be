"""When this process looks for garbage in circles: not while it starts, then as usual.

A start makes hardly anything else than what stays; looking through that again and again takes a
tenth of its time. So the first search is put off until very much has been made. Who lives on says
when the start is over: nothing of it is looked through again, for that would take tens of
milliseconds, in which a vehicle may wait for its next target.
"""

from __future__ import annotations

import contextlib
import gc
from collections.abc import Iterator
from typing import Final

_OF_A_START: Final = 200_000
"""More new things than a start makes. So much garbage is some 20 MB, and found in some 10 ms."""
_USUAL: Final = gc.get_threshold()
_SELDOM: Final = 100
"""How many times as seldom the oldest things are looked through where they are `kept`."""


def begin_start() -> None:
    """Look for no garbage until the start is over, or very much has been made."""
    if _at_first_search not in gc.callbacks:
        gc.callbacks.append(_at_first_search)
    gc.set_threshold(_OF_A_START, *_USUAL[1:])


def end_start() -> None:
    """A start is over: what there is stays and is looked through never again, the rest as usual."""
    if _at_first_search in gc.callbacks:
        gc.freeze()
        _go_on_as_usual()


@contextlib.contextmanager
def kept() -> Iterator[None]:
    """Much has been made since that stays, too: it is not looked through in this context.

    What is made now and stays for a while is looked through seldom: that finds nothing, and for
    dozens of agents takes a tenth of a second, three times a minute.
    """
    thresholds = gc.get_threshold()
    gc.freeze()
    gc.set_threshold(*_USUAL[:2], _SELDOM * _USUAL[2])
    try:
        yield
    finally:
        gc.set_threshold(*thresholds)
        gc.unfreeze()  # what is never looked through is not taken apart at the end, either


def _at_first_search(phase: str, _info: dict[str, int]) -> None:
    """Very much has been made, and nobody has said that the start is over."""
    if phase == "stop":
        _go_on_as_usual()


def _go_on_as_usual() -> None:
    gc.callbacks.remove(_at_first_search)
    gc.set_threshold(*_USUAL)
