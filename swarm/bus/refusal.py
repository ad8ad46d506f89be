"""Why no router lets a process in, with keys or without, which Zenoh does not tell.

Zenoh only knows that there is no link. A TLS handshake of our own with the same certificates,
or with none, tells more. Leaves out: QUIC, by which nothing can be told apart here.
"""

from __future__ import annotations

import asyncio
import contextlib
import re
import ssl
from collections.abc import Sequence

from swarm.clock import unix_s
from swarm.identity import Identity
from swarm.identity.folder import shown_time

__all__ = ["accepts", "why_refused", "with_keys_only"]

DIAL_S = 3.0
"""How long a connection may take [wall s]."""
ALERT_S = 1.0
"""How long an alert may take after a handshake that succeeded [wall s]."""
_TLS = re.compile(r"tls/(\[[^\]]+\]|[^:]+):(\d+)")
_TCP = re.compile(r"tcp/(\[[^\]]+\]|[^:]+):(\d+)")
_NOT_YET_VALID, _EXPIRED = 9, 10
"""Verdicts on a certificate (OpenSSL, X509_V_ERR_…)."""


async def why_refused(endpoints: Sequence[str], identity: Identity) -> str:
    """The likeliest reason, in words; of the first endpoint that somebody listens at.

    Args:
        endpoints: of routers, which a session could not be opened with.
        identity: of the session.
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
    """Why a process without keys is not let in, in words; empty if it is not for that.

    Args:
        endpoints: of routers, which a session could not be opened with.
    """
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.check_hostname = False
    context.verify_mode = ssl.CERT_NONE  # who it is does not matter, and it is told nothing
    for endpoint in endpoints:
        if (match := _TCP.match(endpoint)) is None:
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
    match = _TLS.match(endpoint)
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
