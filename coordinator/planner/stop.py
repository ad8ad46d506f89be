"""Limits of a search: how many evaluations, how long, or whatever the caller says.

A limit is a function of the work done so far, so searches themselves read no clock.
"""

from __future__ import annotations

from collections.abc import Callable

from swarm.clock import Clock

__all__ = ["ShouldStop", "after_evaluations", "after_time", "first_of", "never"]

ShouldStop = Callable[[float], bool]
"""Given the evaluations spent so far (a part of one counts as its part), whether to stop."""


def never(evaluations: float) -> bool:
    """Let the search end by itself."""
    del evaluations
    return False


def after_evaluations(limit: int) -> ShouldStop:
    """Stop once ``limit`` (>= 1) evaluations are spent."""
    if limit < 1:
        raise ValueError(f"limit must be >= 1 evaluation, not {limit}")
    return lambda evaluations: evaluations >= limit


def after_time(clock: Clock, limit_s: float) -> ShouldStop:
    """Stop ``limit_s`` (>= 0) seconds of ``clock`` from now."""
    if not limit_s >= 0.0:
        raise ValueError(f"limit_s must be >= 0 s, not {limit_s}")
    end_s = clock.now_s() + limit_s
    return lambda _: clock.now_s() >= end_s


def first_of(*stops: ShouldStop) -> ShouldStop:
    """Stop as soon as any of ``stops`` says so."""
    return lambda evaluations: any(stop(evaluations) for stop in stops)
