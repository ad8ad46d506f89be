"""Who is there: liveliness tokens with hysteresis.

A writer is present from the first sign of its token until the token has been
gone for a while *and* the own link was up all that time: without a link of one's
own, the silence of others proves nothing. Each process judges for itself.
"""

from __future__ import annotations

from swarm.config import Timing

__all__ = ["Membership"]


class Membership:
    """One process's judgement of who is present."""

    def __init__(self, timing: Timing) -> None:
        self._timing = timing
        self._doubted_until_s: dict[str, float] = {}
        self._linked = True
        self._interrupted: set[str] = set()
        self._ghosts: set[str] = set()
        self.present: set[str] = set()
        """Writers believed to be there."""

    @property
    def credible(self) -> set[str]:
        """Writers believed to be there whose claims count.

        Whoever was lost and is back may be a new process that knows nothing of what
        the old one claimed: its claim counts again once it has said so itself.
        """
        return self.present - self._ghosts

    @property
    def steady(self) -> set[str]:
        """Writers that are there and remember all they ever said, so answer for themselves.

        A token that went and came back may be a new process's, which must be told.
        """
        return self.present - self._interrupted

    def seen(self, writer: str) -> bool:
        """``writer``'s token is there; whether it was not present before."""
        self._doubted_until_s.pop(writer, None)
        new = writer not in self.present
        self.present.add(writer)
        return new

    def spoke(self, writer: str) -> None:
        """``writer`` itself has just said what it claims."""
        self._ghosts.discard(writer)
        if writer not in self._doubted_until_s:
            self._interrupted.discard(writer)

    def gone(self, writer: str, now_s: float) -> None:
        """``writer``'s token has disappeared."""
        if writer not in self.present:
            return
        self._doubted_until_s[writer] = now_s + self._timing.loss_delay_s
        if self._linked:
            self._interrupted.add(writer)

    def link(self, up: bool, now_s: float) -> None:
        """The own link came up or went down."""
        if up and not self._linked:
            grace_s = now_s + self._timing.relink_grace_s
            self._doubted_until_s = dict.fromkeys(self._doubted_until_s, grace_s)
        self._linked = up

    def lost(self, now_s: float) -> list[str]:
        """Writers given up by now, each told once, in id order."""
        if not self._linked:
            return []
        lost = sorted(w for w, until_s in self._doubted_until_s.items() if until_s <= now_s)
        for writer in lost:
            del self._doubted_until_s[writer]
            self.present.discard(writer)
            self._ghosts.add(writer)
            self._interrupted.add(writer)
        return lost

    def next_deadline_s(self) -> float | None:
        """When `lost` may next have something to tell."""
        if not self._linked:
            return None
        return min(self._doubted_until_s.values(), default=None)
