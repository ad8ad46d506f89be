"""Keys of a small mission, made in memory: who signs what, without a folder or a certificate."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

from swarm.identity.roster import SERIES_BYTES, Role, Roster, RosterEntry, encode_roster
from swarm.model.ids import COORDINATOR, OPERATOR
from swarm.protocol.seal import Seal
from tests.support.builders import MISSION


class Keyring:
    """An authority and everyone's private keys.

    Args:
        uavs: ids of the fleet; coordinator, operator and a viewer ``dashboard`` come on top.
        mission: mission name.
    """

    def __init__(self, *uavs: str, mission: str = MISSION) -> None:
        roles = dict.fromkeys(uavs, Role.UAV)
        roles |= {
            COORDINATOR: Role.COORDINATOR,
            "coordinator-2": Role.COORDINATOR,
            OPERATOR: Role.OPERATOR,
            "dashboard": Role.VIEWER,
            "router": Role.ROUTER,
        }
        self.authority = Ed25519PrivateKey.generate()
        self.private = {name: Ed25519PrivateKey.generate() for name in roles}
        entries = tuple(
            RosterEntry(name, role, 1, self.private[name].public_key().public_bytes_raw(), 1 << 39)
            for name, role in sorted(roles.items())
        )
        self.roster = Roster(mission, bytes(SERIES_BYTES), 1, entries)

    def signed(self, roster: Roster | None = None) -> str:
        """A roster, by default the present one, as the authority signs it."""
        return encode_roster(roster or self.roster, self.authority).decode()

    def without(self, *names: str) -> Roster:
        """The next roster, in which ``names`` are revoked."""
        kept = tuple(entry for entry in self.roster.entries if entry.name not in names)
        return replace(self.roster, version=self.roster.version + 1, entries=kept)

    def renewed(self, name: str) -> Roster:
        """The next roster, in which ``name`` has a new key, with which it signs from now on."""
        self.private[name] = Ed25519PrivateKey.generate()
        public = self.private[name].public_key().public_bytes_raw()
        entries = tuple(
            replace(entry, generation=entry.generation + 1, public_key=public)
            if entry.name == name
            else entry
            for entry in self.roster.entries
        )
        return replace(self.roster, version=self.roster.version + 1, entries=entries)

    def seal(
        self,
        name: str,
        roster: Roster | None = None,
        keep: Callable[[bytes], object] = bytes,
    ) -> Seal:
        """Of ``name``, with the present roster or another one; ``keep`` is its disk."""
        public = self.authority.public_key().public_bytes_raw()
        return Seal(name, self.private[name].sign, self.signed(roster), public, keep)
