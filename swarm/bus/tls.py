"""Sessions with keys: mutual TLS or QUIC, the door, and why a router refuses a process.

TLS refuses who has no certificate of the mission's authority, or an expired one; the door of a
router who has one that is revoked. Zenoh only tells that there is no link: a TLS handshake of
our own tells why.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import re
import ssl
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final

import zenoh

from swarm.bus.access import access_settings
from swarm.bus.config import is_encrypted
from swarm.bus.zenoh_session import endpoints_of, lay_over
from swarm.identity import Identity, Role, Roster
from swarm.identity.folder import shown_time
from swarm.identity.shared_secrets import door_dictionary
from swarm.runtime.clock import unix_s
from swarm.runtime.errors import Fault, InputError
from swarm.runtime.log import get_logger

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

    ``mode`` is ``client``, ``peer`` or ``router``; ``door`` is for the last, the file that
    `door_of` made.

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


DIAL_S = 3.0
"""How long a connection may take [wall s]."""
ALERT_S = 1.0
"""How long an alert may take after a handshake that succeeded [wall s]."""
_TLS_ENDPOINT = re.compile(r"tls/(\[[^\]]+\]|[^:]+):(\d+)")
_TCP_ENDPOINT = re.compile(r"tcp/(\[[^\]]+\]|[^:]+):(\d+)")
_NOT_YET_VALID, _EXPIRED = 9, 10
"""Verdicts on a certificate (OpenSSL, X509_V_ERR_…)."""


async def why_refused(endpoints: Sequence[str], identity: Identity) -> str:
    """The likeliest reason, in words; of the first endpoint that somebody listens at.

    ``endpoints`` are those of routers, which a session of ``identity`` could not be opened with.
    """
    if unix_s() > identity.not_after_s:
        return f"the own certificate expired on {shown_time(identity.not_after_s)}"
    reasons = []
    for endpoint in endpoints:
        there, reason = await accepts(endpoint, identity)
        if there:
            return reason or (
                f"the router at {endpoint} knows this mission and still refuses "
                f"{identity.common_name}: its keys are revoked, or the router's roster is too "
                "old or too new for them"
            )
        reasons.append(reason)
    return "; ".join(dict.fromkeys(reasons))


async def with_keys_only(endpoints: Sequence[str]) -> str:
    """Why a process without keys is not let in by the routers at ``endpoints``, in words; empty if
    it is not for that.
    """
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.check_hostname = False
    context.verify_mode = ssl.CERT_NONE  # who it is does not matter, and it is told nothing
    for endpoint in endpoints:
        if (match := _TCP_ENDPOINT.match(endpoint)) is None:
            continue
        try:
            async with asyncio.timeout(DIAL_S):
                _, writer = await asyncio.open_connection(
                    match[1].strip("[]"), int(match[2]), ssl=context, server_hostname=""
                )
        except OSError:  # of which TimeoutError is one, and ssl.SSLError
            continue
        writer.transport.abort()
        return (
            f"who listens at {endpoint} speaks encrypted, with those who have keys; "
            "give --keys DIR, which 'swarm keys' makes"
        )
    return ""


async def accepts(endpoint: str, identity: Identity) -> tuple[bool, str]:
    """Whether somebody listens at ``endpoint``, and what is wrong with the handshake.

    The latter is empty where nothing is, or nothing can be told.
    """
    match = _TLS_ENDPOINT.match(endpoint)
    if match is None:
        return False, f"no session with {endpoint}: is a router running there?"
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.check_hostname = False
    try:
        context.load_verify_locations(identity.authority_path)
        context.load_cert_chain(identity.certificate_path, identity.private_key_path)
    except OSError:  # of which ssl.SSLError is one
        return True, f"the keys in {identity.folder} cannot be read any more"
    try:
        async with asyncio.timeout(DIAL_S):
            reader, writer = await asyncio.open_connection(
                match[1].strip("[]"), int(match[2]), ssl=context, server_hostname=""
            )
    except TimeoutError:
        return False, f"{endpoint} does not answer"
    except ssl.SSLCertVerificationError as fault:
        return True, _their_fault(endpoint, fault)
    except ssl.SSLError as fault:
        return True, _alert(endpoint, fault)
    except OSError as fault:
        if isinstance(fault, ConnectionRefusedError):
            return False, f"nobody listens at {endpoint}"
        if fault.errno is None:  # the handshake was cut off, which has no words
            return True, _no_tls(endpoint)
        return False, f"{endpoint} cannot be reached: {fault.strerror or fault}"
    try:
        async with asyncio.timeout(ALERT_S):
            await reader.read(1)
    except TimeoutError:
        return True, ""
    except ssl.SSLError as fault:
        return True, _alert(endpoint, fault)
    except OSError:
        return True, f"{endpoint} hangs up"
    finally:
        writer.close()
        with contextlib.suppress(OSError):
            await writer.wait_closed()
    return True, ""


def _their_fault(endpoint: str, fault: ssl.SSLCertVerificationError) -> str:
    if fault.verify_code == _EXPIRED:
        clock = f"this machine's clock, which says {shown_time(unix_s())}, is wrong"
        return f"the certificate of the router at {endpoint} has expired, or {clock}"
    if fault.verify_code == _NOT_YET_VALID:
        clock = f"set this machine's clock, which says {shown_time(unix_s())}"
        return f"the certificate of the router at {endpoint} is not valid yet: {clock}"
    return (
        f"who listens at {endpoint} is no router of this mission: our authority did not make its "
        "keys; give each machine a folder that the same 'swarm keys init' made"
    )


def _alert(endpoint: str, fault: ssl.SSLError) -> str:
    words = str(fault).upper()
    if "EXPIRED" in words:
        return f"the router at {endpoint} takes our certificate for expired: compare the clocks"
    if "WRONG_VERSION_NUMBER" in words or "RECORD_LAYER" in words:
        return _no_tls(endpoint)
    return f"the router at {endpoint} is another mission's: it does not know our authority"


def _no_tls(endpoint: str) -> str:
    return f"who listens at {endpoint} speaks no TLS; start the router there with --keys, too"
