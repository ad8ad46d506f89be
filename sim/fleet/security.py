"""How a run is protected, as its command line says, and what of it can be told afterwards."""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from coordinator.mission_view.results import ProtectionSummary, refusals
from sim.fleet.autopilots import SimulatedAutopilots
from sim.fleet.keys import fresh_keys, keys_in
from sim.fleet.layout import BusKind, LaunchOptions
from swarm.model import Mission

_UNSIGNED = "MAVLink is not signed, as the vehicles have been given no keys: see --signing-key"


@contextlib.contextmanager
def protected(
    mission: Mission,
    options: LaunchOptions,
    *,
    secure: bool,
    keys: Path | None,
    strangers: Sequence[str] = (),
) -> Iterator[LaunchOptions]:
    """``options`` with keys, if any are asked for; new ones are gone when the context ends.

    Simulated autopilots get each the key of its UAV, too, unless a signing key is given.
    ``secure`` makes new keys where there are none in a folder ``keys``, those of ``strangers``
    too, see `fresh_keys`.

    Raises:
        InputError: the keys do not fit, or cannot be made.
    """
    if keys is None and not secure:
        yield options
        return
    mesh = options.bus.for_fleet(len(mission.uavs)) is BusKind.MESH
    made = (
        fresh_keys(mission, routers=options.routers, mesh=mesh, strangers=strangers)
        if keys is None
        else contextlib.nullcontext(keys_in(keys, mission, mesh=mesh))
    )
    with made as run_keys:
        told = options.passthrough
        if told.signing_key is None and isinstance(options.autopilots, SimulatedAutopilots):
            told = replace(told, signing_key=run_keys.folder)
        yield replace(options, keys=run_keys, passthrough=told)


def security_of(
    options: LaunchOptions, mission: Mission, dropped: Iterable[Mapping[str, int]]
) -> ProtectionSummary | None:
    """What protected a flight; None if it had no keys.

    ``dropped`` is what each process that tells has dropped, by reason.
    """
    if options.keys is None:
        return None
    mesh = options.bus.for_fleet(len(mission.uavs)) is BusKind.MESH
    signs = options.passthrough.signing_key is not None
    where = "every peer" if mesh else "the router" if options.routers == 1 else "the routers"
    return ProtectionSummary(
        measures=(
            "TLS with a certificate for each process",
            f"access control at {where}",
            "signed statements",
            *(["signed MAVLink"] if signs else []),
        ),
        lacking=() if signs else (_UNSIGNED,),
        refused=refusals(dropped),
    )
