"""The keys with which the processes of a run prove who they are.

They are those of a mission as `swarm keys` makes them: the authority's folder with one for each
identity below it. A run takes a folder that is there, or has a new one made for itself, which is
gone when the run is over.
"""

from __future__ import annotations

import contextlib
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from swarm.runtime.clock import unix_s
from swarm.runtime.errors import Fault, InputError

if TYPE_CHECKING:
    from swarm.identity.authority import Authority
    from swarm.model import Mission

_DAYS = 1
"""How long keys that are made for one run are valid, should it leave them behind."""


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
    """Identity by the name of an observer that is to have another than the viewer's."""

    def of_router(self, number: int) -> Path:
        """The folder of the router of that number, from 0."""
        return self.folder / self.routers[number % len(self.routers)]

    def of_seat(self, name: str) -> Path:
        """The folder of the coordinator, or of the agent of a UAV."""
        return self.folder / name

    def of_operator(self) -> Path:
        """The folder of who steps in."""
        return self.folder / self.operator

    def of_observer(self, name: str) -> Path:
        """The folder of who looks on under that name."""
        return self.folder / self.guests.get(name, self.viewer)


@contextlib.contextmanager
def fresh_keys(
    mission: Mission, *, routers: int = 1, mesh: bool = False, strangers: Sequence[str] = ()
) -> Iterator[RunKeys]:
    """New keys for one run of ``mission``, in a private folder that is gone at the end.

    In a ``mesh`` all processes are dialled, not only routers. ``strangers`` are observers that get
    the identity of a UAV that the mission does not have, of the same name.

    Raises:
        InputError: an id of the scenario is no name for keys.
    """
    from swarm.identity.founding import found_authority

    with tempfile.TemporaryDirectory(prefix="peckorder-", ignore_cleanup_errors=True) as folder:
        authority = found_authority(
            Path(folder) / "keys",
            mission.name,
            [*(uav.id for uav in mission.uavs), *strangers],
            now_s=unix_s(),
            routers=routers,
            days=_DAYS,
            mesh=mesh,
        )
        yield _run_keys(authority, {name: name for name in strangers}, mesh=mesh)


def keys_in(folder: Path, mission: Mission, *, mesh: bool) -> RunKeys:
    """Keys that `swarm keys init` has made in ``folder`` before; for a ``mesh``, without routers.

    Raises:
        InputError: something is missing, expired, not of this mission or not for a mesh.
    """
    from swarm.identity.authority import open_authority
    from swarm.identity.folder import load_identity
    from swarm.identity.roster import Role
    from swarm.model.ids import COORDINATOR

    authority = open_authority(folder)
    if authority.roster.mission != mission.name:
        theirs = authority.roster.mission
        problem = f"these keys are for the mission {theirs!r}, not {mission.name!r}"
        raise InputError(Fault(str(folder), "", problem, "give those of this mission"))
    if mesh and not authority.mesh:
        problem = "these keys are for fleets with routers: nobody else may be dialled with them"
        remedy = "use --bus router, or make them with 'swarm keys init --mesh'"
        raise InputError(Fault(str(folder), "", problem, remedy))
    keys = _run_keys(authority, {}, mesh=mesh)
    wanted = {uav.id: Role.UAV for uav in mission.uavs} | {COORDINATOR: Role.COORDINATOR}
    wanted |= {keys.viewer: Role.VIEWER, keys.operator: Role.OPERATOR}
    wanted |= {} if mesh else dict.fromkeys(keys.routers, Role.ROUTER)
    faults: list[Fault] = []
    for name, role in wanted.items():
        try:
            load_identity(folder / name, name=name, roles=(role,), mission=mission.name)
        except InputError as error:
            faults += error.faults
    if faults:
        raise InputError(*faults)
    return keys


def _run_keys(authority: Authority, guests: Mapping[str, str], *, mesh: bool) -> RunKeys:
    from swarm.identity.roster import Role

    names: dict[Role, list[str]] = {role: [] for role in Role}
    for entry in authority.roster.entries:
        names[entry.role].append(entry.name)
    for role in (Role.VIEWER, Role.OPERATOR, *(() if mesh else (Role.ROUTER,))):
        if not names[role]:
            problem = f"nobody in the roster is a {role}, and a run has one"
            remedy = (
                f"give one keys with 'swarm keys add {authority.directory} {role} --role {role}'"
            )
            raise InputError(Fault(str(authority.directory), "", problem, remedy))
    return RunKeys(
        authority.directory,
        routers=tuple(names[Role.ROUTER]),
        viewer=names[Role.VIEWER][0],
        operator=names[Role.OPERATOR][0],
        guests=dict(guests),
    )
