"""Types of message fields, with the bounds that keep every computation finite."""

from __future__ import annotations

from typing import Annotated, ClassVar, Final

from annotated_types import Ge, Gt, Le, Len, Predicate
from pydantic import ConfigDict, Strict

from swarm.model import valid_id

MAX_COUNT: Final = 2**53
"""Largest count; whoever counts on from what it heard stays within."""
LATEST_S: Final = 1e15
"""Farthest instant from mission time 0 [s]."""

# The bounds admit whatever a scenario may hold and keep every computation finite.
Id = Annotated[str, Strict(), Predicate(valid_id)]
Flag = Annotated[bool, Strict()]
Metres = Annotated[float, Strict(), Ge(-1e8), Le(1e8)]
Point = tuple[Metres, Metres, Metres]
FlatPoint = tuple[Metres, Metres]
Height = Annotated[float, Strict(), Ge(0.0), Le(1e8)]
Separation = Annotated[float, Strict(), Gt(0.0), Le(1e6)]
Instant = Annotated[float, Strict(), Ge(-LATEST_S), Le(LATEST_S)]
Duration = Annotated[float, Strict(), Ge(0.0), Le(1e9)]
Horizon = Annotated[float, Strict(), Gt(0.0), Le(1e9)]
Limit = Annotated[float, Strict(), Ge(0.0), Le(LATEST_S)]
Speed = Annotated[float, Strict(), Ge(1e-6), Le(1e6)]
WindSpeed = Annotated[float, Strict(), Ge(-1e6), Le(1e6)]
Acceleration = Annotated[float, Strict(), Ge(1e-6), Le(1e6)]
Value = Annotated[float, Strict(), Ge(0.0), Le(1e12)]
Probability = Annotated[float, Strict(), Ge(0.0), Le(1.0)]
Count = Annotated[int, Strict(), Ge(0), Le(MAX_COUNT)]
Heading = Annotated[float, Strict(), Ge(0.0), Le(6.2832)]
Reason = Annotated[str, Strict(), Len(1, 40)]
Words = Annotated[str, Strict(), Len(0, 200)]
Factor = Annotated[float, Strict(), Ge(1e-3), Le(1e3)]
Score = Annotated[float, Strict(), Ge(-1e30), Le(1e30)]


class Checked:
    """Base of the dataclasses that messages are made of, which says how pydantic checks them.

    Fields that only a newer release knows are passed over.
    """

    __slots__ = ()
    __pydantic_config__: ClassVar[ConfigDict] = {"extra": "ignore", "allow_inf_nan": False}
