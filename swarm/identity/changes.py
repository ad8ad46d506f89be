"""Changes an authority's folder and, if it is told where, a running fleet along with it."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from swarm.identity.roster import Role, decode_roster
from swarm.runtime.errors import BusError, Fault, InputError, SwarmError

if TYPE_CHECKING:
    from swarm.bus.config import BusConfig
    from swarm.identity.authority import Authority

Publish = Callable[["BusConfig", Callable[[], bytes]], Collection[str]]


@dataclass(frozen=True, slots=True)
class FleetAddress:
    """How to reach a running fleet, as the options have it."""

    bus: str
    listen: str
    connect: list[str] | None
    keys: Path

    @property
    def is_named(self) -> bool:
        """Whether there is one to be told."""
        return bool(self.connect or self.listen or self.bus != "router")

    def config(self, signed: bytes, changing: Collection[str] = ()) -> BusConfig:
        """Settings of a seat to tell it from, whose keys are not among those ``changing``.

        ``signed`` is a roster of the authority whose word is to be told.

        Raises:
            InputError: the keys or the options do not serve for that.
        """
        from swarm.bus.config import bus_config
        from swarm.identity.folder import load_identity

        identity = load_identity(self.keys, roles=(Role.OPERATOR, Role.COORDINATOR))
        try:
            decode_roster(signed, identity.authority_public_key)
        except ValueError:
            problem = "these keys are from another authority"
            remedy = "give those of an operator or a coordinator of this one"
            raise InputError(Fault("--as", str(self.keys), problem, remedy)) from None
        if identity.name in changing:
            problem = f"the keys of {identity.name!r} are themselves to be changed"
            remedy = "tell the fleet with those of another operator, or of a coordinator"
            raise InputError(Fault("--as", str(self.keys), problem, remedy))
        return bus_config(self.bus, self.listen, self.connect or (), identity=identity)


def _publish(config: BusConfig, change: Callable[[], bytes]) -> Collection[str]:
    from swarm.bus.roster_publishing import publish

    return publish(config, change)


def enact(
    authority: Authority,
    change: Callable[[], object],
    fleet: FleetAddress,
    names: Collection[str],
    publish: Publish = _publish,
) -> str:
    """Make ``change`` of ``names``, and tell the ``fleet`` if there is one to be told.

    ``publish`` tells it: `swarm.bus.roster_publishing.publish`. Gives a line about who knows of it.

    Raises:
        InputError: it cannot be made, or told.
        SwarmError: the fleet was not reached, so nothing was changed; or somebody has not
            confirmed it.
    """

    def changed() -> bytes:
        with written(authority.directory):
            change()
        return authority.roster_bytes()

    if not fleet.is_named:
        changed()
        folder = authority.directory
        return (
            f"roster version {authority.roster.version}; "
            f"tell a running fleet: swarm keys publish {folder} --connect ENDPOINT"
        )
    version = authority.roster.version
    config = fleet.config(authority.roster_bytes(), names)
    try:
        confirmed = publish(config, changed)
    except BusError as error:
        if authority.roster.version != version:
            raise
        raise SwarmError(f"{error}; nothing was changed, which works without --connect") from error
    return told(authority.roster.version, confirmed)


def told(version: int, confirmed: Collection[str]) -> str:
    """A line about who has confirmed a new roster."""
    who = f"confirmed by {', '.join(confirmed)}" if confirmed else "nobody is there to confirm it"
    return f"roster version {version} published; {who}"


@contextmanager
def written(directory: Path) -> Iterator[None]:
    """Say in one line why something could not be written."""
    try:
        yield
    except OSError as error:
        where = error.filename or directory
        problem = f"cannot be written: {error.strerror or error}"
        remedy = "choose a place that can, and see that the disk has room"
        raise InputError(Fault(str(where), "", problem, remedy)) from error
