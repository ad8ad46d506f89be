"""Sessions of those who have keys: mutual TLS or QUIC, the door, and who may say what.

TLS refuses who has no certificate of the mission's authority, or an expired one; the door of a
router who has one that is revoked; what the others may say is in swarm.bus.access. Leaves
out: the keys themselves (swarm.identity), and what is signed (swarm.wire.seal).
"""

from __future__ import annotations

import contextlib
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import zenoh

from swarm.bus.access import access_settings
from swarm.bus.privacy import is_encrypted
from swarm.bus.zenoh_session import endpoints_of, lay_over
from swarm.clock import unix_s
from swarm.errors import Fault, InputError
from swarm.identity import Identity, Role, Roster
from swarm.identity.door import door_dictionary
from swarm.identity.folder import shown_time
from swarm.log import get_logger

__all__ = ["door_of", "secure", "secure_settings"]

_TLS: Final = "transport/link/tls"
_DOOR: Final = "transport/auth/usrpwd"
SEATS_PER_IDENTITY: Final = 8
"""Sessions at once, such as that of an agent and those of commands on the same machine."""
EXPIRES_SOON_S: Final = 86_400.0
"""Keys that expire sooner might do so in flight."""
PENDING: Final = 100
"""Sessions that are being opened at once."""


def secure(
    config: zenoh.Config, identity: Identity, mode: str, roster: Roster, door: Path | None = None
) -> None:
    """Lay what keys entail over the configuration of a session, a user's file included.

    Args:
        config: of the session.
        identity: of the session.
        mode: ``client``, ``peer`` or ``router``.
        roster: in force.
        door: for a router, the file that `door_of` made.

    Raises:
        InputError: an endpoint is not encrypted, or others would dial it in that mode, which
            its certificate does not allow.
    """
    for side in ("listen", "connect"):
        for endpoint in endpoints_of(config, side):
            if not is_encrypted(endpoint):
                problem = f"{endpoint} is not encrypted"
                remedy = f"with --keys write tls/… or quic/… among {side}/endpoints"
                raise InputError(Fault("Zenoh configuration", "", problem, remedy))
    if identity.not_after_s - unix_s() < EXPIRES_SOON_S:
        ends = shown_time(identity.not_after_s)
        get_logger("swarm.bus").warning("these keys expire soon, and every link with them", at=ends)
    lay_over(config, secure_settings(identity, mode, roster, door))


def secure_settings(
    identity: Identity, mode: str, roster: Roster, door: Path | None = None
) -> dict[str, object]:
    """What keys entail for a session, by path of Zenoh's configuration; see `secure`."""
    certificate, key = str(identity.certificate_path), str(identity.private_key_path)
    settings: dict[str, object] = {
        # Nobody who is reached otherwise has proven anything.
        "transport/link/protocols": ["tls", "quic"],
        f"{_TLS}/root_ca_certificate": str(identity.authority_path),
        f"{_TLS}/enable_mtls": True,
        f"{_TLS}/connect_certificate": certificate,
        f"{_TLS}/connect_private_key": key,
        # Addresses change, and only those who may be dialled can serve; see swarm.identity.
        f"{_TLS}/verify_name_on_connect": False,
        f"{_TLS}/close_link_on_expiration": True,
    }
    if mode != "peer":
        settings |= {
            f"{_DOOR}/user": identity.common_name,
            f"{_DOOR}/password": identity.password,
            f"{_DOOR}/dictionary_file": None if door is None else str(door),
        }
    if mode != "client":
        _require_server(identity)
        settings |= {
            f"{_TLS}/listen_certificate": certificate,
            f"{_TLS}/listen_private_key": key,
            "transport/unicast/max_sessions": SEATS_PER_IDENTITY * max(1, len(roster.entries)),
            "transport/unicast/accept_pending": PENDING,
        }
        settings |= access_settings(roster)
    return settings


@contextlib.contextmanager
def door_of(identity: Identity, roster: Roster) -> Iterator[Path | None]:
    """A file with everyone's password, which is there while a session opens.

    None for those who keep no door.

    Raises:
        OSError: it cannot be written.
    """
    if identity.role is not Role.ROUTER or identity.door_secret is None:
        yield None
        return
    passwords = door_dictionary(roster, identity.door_secret)
    file, name = tempfile.mkstemp(prefix="peckorder-door-")  # 0600
    try:
        with os.fdopen(file, "w", encoding="ascii") as lines:
            lines.writelines(f"{user}:{password}\n" for user, password in passwords.items())
        yield Path(name)
    finally:
        Path(name).unlink(missing_ok=True)


def _require_server(identity: Identity) -> None:
    from cryptography.x509 import ExtendedKeyUsage, ExtensionNotFound
    from cryptography.x509.oid import ExtendedKeyUsageOID

    from swarm.identity.certificates import read_certificate

    certificate = read_certificate(identity.certificate_path.read_bytes())
    try:
        usages = certificate.extensions.get_extension_for_class(ExtendedKeyUsage).value
    except ExtensionNotFound:
        return
    if ExtendedKeyUsageOID.SERVER_AUTH not in usages:
        problem = f"others would refuse to dial {identity.name!r}, which is no router"
        remedy = "use --bus router, or make the keys of a mesh by 'swarm keys init --mesh'"
        raise InputError(Fault(str(identity.certificate_path), "", problem, remedy))
