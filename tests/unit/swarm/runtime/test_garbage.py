"""When a process looks for garbage: not while it starts, and as usual from then on."""

from __future__ import annotations

import gc
from collections.abc import Iterator

import pytest

from swarm.runtime import garbage

USUAL = (700, 10, 10)


@pytest.fixture(autouse=True)
def usually(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """As a fresh interpreter has it; afterwards as it was."""
    before = gc.get_threshold()
    monkeypatch.setattr(garbage, "_USUAL", USUAL)
    gc.set_threshold(*USUAL)
    yield
    garbage.end_start()
    gc.set_threshold(*before)


def test_a_start_is_not_searched_for_garbage() -> None:
    searches = gc.get_stats()[0]["collections"]
    garbage.begin_start()
    kept: list[list[object]] = [[] for _ in range(100 * USUAL[0])]
    assert gc.get_stats()[0]["collections"] == searches
    del kept


def test_a_start_that_nobody_ends_is_over_with_the_first_search() -> None:
    garbage.begin_start()
    garbage.begin_start()
    assert gc.get_threshold() > USUAL
    gc.collect()
    assert gc.get_threshold() == USUAL
    frozen = gc.get_freeze_count()
    garbage.end_start()
    assert gc.get_freeze_count() == frozen


def test_what_a_start_made_is_looked_through_no_more() -> None:
    frozen = gc.get_freeze_count()
    garbage.begin_start()
    kept: list[list[object]] = [[] for _ in range(10_000)]
    garbage.end_start()
    assert gc.get_freeze_count() > frozen + len(kept)
    assert gc.get_threshold() == USUAL


def test_what_has_been_made_since_can_be_kept_as_well() -> None:
    garbage.begin_start()
    garbage.end_start()
    frozen = gc.get_freeze_count()
    kept: list[list[object]] = [[] for _ in range(10_000)]
    with garbage.kept():
        assert gc.get_freeze_count() > frozen + len(kept)
        *young, old = gc.get_threshold()
        assert (*young,) == USUAL[:2]
        assert old > 10 * USUAL[2]
    assert gc.get_freeze_count() == 0
    assert gc.get_threshold() == USUAL
