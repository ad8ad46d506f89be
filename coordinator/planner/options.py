"""What a planner can be asked for: its methods, and the limits of its search.

A limit is a function of the work done so far, so searches themselves read no clock. Asked about 0
evaluations it says what is over by time alone, or by somebody's wish: that ends also what spends no
evaluations. Those made here also say how much of them is spent, which an annealing search cools by.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from swarm.runtime.clock import Clock


def method_names() -> list[str]:
    """Of all planning methods, for the completion of commands, which load no planner otherwise."""
    from coordinator.planner.plan import METHODS

    return list(METHODS)


def online_method_names() -> list[str]:
    """The same of those that agents can follow."""
    from coordinator.planner.plan import ONLINE_METHODS

    return list(ONLINE_METHODS)


BOUND_S = 3.0
"""Time spent on an upper bound beside a plan that somebody asked for [s]."""
_BOUND_FRAC = 0.25
"""The most of a limit that is kept for that."""


def bound_frac(time_limit_s: float | None, *, proves: bool) -> float:
    """The share of a limit [s] that is kept for an upper bound; 0 without a limit.

    Where the search ``proves`` itself, nothing is kept from it.
    """
    return min(_BOUND_FRAC, BOUND_S / time_limit_s) if time_limit_s and not proves else 0.0


def whole_limit(
    time_limit_s: float | None, bound_s: float | None, *, proves: bool
) -> tuple[float | None, float]:
    """The time for search and bound together [s], and the share of it kept for the bound.

    Args:
        time_limit_s: for both, or for the search alone where ``bound_s`` is given [s].
        bound_s: asked for beyond that [s].
        proves: the search is a proof itself, for which nothing is kept unless it is asked for.
    """
    if time_limit_s is None or bound_s is None:
        return time_limit_s, bound_frac(time_limit_s, proves=proves)
    whole_s = time_limit_s + bound_s
    return whole_s, bound_s / whole_s


ShouldStop = Callable[[float], bool]
"""Given the evaluations spent so far (a part of one counts as its part), whether to stop; given 0,
whether to stop whatever is going on."""


def never(evaluations: float) -> bool:
    """Let the search end by itself."""
    del evaluations
    return False


@dataclass(frozen=True, slots=True)
class Limit:
    """A `ShouldStop` that is approached gradually."""

    spent_frac: Callable[[float], float]
    """Given the evaluations spent so far, the share of the limit that is spent; >= 1: stop."""

    def __call__(self, evaluations: float) -> bool:
        """Whether to stop."""
        return self.spent_frac(evaluations) >= 1.0

    def part(self, frac: float) -> Limit:
        """A limit that is spent when ``frac`` (> 0) of this one is."""
        if not frac > 0.0:
            raise ValueError(f"frac must be > 0, not {frac}")
        return Limit(lambda evaluations: self.spent_frac(evaluations) / frac)


def after_evaluations(limit: int) -> Limit:
    """Stop once ``limit`` (>= 1) evaluations are spent."""
    if limit < 1:
        raise ValueError(f"limit must be >= 1 evaluation, not {limit}")
    return Limit(lambda evaluations: evaluations / limit)


def after_time(clock: Clock, limit_s: float, begin_s: float | None = None) -> Limit:
    """Stop ``limit_s`` (>= 0) seconds of ``clock`` after ``begin_s``, which is now when None."""
    if not limit_s >= 0.0:
        raise ValueError(f"limit_s must be >= 0 s, not {limit_s}")
    begin_s = clock.now_s() if begin_s is None else begin_s
    end_s = begin_s + limit_s

    def spent_frac(evaluations: float) -> float:
        del evaluations
        now_s = clock.now_s()
        return 1.0 if now_s >= end_s else (now_s - begin_s) / limit_s

    return Limit(spent_frac)


def part_of(stop: ShouldStop, frac: float) -> ShouldStop:
    """``frac`` (> 0) of ``stop`` where it is a limit; else all of it."""
    return stop.part(frac) if isinstance(stop, Limit) else stop


def beginning_of(stop: ShouldStop, frac: float) -> ShouldStop:
    """``frac`` (> 0) of what is left of ``stop`` now, where it is a limit; else all of it."""
    if not isinstance(stop, Limit):
        return stop
    spent = stop.spent_frac(0.0)
    whole = max(0.0, 1.0 - spent) * frac
    if whole == 0.0:
        return Limit(lambda _: 1.0)
    return Limit(lambda evaluations: (stop.spent_frac(evaluations) - spent) / whole)


def first_of(*stops: ShouldStop) -> Limit:
    """Stop as soon as any of ``stops`` says so; of several limits the one spent most counts."""

    def spent_frac(evaluations: float) -> float:
        shares = [
            stop.spent_frac(evaluations) if isinstance(stop, Limit) else float(stop(evaluations))
            for stop in stops
        ]
        return max(shares, default=0.0)

    return Limit(spent_frac)
