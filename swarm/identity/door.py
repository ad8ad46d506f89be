"""The door password: by it a router refuses who is not in the roster already at the door.

TLS lets in who has a certificate of the authority that has not expired, revoked or not.
So a router also asks for a password, which only routers and the authority can work out and
which each identity has in its folder: an HMAC of its common name. A re-issued certificate
has another common name, thus another password. Leaves out: handing it to Zenoh (swarm.bus).
"""

from __future__ import annotations

import hashlib
import hmac

from swarm.identity.roster import Roster

__all__ = ["DOOR_SECRET_BYTES", "door_dictionary", "door_password"]

DOOR_SECRET_BYTES = 32


def door_password(door_secret: bytes, common_name: str) -> str:
    """What ``common_name`` says at the door; 64 hexadecimal digits."""
    return hmac.new(door_secret, common_name.encode(), hashlib.sha256).hexdigest()


def door_dictionary(roster: Roster, door_secret: bytes) -> dict[str, str]:
    """Password by common name of everyone in ``roster``."""
    names = [entry.common_name for entry in roster.entries]
    return {name: door_password(door_secret, name) for name in names}
