"""The writer makes calls in order, never keeps its caller, and counts what it drops."""

from __future__ import annotations

import threading
from collections.abc import Callable

from swarm.runtime.writer_thread import WriterThread

LIMIT_S = 10.0


class Stuck:
    """A call that waits until it is let go."""

    def __init__(self, writer: WriterThread) -> None:
        self.began = threading.Event()
        self.go_on = threading.Event()
        writer.submit(self._call)
        assert self.began.wait(LIMIT_S)

    def _call(self) -> None:
        self.began.set()
        assert self.go_on.wait(LIMIT_S)


def noting(made: list[str], name: str) -> Callable[[], None]:
    return lambda: made.append(name)


def test_calls_are_made_in_order_and_all_before_closing_ends() -> None:
    made: list[str] = []
    writer = WriterThread("w")
    names = [str(n) for n in range(500)]
    for name in names:
        writer.submit(noting(made, name))

    assert writer.close(LIMIT_S)
    assert made == names
    assert writer.dropped == 0


def test_oldest_call_that_need_not_be_made_gives_way() -> None:
    made: list[str] = []
    writer = WriterThread("w", max_jobs=3)
    stuck = Stuck(writer)
    writer.submit(noting(made, "declare"), must_run=True)
    for name in "abcd":
        writer.submit(noting(made, name))
    writer.submit(noting(made, "status"), spare=True)
    stuck.go_on.set()

    assert writer.close(LIMIT_S)
    assert made == ["declare", "c", "d"]
    assert writer.dropped == 3


def test_large_calls_give_way_by_size() -> None:
    made: list[str] = []
    writer = WriterThread("w", max_bytes=100)
    stuck = Stuck(writer)
    for name in "abc":
        writer.submit(noting(made, name), size_bytes=40)
    stuck.go_on.set()

    assert writer.close(LIMIT_S)
    assert made == ["b", "c"]


def test_hanging_call_does_not_keep_closing_beyond_its_limit() -> None:
    made: list[str] = []
    writer = WriterThread("w")
    stuck = Stuck(writer)
    writer.submit(noting(made, "never"))

    assert not writer.close(0.01)
    writer.submit(noting(made, "after closing"))
    assert writer.dropped == 2
    stuck.go_on.set()
    assert writer.close(LIMIT_S)
    assert made == []
