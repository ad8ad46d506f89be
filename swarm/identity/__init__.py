"""Who takes part in a mission, and how each proves it: keys, certificates and the roster.

What a process needs that has keys is here; what makes keys is in `swarm.identity.founding`
and `swarm.identity.authority`. The cryptography library is loaded when it is used, so a
process without keys never loads it.
"""

from swarm.identity.folder import Identity, load_identity
from swarm.identity.roster import Role, Roster, RosterEntry, decode_roster, encode_roster

__all__ = [
    "Identity",
    "Role",
    "Roster",
    "RosterEntry",
    "decode_roster",
    "encode_roster",
    "load_identity",
]
