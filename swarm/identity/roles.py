"""What an identity may do, and the names that identities get.

Leaves out: what follows from a role on the bus (swarm.bus.access, swarm.wire.seal).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from enum import StrEnum

__all__ = ["Role", "fleet_names", "numbered"]


class Role(StrEnum):
    """What one may do; everyone may read everything of the mission."""

    UAV = "uav"
    """Speaks for the UAV of its name."""
    COORDINATOR = "coordinator"
    """Writes brief, plan and board."""
    ROUTER = "router"
    """Carries everything between others and says nothing itself."""
    VIEWER = "viewer"
    """Reads only: dashboard, recorder, status."""
    OPERATOR = "operator"
    """Commands the fleet."""


_FIRST_NAMES = {
    Role.COORDINATOR: "coordinator",
    Role.ROUTER: "router",
    Role.VIEWER: "dashboard",
    Role.OPERATOR: "operator",
}


def numbered(first: str, count: int) -> Iterator[str]:
    """``first``, ``first-2``, ``first-3`` … ; ``count`` of them."""
    for number in range(1, count + 1):
        yield first if number == 1 else f"{first}-{number}"


def fleet_names(
    uavs: Sequence[str], *, coordinators: int, routers: int, dashboards: int, operators: int
) -> dict[str, Role]:
    """Role by name of a whole fleet.

    Raises:
        ValueError: two of them would have one name.
    """
    counts = {
        Role.COORDINATOR: coordinators,
        Role.ROUTER: routers,
        Role.VIEWER: dashboards,
        Role.OPERATOR: operators,
    }
    names = dict.fromkeys(uavs, Role.UAV)
    if len(names) != len(uavs):
        raise ValueError("UAV ids must differ")
    for role, count in counts.items():
        for name in numbered(_FIRST_NAMES[role], count):
            if name in names:
                raise ValueError(f"UAV id {name!r} is the name of the {role}'s keys")
            names[name] = role
    return names
