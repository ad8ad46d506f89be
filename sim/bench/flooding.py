"""A hostile agent with valid keys beside a run: it floods from the mission's beginning to its end.

Leaves out: what it says (sim.chaos.flooder).
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator

from sim.chaos.flooder import Sent
from sim.chaos.insider_flood import QUESTIONS_HZ, flooded
from sim.launch.run import Run
from swarm.wire.messages import EpochPhase

__all__ = ["while_it_flies"]

_LIMIT_S = 86_400.0
"""A run gives up long before that."""
_ENDS_S = 10.0
"""Until the flooder has told what it sent."""


@contextlib.asynccontextmanager
async def while_it_flies(run: Run, rate_hz: float) -> AsyncIterator[list[Sent]]:
    """Flood ``run`` as long as its mission lasts.

    Args:
        run: just started, with routers and with keys for a flooder; see sim.chaos.insider_flood.
        rate_hz: messages a second; 0 for no flood.

    Yields:
        What the flooder has sent, once the mission has ended; empty if it never began.
    """
    sent: list[Sent] = []
    if not rate_hz:
        yield sent
        return
    pouring = asyncio.get_running_loop().create_task(_pour(run, rate_hz, sent))
    try:
        yield sent
        if run.observer.phase is EpochPhase.ENDED:
            await asyncio.wait([pouring], timeout=_ENDS_S)
    finally:
        pouring.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await pouring


async def _pour(run: Run, rate_hz: float, sent: list[Sent]) -> None:
    mission, options = run.launch.mission, run.launch.options
    observer, clock = run.observer, run.clock
    if options.keys is None:
        raise ValueError("only a run with keys is flooded")
    await run.until(
        lambda: observer.mission_s(clock.now_s()) is not None, limit_s=_LIMIT_S, what="the start"
    )
    async with flooded(run, mission, options.keys, rate_hz, QUESTIONS_HZ, options.seed) as flooding:
        await run.until(
            lambda: observer.phase is EpochPhase.ENDED, limit_s=_LIMIT_S, what="the end"
        )
    if flooding.sent is not None:
        sent.append(flooding.sent)
