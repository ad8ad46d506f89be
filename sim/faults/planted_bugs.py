"""Bugs put in on purpose, to see that the invariants find them.

Each is a context manager that patches the runtime while it lasts; none is ever active by itself.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from functools import partial
from typing import Final

import agent.core.decision
import swarm.protocol.board
import swarm.protocol.registers
from agent.core.calibration import FlightMeter, RunningMedian
from swarm.protocol.membership import Membership
from swarm.protocol.messages import Message
from swarm.protocol.uav_messages import Claim, ClaimPhase


@contextmanager
def _patched(place: object, name: str, value: object) -> Iterator[None]:
    kept = getattr(place, name)
    setattr(place, name, value)
    try:
        yield
    finally:
        setattr(place, name, kept)


def _ignore_incarnations() -> AbstractContextManager[None]:
    """Counters alone decide what is news."""

    def beats(new: Message, known: Message) -> bool:
        return new.stamp.counter > known.stamp.counter

    return _patched(swarm.protocol.registers, "_beats", beats)


@contextmanager
def _proposed_beats_held() -> Iterator[None]:
    """Claims that are only proposed win against those held."""

    def strength(uav: str, claim: Claim) -> tuple[bool, float, int, str]:
        held = claim.phase is not ClaimPhase.PROPOSED
        return (held, claim.completion_s if held else claim.decided_s, claim.rank, uav)

    with (
        _patched(swarm.protocol.board, "claim_strength", strength),
        _patched(agent.core.decision, "claim_strength", strength),
    ):
        yield


def _suspect_without_link() -> AbstractContextManager[None]:
    """Who has lost its own link takes the silence of all others for their loss."""

    def link(self: Membership, up: bool, now_s: float) -> None:
        """The own link never matters."""

    return _patched(Membership, "link", link)


@contextmanager
def _measure_wrongly(which: str, frac: float) -> Iterator[None]:
    """Agents measure so many times what is true: of ``times`` of legs or of ``drains``."""
    vote = FlightMeter._vote  # noqa: SLF001 - where all kinds of measurements enter

    def wrongly(
        self: FlightMeter,
        medians: RunningMedian,
        measured: float,
        within: tuple[float, float],
        now_s: float,
    ) -> bool:
        errs = medians is getattr(self._medians, which)
        return vote(self, medians, measured * (frac if errs else 1.0), within, now_s)

    with _patched(FlightMeter, "_vote", wrongly):
        yield


BUGS: Final[dict[str, Callable[[], AbstractContextManager[None]]]] = {
    "ignore-incarnations": _ignore_incarnations,
    "proposed-beats-held": _proposed_beats_held,
    "suspect-without-link": _suspect_without_link,
    "times-mismeasured": partial(_measure_wrongly, "times", 2.0),
    "drain-mismeasured": partial(_measure_wrongly, "drains", 1.3),
}
"""By name."""
FIELD_BUGS: Final = frozenset({"times-mismeasured", "drain-mismeasured"})
"""Those that show only in missions with the field's constraints."""
