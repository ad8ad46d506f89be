"""One identity's folder: what a process proves itself with, as `swarm keys` made it.

::

    identity.json                  name, role, generation and mission; no secrets
    authority.pem                  certificate of the mission's authority
    certificate.pem, private.key   its own, for TLS and for signatures
    door.password                  what it says at the routers' door
    roster.json                    who belongs to the mission; replaced by newer ones
    door.key                       routers only: by which they know everyone's password
    mavlink.key                    UAVs only: the key of the link to the autopilot
"""

from __future__ import annotations

import json
from collections.abc import Collection
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from swarm.identity.private_files import checked, decoded, read_private, replace_private
from swarm.identity.roster import Role, Roster, decode_roster
from swarm.identity.shared_secrets import DOOR_SECRET_BYTES
from swarm.runtime.clock import unix_s
from swarm.runtime.errors import Fault, InputError

if TYPE_CHECKING:
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

IDENTITY_FILE: Final = "identity.json"
AUTHORITY_FILE: Final = "authority.pem"
CERTIFICATE_FILE: Final = "certificate.pem"
PRIVATE_KEY_FILE: Final = "private.key"
ROSTER_FILE: Final = "roster.json"
DOOR_PASSWORD_FILE: Final = "door.password"  # noqa: S105 - the name of a file
DOOR_KEY_FILE: Final = "door.key"
MAVLINK_KEY_FILE: Final = "mavlink.key"
KEY_FILES: Final = (
    IDENTITY_FILE,
    AUTHORITY_FILE,
    CERTIFICATE_FILE,
    PRIVATE_KEY_FILE,
    ROSTER_FILE,
    DOOR_PASSWORD_FILE,
    DOOR_KEY_FILE,
    MAVLINK_KEY_FILE,
)
"""All that may be in the folder of one identity."""
AUTHORITY_KEY_FILE: Final = "authority.key"
"""In the authority's folder alone."""

_REINSTALL: Final = "install the folder that 'swarm keys' made for it anew"


@dataclass(frozen=True, slots=True, eq=False)
class Identity:
    """Who a process is, and what it proves that with; its text shows no secrets."""

    folder: Path
    name: str
    role: Role
    generation: int
    mission: str
    not_after_s: int
    """When its certificate expires [unix s]."""
    authority_public_key: bytes = field(repr=False)
    """Ed25519, 32 bytes."""
    roster: Roster = field(repr=False)
    """The newest that the folder had when it was loaded."""
    private_key: Ed25519PrivateKey = field(repr=False)
    password: str = field(repr=False)
    """What it says at a router's door; the user is its common name."""
    door_secret: bytes | None = field(repr=False)
    """By which a router works out everyone's password; None for others."""

    @property
    def common_name(self) -> str:
        """Name in its certificate: ``uav1@1``."""
        return f"{self.name}@{self.generation}"

    @property
    def authority_path(self) -> Path:
        """Certificate of the authority, for TLS."""
        return self.folder / AUTHORITY_FILE

    @property
    def certificate_path(self) -> Path:
        """Own certificate, for TLS."""
        return self.folder / CERTIFICATE_FILE

    @property
    def private_key_path(self) -> Path:
        """Own private key, for TLS."""
        return self.folder / PRIVATE_KEY_FILE

    @property
    def mavlink_key_path(self) -> Path | None:
        """Key of the link to the autopilot; None but for UAVs."""
        return self.folder / MAVLINK_KEY_FILE if self.role is Role.UAV else None

    def keep_roster(self, data: bytes) -> Roster:
        """Put the roster ``data``, which it gives, into the folder, unless a newer one is there.

        Raises:
            ValueError: it is not a roster of this mission, signed by its authority.
            OSError: it cannot be written; processes go on without having kept it.
        """
        roster = _decode_roster(data, self.authority_public_key, self.mission)
        path = self.folder / ROSTER_FILE
        try:
            kept = decode_roster(path.read_bytes(), self.authority_public_key)
        except (OSError, ValueError):
            kept = None
        if kept is None or roster.supersedes(kept):
            replace_private(path, data)
        return roster


def load_identity(
    path: Path,
    *,
    name: str | None = None,
    roles: Collection[Role] = (),
    mission: str | None = None,
    now_s: float | None = None,
) -> Identity:
    """The identity in the folder ``path``.

    It must be that of ``name``, have one of ``roles`` and be of ``mission``, where that is given.
    ``now_s`` is wall time [unix s]; the system's if None.

    Raises:
        InputError: something is missing, open to others, damaged, expired, not valid yet,
            revoked, or not what it must be.
    """
    from swarm.identity import certificates as pem

    label = _label(path)
    is_name, role = str(label["name"]), Role(label["role"])
    _require(path, label, name=name, roles=roles, mission=mission)
    authority = decoded(path / AUTHORITY_FILE, pem.read_certificate, _REINSTALL)
    certificate = decoded(path / CERTIFICATE_FILE, pem.read_certificate, _REINSTALL)
    if not pem.issued_by(certificate, authority):
        raise _fault(path / CERTIFICATE_FILE, f"is not issued by the {AUTHORITY_FILE} beside it")
    not_after_s = int(certificate.not_valid_after_utc.timestamp())
    _require_time(
        path / CERTIFICATE_FILE,
        int(certificate.not_valid_before_utc.timestamp()),
        not_after_s,
        unix_s() if now_s is None else now_s,
        is_name,
    )
    key = decoded(path / PRIVATE_KEY_FILE, pem.read_key, _REINSTALL, secret=True)
    public_key = checked(path / AUTHORITY_FILE, pem.public_bytes, authority, _REINSTALL)
    certified = checked(path / CERTIFICATE_FILE, pem.public_bytes, certificate, _REINSTALL)
    if pem.public_bytes(key) != certified:
        raise _fault(path / PRIVATE_KEY_FILE, f"is not the key of the {CERTIFICATE_FILE} beside it")
    roster = decoded(
        path / ROSTER_FILE,
        lambda data: _decode_roster(data, public_key, str(label["mission"])),
        _REINSTALL,
    )
    identity = Identity(
        folder=path,
        name=is_name,
        role=role,
        generation=int(label["generation"]),
        mission=str(label["mission"]),
        not_after_s=not_after_s,
        authority_public_key=public_key,
        roster=roster,
        private_key=key,
        password=decoded(path / DOOR_PASSWORD_FILE, _hex_text, _REINSTALL, secret=True),
        door_secret=decoded(path / DOOR_KEY_FILE, _door_secret, _REINSTALL, secret=True)
        if role is Role.ROUTER
        else None,
    )
    if (common_name := pem.common_name_of(certificate)) != identity.common_name:
        problem = f"is for {common_name!r}, {IDENTITY_FILE} for"
        raise _fault(path / CERTIFICATE_FILE, f"{problem} {identity.common_name!r}")
    _require_in_force(identity, certified)
    if identity.mavlink_key_path is not None:
        read_private(identity.mavlink_key_path, _REINSTALL)
    return identity


def shown_time(time_s: float) -> str:
    """A wall time [unix s] as people read it."""
    return datetime.fromtimestamp(time_s, UTC).strftime("%Y-%m-%d %H:%M UTC")


def _label(path: Path) -> dict[str, Any]:
    """What `IDENTITY_FILE` says, its shape checked."""
    where = str(path)
    if not path.is_dir():
        problem = "is no folder" if path.exists() else "no such folder"
        remedy = "give the folder that 'swarm keys' made for this process"
        raise InputError(Fault(where, "", problem, remedy))
    if (path / AUTHORITY_KEY_FILE).exists():
        problem = "is the folder of the authority, which no process flies with"
        raise InputError(Fault(where, "", problem, f"give one within it, such as {path / 'uav1'}"))
    if not (path / IDENTITY_FILE).exists():
        problem = f"holds no keys: there is no {IDENTITY_FILE}"
        remedy = "give the folder that 'swarm keys' made for this process"
        raise InputError(Fault(where, "", problem, remedy))
    label = decoded(path / IDENTITY_FILE, json.loads, _REINSTALL)
    match label:
        case {"name": str(), "role": str(role), "generation": int(), "mission": str()} if (
            role in set(Role)
        ):
            return dict(label)
        case _:
            raise _fault(path / IDENTITY_FILE, "is damaged")


def _require(
    path: Path,
    label: dict[str, Any],
    *,
    name: str | None,
    roles: Collection[Role],
    mission: str | None,
) -> None:
    """See that the keys are whose they must be."""
    is_name, role, is_mission = label["name"], Role(label["role"]), label["mission"]
    if mission is not None and is_mission != mission:
        problem = f"these keys are for the mission {is_mission!r}, not {mission!r}"
        remedy = "give those of this mission, or name the other one"
        raise InputError(Fault(str(path), "", problem, remedy))
    if roles and role not in roles:
        wanted = " or ".join(sorted(roles))
        problem = f"these keys are those of {is_name!r}, whose role is {role}"
        raise InputError(Fault(str(path), "", problem, f"give those of one whose role is {wanted}"))
    if name is not None and is_name != name:
        problem = f"these keys are those of {is_name!r}, not of {name!r}"
        raise InputError(Fault(str(path), "", problem, f"give the folder of {name!r}"))


def _require_time(
    path: Path, not_before_s: float, not_after_s: float, now_s: float, name: str
) -> None:
    if now_s > not_after_s:
        remedy = (
            f"issue a new one with 'swarm keys add DIR {name}', or set the clock, "
            f"which says {shown_time(now_s)}"
        )
        raise InputError(Fault(str(path), "", f"expired on {shown_time(not_after_s)}", remedy))
    if now_s < not_before_s:
        problem = f"is not valid before {shown_time(not_before_s)}"
        remedy = f"set the clock of this machine, which says {shown_time(now_s)}"
        raise InputError(Fault(str(path), "", problem, remedy))


def _require_in_force(identity: Identity, public_key: bytes) -> None:
    roster, path = identity.roster, identity.folder / ROSTER_FILE
    entry = roster.entry(identity.name)
    if entry is None or entry.generation != identity.generation or entry.public_key != public_key:
        problem = f"{identity.common_name} is not in this roster (version {roster.version})"
        remedy = (
            "it was revoked or replaced: install the newest folder of "
            f"{identity.name!r}, which 'swarm keys add' makes"
        )
        raise InputError(Fault(str(path), "", problem, remedy))
    if entry.role is not identity.role:
        raise _fault(path, f"says that {identity.name!r} is a {entry.role}, not a {identity.role}")


def _decode_roster(data: bytes, authority_public_key: bytes, mission: str) -> Roster:
    roster = decode_roster(data, authority_public_key)
    if roster.mission != mission:
        raise ValueError(f"it is the roster of {roster.mission!r}, not of {mission!r}")
    return roster


def _door_secret(data: bytes) -> bytes:
    secret = bytes.fromhex(_hex_text(data))
    if len(secret) != DOOR_SECRET_BYTES:
        raise ValueError(f"it is not {2 * DOOR_SECRET_BYTES} hexadecimal digits")
    return secret


def _hex_text(data: bytes) -> str:
    """The digits in ``data``; no error shows any of them."""
    text = data.decode("ascii", "replace").strip()
    if len(text) != 2 * DOOR_SECRET_BYTES or not set(text) <= set("0123456789abcdef"):
        raise ValueError(f"it is not {2 * DOOR_SECRET_BYTES} hexadecimal digits")
    return text


def _fault(path: Path, problem: str) -> InputError:
    return InputError(Fault(str(path), "", problem, _REINSTALL))
