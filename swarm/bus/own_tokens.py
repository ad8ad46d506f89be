"""Which liveliness tokens are a process's own, so that what others hold alone is told.

Whoever watches a token that several hold sees one token, and its holder's own word of it comes
back by the network some time after it was said. Leaves out: Zenoh (swarm.bus.zenoh_bus).
"""

from __future__ import annotations

import threading
from collections import Counter
from collections.abc import Callable


class OwnTokens:
    """Tokens that a process holds, or holds no longer but does not yet know who else does.

    Used on all threads.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._held: set[str] = set()
        self._releases: Counter[str] = Counter()
        """By key, how many are under way."""
        self._heard: dict[str, bool] = {}
        """By own key, whether it came (or else went), of what was heard last."""

    def hold(self, key: str) -> bool:
        """Hold it from now on; whether it was not held."""
        with self._lock:
            new = key not in self._held
            self._held.add(key)
            return new

    def let_go(self, key: str) -> bool:
        """Begin to release it; whether it was held."""
        with self._lock:
            held = key in self._held
            if held:
                self._held.discard(key)
                self._releases[key] += 1
            return held

    def hear_of_others(self, key: str) -> None:
        """What is heard of ``key``, which is being released, from now on is of others."""
        with self._lock:
            self._heard.pop(key, None)

    def hear(self, key: str, seen: bool, tell: Callable[[str, bool], None]) -> None:
        """It came or went; ``tell`` it at once unless it is the process's own."""
        with self._lock:
            if key in self._held or self._releases[key]:
                self._heard[key] = seen
            else:
                tell(key, seen)

    def release(self, key: str, found: bool, tell: Callable[[str, bool], None]) -> None:
        """End a release: ``tell`` whether others hold it, as ``found`` or as heard since."""
        with self._lock:
            self._releases[key] -= 1
            if self._releases[key]:
                return
            del self._releases[key]
            if key not in self._held:
                tell(key, self._heard.pop(key, found))
