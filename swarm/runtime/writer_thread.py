"""One thread that makes all calls into a transport, in order.

A call may wait for a congested network; the asyncio loop must not.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from queue import SimpleQueue


@dataclass(frozen=True, slots=True, eq=False)
class _Job:
    call: Callable[[], None]
    size_bytes: int
    must_run: bool


class WriterThread:
    """A bounded queue in front of a thread.

    When it is full, the oldest job that need not run goes and `dropped` counts it.
    The thread is a daemon: `close` normally ends it, but a call that hangs does not
    keep the process from leaving.
    """

    def __init__(self, name: str, *, max_jobs: int = 4096, max_bytes: int = 64 << 20) -> None:
        self._max_jobs = max_jobs
        self._max_bytes = max_bytes
        self._jobs: deque[_Job] = deque()
        self._waiting_bytes = 0
        self._closed = False
        self._lock = threading.Lock()
        self._calls = SimpleQueue[None]()
        """Wakes the thread for a job, or for the end: for much less than a condition takes."""
        self.dropped = 0
        """Jobs that were thrown away because the network was too slow."""
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    def submit(
        self,
        call: Callable[[], None],
        *,
        size_bytes: int = 0,
        must_run: bool = False,
        spare: bool = False,
    ) -> None:
        """Let the thread make ``call``, which must not raise; returns at once.

        It keeps ``size_bytes`` in memory. What ``must_run`` is never thrown away to make room, what
        is ``spare`` rather than an older one.
        """
        with self._lock:
            full = (
                len(self._jobs) >= self._max_jobs
                or self._waiting_bytes + size_bytes > self._max_bytes
            )
            if self._closed or (full and spare):
                self.dropped += 1
                return
            if full:
                self._make_room(size_bytes)
            self._jobs.append(_Job(call, size_bytes, must_run))
            self._waiting_bytes += size_bytes
        self._calls.put(None)

    def close(self, limit_s: float) -> bool:
        """Make the calls that wait, then end; whether all were made within the limit."""
        with self._lock:
            self._closed = True
        self._calls.put(None)
        self._thread.join(limit_s)
        with self._lock:
            finished = not self._jobs and not self._thread.is_alive()
            self.dropped += len(self._jobs)
            self._jobs.clear()
        return finished

    def _make_room(self, size_bytes: int) -> None:
        kept: list[_Job] = []
        while self._jobs and (
            len(self._jobs) + len(kept) >= self._max_jobs
            or self._waiting_bytes + size_bytes > self._max_bytes
        ):
            oldest = self._jobs.popleft()
            if oldest.must_run:
                kept.append(oldest)
            else:
                self._waiting_bytes -= oldest.size_bytes
                self.dropped += 1
        self._jobs.extendleft(reversed(kept))

    def _run(self) -> None:
        while True:
            self._calls.get()
            with self._lock:
                if self._jobs:
                    job = self._jobs.popleft()
                    self._waiting_bytes -= job.size_bytes
                elif self._closed:
                    return
                else:  # it was thrown away
                    continue
            job.call()
            del job  # what it holds must not live until the next one comes
