"""A mission's authority: one folder from which everyone of the mission gets an identity.

::

    authority.key, authority.pem   its own key and certificate
    door.key                       by which routers know everyone's door password
    issued.json                    name -> role and newest generation, of the revoked, too
    roster.json                    who is in force
    mavlink-keys.csv               pass phrase of every UAV's autopilot link
    <name>/                        what goes to that machine (swarm.identity.folder)

Every change writes in that order what it touches: generations are used up first and the
roster is in force before a folder is handed out, so that whatever interrupts it, no two
certificates bear one name and no two rosters one version; the same command again mends the
rest.
"""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import secrets
import shutil
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Final

from swarm.identity.folder import (
    AUTHORITY_FILE,
    AUTHORITY_KEY_FILE,
    CERTIFICATE_FILE,
    DOOR_KEY_FILE,
    DOOR_PASSWORD_FILE,
    IDENTITY_FILE,
    MAVLINK_KEY_FILE,
    PRIVATE_KEY_FILE,
    ROSTER_FILE,
)
from swarm.identity.ledger import ISSUED_FILE, Issued, Ledger, decode_ledger, encode_ledger
from swarm.identity.private_files import (
    checked,
    decoded,
    read_private,
    replace_private,
    swap_in_folder,
    sync,
)
from swarm.identity.roster import (
    SERIES_BYTES,
    Role,
    Roster,
    RosterEntry,
    decode_roster,
    encode_roster,
)
from swarm.identity.shared_secrets import (
    DOOR_SECRET_BYTES,
    decode_table,
    door_password,
    encode_table,
    mavlink_key,
    new_phrase,
)
from swarm.runtime.errors import Fault, InputError

if TYPE_CHECKING:
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

MAVLINK_TABLE_FILE: Final = "mavlink-keys.csv"
DAY_S: Final = 86_400
EARLY_S: Final = DAY_S
"""How far a certificate's beginning lies back, for machines whose clocks are behind."""
_RESTORE: Final = "put a copy of the authority's folder back"
_OWN_FILES: Final = (
    AUTHORITY_KEY_FILE,
    AUTHORITY_FILE,
    DOOR_KEY_FILE,
    ISSUED_FILE,
    ROSTER_FILE,
    MAVLINK_TABLE_FILE,
)


class Authority:
    """An authority's folder, open for changes; see `open_authority` and swarm.identity.founding."""

    def __init__(self, directory: Path) -> None:
        from swarm.identity.certificates import public_bytes, read_certificate, read_key

        self.directory = directory
        key_path, certificate_path = directory / AUTHORITY_KEY_FILE, directory / AUTHORITY_FILE
        self._key = decoded(key_path, read_key, _RESTORE, secret=True)
        self._certificate = decoded(certificate_path, read_certificate, _RESTORE)
        self.public_key = public_bytes(self._key)
        """Ed25519, 32 bytes."""
        if self.public_key != checked(certificate_path, public_bytes, self._certificate, _RESTORE):
            problem = f"is not the certificate of the {AUTHORITY_KEY_FILE} beside it"
            raise InputError(Fault(str(certificate_path), "", problem, _RESTORE))
        self._ledger, self.roster = self._read()

    @property
    def mission(self) -> str:
        """Name of the mission."""
        return self._ledger.mission

    @property
    def days(self) -> int:
        """How long certificates are valid, unless told otherwise."""
        return self._ledger.days

    @property
    def mesh(self) -> bool:
        """Whether all may be dialled, not only routers."""
        return self._ledger.mesh

    @property
    def issued(self) -> Mapping[str, Issued]:
        """Everyone who ever got a certificate, the revoked among them."""
        return self._ledger.issued

    def folder(self, name: str) -> Path:
        """What goes to the machine of ``name``."""
        return self.directory / name

    @property
    def mavlink_table(self) -> Path:
        """Pass phrases of the UAVs' autopilot links."""
        return self.directory / MAVLINK_TABLE_FILE

    def mavlink_uavs(self) -> set[str]:
        """Those who have a MAVLink key."""
        return set(self._phrases())

    def roster_bytes(self) -> bytes:
        """The roster in force, as it travels."""
        return encode_roster(self.roster, self._key)

    def issue(
        self, names: Mapping[str, Role], *, now_s: float, days: float | None = None
    ) -> Roster:
        """Give each of ``names`` a certificate of the next generation, in a folder of its own.

        Those in force get a new one in place of the old. A UAV keeps its MAVLink key, unless it was
        revoked since it got that. Gives the roster now in force.

        ``names`` have a role each, ``now_s`` is wall time [unix s]; certificates are valid for
        ``days``, by the authority's own custom if None.

        Raises:
            InputError: a name is no use, or had another role before.
            OSError: something cannot be written.
        """
        with self._locked():
            return self._issue(names, self.roster.series, now_s, days)

    def revoke(self, names: Sequence[str]) -> Roster:
        """Take ``names`` out of the roster, and their folders and MAVLink keys away.

        Raises:
            InputError: one of them is not in force.
            OSError: something cannot be written.
        """
        with self._locked():
            faults = [self._not_in_force(name) for name in names if self.roster.entry(name) is None]
            if faults:
                raise InputError(*faults)
            kept = tuple(entry for entry in self.roster.entries if entry.name not in names)
            roster = replace(self.roster, version=self.roster.version + 1, entries=kept)
            self._enact(roster, encode_roster(roster, self._key))
            phrases = {uav: each for uav, each in self._phrases().items() if uav not in names}
            replace_private(self.mavlink_table, encode_table(phrases))
            for name in names:
                shutil.rmtree(self.folder(name), ignore_errors=True)
            return self.roster

    def renew(self, *, now_s: float, days: float | None = None) -> Roster:
        """Begin a new series: new certificates and door passwords for all who are in force.

        Whatever was signed, recorded or let in before is worth nothing afterwards. MAVLink
        keys stay, as the autopilots know them.
        """
        with self._locked():
            names = {entry.name: entry.role for entry in self.roster.entries}
            series = secrets.token_bytes(SERIES_BYTES)
            return self._issue(names, series, now_s, days, door_key=new_door_key())

    def _issue(
        self,
        names: Mapping[str, Role],
        series: bytes,
        now_s: float,
        days: float | None,
        door_key: bytes | None = None,
    ) -> Roster:
        from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

        from swarm.identity.certificates import public_bytes

        not_before_s = int(now_s) - EARLY_S
        not_after_s = int(now_s + (self.days if days is None else days) * DAY_S)
        self._refuse_beyond_own_end(not_after_s)
        require_fit(names, self._ledger, str(self.directory))
        ledger = self._ledger.with_next(names)
        keys = {name: Ed25519PrivateKey.generate() for name in names}
        before = self.roster
        entries = {entry.name: entry for entry in before.entries}
        for name, key in keys.items():
            generation = ledger.issued[name].generation
            entries[name] = RosterEntry(
                name, names[name], generation, public_bytes(key), not_after_s
            )
        ordered = tuple(entry for _, entry in sorted(entries.items()))
        roster = Roster(self.mission, series, before.version + 1, ordered)
        data = encode_roster(roster, self._key)  # before anything is written: may be too large
        self._write_ledger(ledger)
        self._enact(roster, data)
        if door_key is not None:
            replace_private(self.directory / DOOR_KEY_FILE, door_key)
        phrases = self._phrases()
        uavs = [name for name, role in names.items() if role is Role.UAV]
        fresh = [uav for uav in uavs if uav not in phrases or before.entry(uav) is None]
        if fresh:
            phrases |= {uav: new_phrase() for uav in fresh}
            replace_private(self.mavlink_table, encode_table(phrases))
        for name, key in keys.items():
            files = self._files_of(entries[name], key, not_before_s, phrases.get(name))
            files[ROSTER_FILE] = data
            swap_in_folder(self.folder(name), files)
        sync(self.directory)
        return roster

    def _files_of(
        self, entry: RosterEntry, key: Ed25519PrivateKey, not_before_s: int, phrase: str | None
    ) -> dict[str, bytes]:
        """What is in the folder of ``entry``."""
        from swarm.identity.certificates import certificate_pem, issue_certificate, key_pem

        certificate = issue_certificate(
            self._certificate,
            self._key,
            key.public_key(),
            entry.common_name,
            not_before_s=not_before_s,
            not_after_s=entry.not_after_s,
            server=self.mesh or entry.role is Role.ROUTER,
        )
        label = {
            "name": entry.name,
            "role": str(entry.role),
            "generation": entry.generation,
            "mission": self.mission,
        }
        door_key = read_private(self.directory / DOOR_KEY_FILE, _RESTORE)
        password = door_password(bytes.fromhex(door_key.decode("ascii")), entry.common_name)
        files = {
            IDENTITY_FILE: json.dumps(label, indent=1).encode() + b"\n",
            AUTHORITY_FILE: certificate_pem(self._certificate),
            CERTIFICATE_FILE: certificate_pem(certificate),
            PRIVATE_KEY_FILE: key_pem(key),
            DOOR_PASSWORD_FILE: password.encode() + b"\n",
        }
        if entry.role is Role.ROUTER:
            files[DOOR_KEY_FILE] = door_key
        if phrase is not None:
            files[MAVLINK_KEY_FILE] = mavlink_key(phrase).encode() + b"\n"
        return files

    def _enact(self, roster: Roster, data: bytes) -> None:
        """Put ``roster`` in force, here and in all folders that are still here."""
        replace_private(self.directory / ROSTER_FILE, data)
        self.roster = roster
        for entry in roster.entries:
            path = self.folder(entry.name) / ROSTER_FILE
            if path.exists():
                replace_private(path, data)

    def _refuse_beyond_own_end(self, not_after_s: int) -> None:
        end_s = self._certificate.not_valid_after_utc.timestamp()
        if not_after_s > end_s:
            problem = "the certificates would outlive the authority's own"
            remedy = "choose fewer days, or found a new authority with 'swarm keys init'"
            raise InputError(Fault(str(self.directory), "", problem, remedy))

    def _not_in_force(self, name: str) -> Fault:
        if name in self.issued:
            problem, remedy = f"{name!r} is revoked already", "leave it out"
        else:
            known = ", ".join(entry.name for entry in self.roster.entries)
            problem, remedy = f"nobody is named {name!r}", f"choose of {known}"
        return Fault(str(self.directory), "", problem, remedy)

    def _phrases(self) -> dict[str, str]:
        return decoded(self.mavlink_table, decode_table, _RESTORE, secret=True)

    def _read(self) -> tuple[Ledger, Roster]:
        """What changes."""
        ledger = decoded(self.directory / ISSUED_FILE, decode_ledger, _RESTORE)
        path = self.directory / ROSTER_FILE
        roster = decoded(path, lambda data: decode_roster(data, self.public_key), _RESTORE)
        return ledger, roster

    def _write_ledger(self, ledger: Ledger) -> None:
        replace_private(self.directory / ISSUED_FILE, encode_ledger(ledger))
        self._ledger = ledger

    @contextlib.contextmanager
    def _locked(self) -> Iterator[None]:
        """Keep others out, and begin with what they left."""
        handle = os.open(self.directory, os.O_RDONLY)
        try:
            fcntl.flock(handle, fcntl.LOCK_EX)
            self._ledger, self.roster = self._read()
            yield
        finally:
            os.close(handle)


def open_authority(directory: Path) -> Authority:
    """The authority in ``directory``.

    Raises:
        InputError: there is none, or a part of it is missing, damaged or open to others.
    """
    if not (directory / AUTHORITY_KEY_FILE).exists():
        problem = "is no authority's folder" if directory.exists() else "no such folder"
        remedy = "give the one that 'swarm keys init' made"
        raise InputError(Fault(str(directory), "", problem, remedy))
    return Authority(directory)


def require_fit(
    names: Mapping[str, Role], ledger: Ledger, source: str, remedy: str = "choose another name"
) -> None:
    """See that something can be issued for each of ``names``, in a folder of its own.

    ``ledger`` knows what was issued before; ``source`` of the names and ``remedy`` go into faults.

    Raises:
        InputError: for one of them nothing can be.
    """
    firsts: dict[str, str] = {}
    for name in (*_OWN_FILES, *ledger.issued, *names):
        firsts.setdefault(name.casefold(), name)  # some disks do not tell capitals apart
    faults = []
    for name, role in names.items():
        first = firsts[name.casefold()]
        if name in _OWN_FILES:
            problem: str | None = f"{name!r} is the name of a file of the authority"
        elif first != name:
            problem = f"{name!r} differs from {first!r} in capital letters alone"
        else:
            problem = ledger.why_unfit(name, role)
        if problem is not None:
            faults.append(Fault(source, "", problem, remedy))
    if faults:
        raise InputError(*faults)


def new_door_key() -> bytes:
    """Text of a new door secret."""
    return secrets.token_hex(DOOR_SECRET_BYTES).encode("ascii") + b"\n"
