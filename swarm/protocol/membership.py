"""Who is there: liveliness tokens and speech, judged with hysteresis.

A writer is present from the first sign of its token until either the token has been
gone for a while, or it has said nothing for long although the token lives: a token
proves the transport, speech proves the program. Both count only while the own link is
up and this process itself has not been held up: without that, the silence of others
proves nothing. Each process judges for itself.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Iterable

from swarm.model.ids import COORDINATOR
from swarm.protocol.timing import Timing, earliest


class Membership:
    """One process's judgement of who is present."""

    def __init__(self, timing: Timing) -> None:
        self._timing = timing
        self._silence_s = timing.silence_s
        self._linked = True
        self._heard: set[str] = set()
        """Who has ever said something, here or elsewhere; silence means nothing of others."""
        self._gone_until_s: dict[str, float] = {}
        """Present writers without a token, and when each is lost unless it is seen again."""
        self._silent_at_s: OrderedDict[str, float] = OrderedDict()
        """Present writers that have been heard, and when each is lost unless it speaks again.

        UAVs have equally long from when they were last heard, so they are in order of time. In a
        plain `dict` the first one is behind the gaps of all that have been moved to the end."""
        self._mute: set[str] = set()
        """Lost by silence, with a living token."""
        self._interrupted: set[str] = set()
        """Who may have begun anew since it last said what it claims: its token went, or the own
        link was down."""
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

    def is_credible(self, writer: str) -> bool:
        """Whether ``writer`` is one of them."""
        return writer in self.present and writer not in self._ghosts

    @property
    def steady(self) -> set[str]:
        """Writers that are there and remember all they ever said, so answer for themselves.

        A token that went and came back, or was there before the own link was down, may be a new
        process's, which must be told.
        """
        return self.present - self._interrupted

    def missed(self, writer: str) -> bool:
        """Whether ``writer`` was lost, and has not said since what it claims."""
        return writer in self._ghosts

    def mute(self, writer: str) -> bool:
        """Whether ``writer`` was lost by its silence, with a living token."""
        return writer in self._mute

    def missing(self, writer: str) -> bool:
        """Whether ``writer`` counts as present although its token has gone."""
        return writer in self._gone_until_s

    # -- what is observed -------------------------------------------------------------

    def stretch(self, stretch: float) -> None:
        """From now on UAVs repeat themselves that much more seldom; see `stretch_of`."""
        later_s = stretch * self._timing.silence_s - self._silence_s
        self._silence_s += later_s
        for writer in self._silent_at_s.keys() - {COORDINATOR}:
            self._silent_at_s[writer] += later_s

    def seen(self, writer: str, now_s: float) -> bool:
        """``writer``'s token is there; whether the writer is thereby present anew.

        A token that is told again does not bring back who was lost by silence.
        """
        self._gone_until_s.pop(writer, None)
        if writer in self.present or writer in self._mute:
            return False
        self._enter(writer, now_s)
        return True

    def gone(self, writer: str, now_s: float) -> None:
        """``writer``'s token has disappeared."""
        if self._linked:
            self._mute.discard(writer)  # the next token may be a new process's
        if writer not in self.present:
            return
        self._gone_until_s[writer] = now_s + self._timing.loss_delay_s
        if self._linked:
            self._interrupted.add(writer)

    def heard(self, writer: str, now_s: float) -> bool:
        """``writer`` itself has just said something; whether that brings it back.

        It does so for a writer that was lost by silence. Words of one whose token has
        gone may have been long under way: those bring nobody back.
        """
        self._heard.add(writer)
        if writer in self._mute:
            self._mute.discard(writer)
            self._enter(writer, now_s)
            return True
        if writer in self.present:
            self._wait_for(writer, now_s)
        return False

    def expect(self, writers: Iterable[str], now_s: float) -> None:
        """Others remember claims of ``writers``, so from now on those must speak, too."""
        for writer in set(writers) - self._heard:
            self._heard.add(writer)
            if writer in self.present:
                self._wait_for(writer, now_s)

    def spoke(self, writer: str) -> None:
        """``writer`` itself has just said what it claims."""
        self._ghosts.discard(writer)
        if writer not in self._gone_until_s:
            self._interrupted.discard(writer)

    def link(self, up: bool, now_s: float) -> None:
        """The own link came up or went down."""
        if up and not self._linked:
            self._grant_grace(now_s)
            self._interrupted |= self.present  # any token may be a new process's now
        self._linked = up

    def held_up(self, now_s: float) -> None:
        """This process was stopped or starved: what the others did meanwhile is yet to be read."""
        self._grant_grace(now_s)

    # -- what follows -------------------------------------------------------------------

    def lost(self, now_s: float) -> list[str]:
        """Writers given up by now, each told once, in id order."""
        deadline_s = self.next_deadline_s()
        if deadline_s is None or deadline_s > now_s:
            return []
        gone = {w for w, until_s in self._gone_until_s.items() if until_s <= now_s}
        silent = {w for w, at_s in self._silent_at_s.items() if at_s <= now_s}
        self._mute |= silent - self._gone_until_s.keys()
        lost = gone | silent
        for writer in lost:
            self._gone_until_s.pop(writer, None)
            self._silent_at_s.pop(writer, None)
        self.present -= lost
        self._ghosts |= lost
        self._interrupted |= lost
        return sorted(lost)

    def next_deadline_s(self) -> float | None:
        """When `lost` may next have something to tell; once it has been asked, in the future."""
        if not self._linked:
            return None
        first_s = next(iter(self._silent_at_s.values()), None)
        silent_s = earliest(first_s, self._silent_at_s.get(COORDINATOR))
        if not self._gone_until_s:
            return silent_s
        return earliest(silent_s, min(self._gone_until_s.values()))

    # -- pieces -------------------------------------------------------------------------

    def _enter(self, writer: str, now_s: float) -> None:
        self.present.add(writer)
        # The coordinator speaks as long as it is there; agents may have nothing to say yet.
        if writer in self._heard or writer == COORDINATOR:
            self._wait_for(writer, now_s)

    def _wait_for(self, writer: str, now_s: float) -> None:
        """``writer`` shall speak again: of all it has the longest until then."""
        self._silent_at_s[writer] = now_s + self._patience_s(writer)
        self._silent_at_s.move_to_end(writer)

    def _grant_grace(self, now_s: float) -> None:
        """Everyone gets the time to show its token, and to speak, that it would need anew."""
        gone_s = now_s + self._timing.relink_grace_s
        self._gone_until_s = dict.fromkeys(self._gone_until_s, gone_s)
        for writer in self._silent_at_s:
            self._silent_at_s[writer] = now_s + self._patience_s(writer)

    def _patience_s(self, writer: str) -> float:
        """How long ``writer`` may be silent; the coordinator speaks as often in every fleet."""
        return self._timing.silence_s if writer == COORDINATOR else self._silence_s
