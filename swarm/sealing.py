"""What a process with an identity needs to be believed on the bus.

Leaves out: envelopes (swarm.wire.seal) and what is in the identity's folder (swarm.identity).
"""

from __future__ import annotations

from swarm.identity.folder import ROSTER_FILE, Identity
from swarm.wire.seal import Seal

__all__ = ["seal_of"]


def seal_of(identity: Identity | None) -> Seal | None:
    """The seal of that identity; None for a process without keys.

    Raises:
        OSError: its roster cannot be read any more.
        ValueError: that has been changed since the identity was loaded.
    """
    if identity is None:
        return None
    return Seal(
        identity.name,
        identity.private_key.sign,
        (identity.folder / ROSTER_FILE).read_bytes().decode(),
        identity.authority_public_key,
        identity.keep_roster,
    )
