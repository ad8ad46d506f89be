"""Founds the authority of a mission, with an identity for everyone of the fleet."""

from __future__ import annotations

import secrets
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from swarm.identity.authority import (
    DAY_S,
    EARLY_S,
    MAVLINK_TABLE_FILE,
    Authority,
    new_door_key,
    require_fit,
)
from swarm.identity.folder import AUTHORITY_FILE, AUTHORITY_KEY_FILE, DOOR_KEY_FILE, ROSTER_FILE
from swarm.identity.ledger import ISSUED_FILE, Ledger, encode_ledger
from swarm.identity.private_files import make_private_folder, write_private
from swarm.identity.roster import SERIES_BYTES, Role, Roster, encode_roster, fleet_names
from swarm.identity.shared_secrets import encode_table
from swarm.runtime.errors import Fault, InputError

DEFAULT_DAYS: Final = 90
_AUTHORITY_DAYS: Final = 3650


def found_authority(
    directory: Path,
    mission: str,
    uavs: Sequence[str],
    *,
    now_s: float,
    coordinators: int = 1,
    routers: int = 1,
    dashboards: int = 1,
    operators: int = 1,
    days: float = DEFAULT_DAYS,
    mesh: bool = False,
) -> Authority:
    """Make an authority in ``directory``, and an identity for everyone of the fleet.

    The names are the UAVs' ids, ``coordinator``, ``router``, ``dashboard`` and ``operator``,
    the second of a kind ``coordinator-2`` and so on.

    ``directory`` must not be there yet, or be empty; ``now_s`` is wall time [unix s]. Certificates
    are valid for ``days``; in a ``mesh`` all shall be dialled, not only routers.

    Raises:
        InputError: the directory is in use, or two would have one name.
        OSError: something cannot be written.
    """
    remedy = "name the UAV otherwise in the scenario"
    ledger = Ledger(mission, max(1, round(days)), mesh, {})
    counts = {
        Role.COORDINATOR: coordinators,
        Role.ROUTER: routers,
        Role.VIEWER: dashboards,
        Role.OPERATOR: operators,
    }
    try:
        names = fleet_names(uavs, counts)
    except ValueError as fault:
        raise InputError(Fault(mission, "", str(fault), remedy)) from None
    require_fit(names, ledger, mission, remedy)
    _refuse_in_use(directory)
    directory.parent.mkdir(parents=True, exist_ok=True)
    draft = directory.with_name(f".{directory.name}.{secrets.token_hex(4)}")
    make_private_folder(draft)
    try:
        _write_empty(draft, ledger, int(now_s))
        Authority(draft).issue(names, now_s=now_s, days=days)
        draft.rename(directory)
    except BaseException:
        shutil.rmtree(draft, ignore_errors=True)
        raise
    return Authority(directory)


def _write_empty(directory: Path, ledger: Ledger, now_s: int) -> None:
    """The files of an authority that has issued nothing yet."""
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

    from swarm.identity.certificates import authority_certificate, certificate_pem, key_pem

    key = Ed25519PrivateKey.generate()
    certificate = authority_certificate(
        key,
        ledger.mission,
        not_before_s=now_s - EARLY_S,
        not_after_s=now_s + (_AUTHORITY_DAYS + 1) * DAY_S,
    )
    roster = Roster(ledger.mission, secrets.token_bytes(SERIES_BYTES), 1, ())
    for name, data in {
        AUTHORITY_KEY_FILE: key_pem(key),
        AUTHORITY_FILE: certificate_pem(certificate),
        DOOR_KEY_FILE: new_door_key(),
        ISSUED_FILE: encode_ledger(ledger),
        ROSTER_FILE: encode_roster(roster, key),
        MAVLINK_TABLE_FILE: encode_table({}),
    }.items():
        write_private(directory / name, data)


def _refuse_in_use(directory: Path) -> None:
    if (directory / AUTHORITY_KEY_FILE).exists():
        problem = "is an authority's folder already"
        remedy = "add to it with 'swarm keys add', or choose another folder"
    elif directory.is_dir() and any(directory.iterdir()):
        problem, remedy = "is not empty", "choose a new folder"
    elif directory.exists() and not directory.is_dir():
        problem, remedy = "is a file", "choose a new folder"
    else:
        return
    raise InputError(Fault(str(directory), "", problem, remedy))
