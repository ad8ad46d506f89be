"""The keys with which the processes of a run prove who they are.

They are those of a mission as `swarm keys` makes them: the authority's folder with one for each
identity below it. A run takes folders that are there, or has new ones made for itself, which
nobody has a use for once it is over. Leaves out: making keys and what is in a folder
(swarm.identity), and what they protect (swarm.bus, swarm.wire).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

__all__ = ["RunKeys"]


@dataclass(frozen=True, slots=True)
class RunKeys:
    """Which identity each process of a run has."""

    folder: Path
    """The authority's; each identity's is below it, by its name."""
    routers: tuple[str, ...]
    """Identities of routers; they take turns where there are more routers than that."""
    viewer: str
    """Identity of who looks on: the launcher and its recorder."""
    operator: str
    """Identity of the dashboard, in which an operator may step in."""
    guests: Mapping[str, str] = field(default_factory=dict)
    """Identity by the name of an onlooker that is to have another than the viewer's."""

    def of_router(self, number: int) -> Path:
        """The folder of the router of that number, from 0."""
        return self.folder / self.routers[number % len(self.routers)]

    def of_seat(self, name: str) -> Path:
        """The folder of the coordinator, or of the agent of a UAV."""
        return self.folder / name

    def of_operator(self) -> Path:
        """The folder of who steps in."""
        return self.folder / self.operator

    def of_onlooker(self, name: str) -> Path:
        """The folder of who looks on under that name."""
        return self.folder / self.guests.get(name, self.viewer)
