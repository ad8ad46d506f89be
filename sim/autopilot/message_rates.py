"""Which messages each ground station gets how often.

All messages of a channel are due on one grid, so that those whose intervals are multiples of one
another go out together; a vehicle that is called too late skips what was missed instead of sending
it in a burst, and keeps the grid.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

_LEAST_INTERVAL_S = 0.001
"""Shorter intervals are taken as this one [s]."""
_ROUNDING = 1e-6
"""So little before an instant of the grid is that instant [intervals]."""


class MessageRates:
    """Periodic messages by channel."""

    def __init__(self) -> None:
        self._channels: dict[int, dict[int, list[float]]] = {}
        """Channel -> message id -> [interval, next due] in seconds."""
        self._grids_s: dict[int, float] = {}
        """An instant of each channel's grid."""
        self._deadline_s: float | None = math.inf
        """Cached; None when it has to be looked for again."""

    @property
    def channels(self) -> tuple[int, ...]:
        """Channels that are open."""
        return tuple(self._channels)

    def open(self, channel: int, streams: Mapping[int, float], now_s: float, grid_s: float) -> None:
        """Serve a channel, with the streams that it gets unasked; ``grid_s`` is on its grid."""
        self._channels.setdefault(channel, {})
        self._grids_s[channel] = grid_s
        for message_id, interval_s in streams.items():
            self.set_interval(channel, message_id, interval_s, now_s)

    def close(self, channel: int) -> None:
        """Stop serving a channel."""
        self._channels.pop(channel, None)
        self._grids_s.pop(channel, None)
        self._deadline_s = None

    def set_interval(
        self, channel: int, message_id: int, interval_s: float | None, now_s: float
    ) -> None:
        """Send a message at once and then on the grid, every ``interval_s`` [s]; None stops it."""
        streams = self._channels.setdefault(channel, {})
        if interval_s is None:
            streams.pop(message_id, None)
        else:
            streams[message_id] = [max(_LEAST_INTERVAL_S, interval_s), now_s]
        self._deadline_s = None

    def interval_s(self, channel: int, message_id: int) -> float | None:
        """Interval of a message [s]; None if it isn't streamed."""
        entry = self._channels.get(channel, {}).get(message_id)
        return None if entry is None else entry[0]

    def deadline_s(self) -> float:
        """When the next message is due [s]; infinity if none is."""
        if self._deadline_s is None:
            self._deadline_s = min(
                (due_s for streams in self._channels.values() for _, due_s in streams.values()),
                default=math.inf,
            )
        return self._deadline_s

    def take_due(self, now_s: float) -> Iterator[tuple[int, int]]:
        """Channel and message id of everything that is due by now."""
        if self.deadline_s() > now_s:
            return
        self._deadline_s = None
        for channel, streams in self._channels.items():
            grid_s = self._grids_s.get(channel, 0.0)
            for message_id, entry in streams.items():
                interval_s, due_s = entry
                if due_s <= now_s:
                    over = math.floor((now_s - grid_s) / interval_s + _ROUNDING)
                    entry[1] = grid_s + (over + 1) * interval_s
                    yield channel, message_id
