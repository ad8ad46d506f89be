"""The options by which every command finds the bus, in one place.

A command has one parameter ``seat: Seat = DEFAULT_SEAT`` and is decorated with `seated`; on
the command line it has the options of `Seat`'s fields instead. Leaves out: what they mean for a
session (swarm.bus.config), and the router's own options (swarm.bus.cli).
"""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Collection
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any, get_type_hints

from swarm.bus.config import bus_config
from swarm.config import Link, LinkPreset, preset
from swarm.options import (
    BusOption,
    ConnectOption,
    KeysOption,
    LeaseOption,
    LinkOption,
    ListenOption,
    UnencryptedOption,
)

if TYPE_CHECKING:
    from swarm.bus.config import BusConfig
    from swarm.identity import Role

__all__ = ["DEFAULT_SEAT", "Seat", "seated"]

_PARAMETER = "seat"


@dataclass(frozen=True, slots=True)
class Seat:
    """How a process reaches the others, as the common options have it."""

    bus: BusOption = "router"
    listen: ListenOption = ""
    connect: ConnectOption = None
    keys: KeysOption = None
    unencrypted: UnencryptedOption = False
    link: LinkOption = Link.NORMAL
    lease_s: LeaseOption = None

    @property
    def network(self) -> LinkPreset:
        """Timers and lease that suit the kind of link."""
        return preset(self.link, self.lease_s)

    @property
    def is_named(self) -> bool:
        """Whether a place was named, rather than left to the default."""
        return bool(self.connect or self.listen or self.bus != "router")

    def config(
        self,
        *,
        mission: str | None = None,
        roles: Collection[Role] = (),
        name: str | None = None,
    ) -> BusConfig:
        """Settings of the seat; reads the keys, if there are any.

        Args:
            mission: that the keys have to be for; None for whichever they are for.
            roles: of which the keys have to be of one; any if there is none.
            name: that the keys have to be of; None for whichever.

        Raises:
            InputError: options contradict each other, or do not fit the keys.
        """
        identity = None
        if self.keys is not None:
            from swarm.identity import load_identity

            identity = load_identity(self.keys, mission=mission, roles=roles, name=name)
        return bus_config(
            self.bus,
            self.listen,
            self.connect or (),
            self.network.lease_s,
            identity=identity,
            unencrypted=self.unencrypted,
        )

    def arguments(self) -> list[str]:
        """What to tell a process that finds the bus the same way; in a mesh it needs its own."""
        words = ["--bus", self.bus, "--link", self.link]
        for endpoint in self.connect or ():
            words += ["--connect", endpoint]
        if self.keys is not None:
            words += ["--keys", str(self.keys)]
        if self.unencrypted:
            words.append("--unencrypted")
        if self.lease_s is not None:
            words += ["--lease-s", repr(self.lease_s)]
        return words


DEFAULT_SEAT = Seat()


def seated(command: Callable[..., int]) -> Callable[..., int]:
    """Give a command that has a parameter ``seat`` the options of `Seat` on the command line."""
    names = tuple(field.name for field in fields(Seat))

    @functools.wraps(command)
    def run(*args: Any, **given: Any) -> int:
        seat = Seat(**{name: given.pop(name) for name in names if name in given})
        return command(*args, seat=seat, **given)

    hints = get_type_hints(Seat, include_extras=True)
    options = [
        inspect.Parameter(
            field.name,
            inspect.Parameter.KEYWORD_ONLY,
            default=field.default,
            annotation=hints[field.name],
        )
        for field in fields(Seat)
    ]
    parameters: list[inspect.Parameter] = []
    own = inspect.signature(command, eval_str=True).parameters
    for parameter in own.values():
        if parameter.name == _PARAMETER:
            parameters += options
        else:
            parameters.append(parameter.replace(kind=inspect.Parameter.KEYWORD_ONLY))
    run.__signature__ = inspect.Signature(parameters, return_annotation=int)  # type: ignore[attr-defined]  # functions have one
    run.__annotations__ = {each.name: each.annotation for each in parameters} | {"return": int}
    del run.__wrapped__  # or its own signature would be read
    return run
