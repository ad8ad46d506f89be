"""Certificates mean to OpenSSL what they shall mean: who is let in, and who can be dialled.

Both ends of a TLS connection in memory, by the standard library, which knows nothing of ours.
"""

from __future__ import annotations

import contextlib
import shutil
import ssl
from datetime import UTC, datetime
from pathlib import Path

import pytest
from cryptography import x509
from cryptography.x509.oid import ExtendedKeyUsageOID

from swarm.identity import Role
from swarm.identity.authority import open_authority
from swarm.identity.certificates import common_name_of, read_certificate
from swarm.identity.founding import found_authority
from swarm.runtime.clock import unix_s

NOW_S = unix_s()
DAY_S = 86_400.0


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("tls")
    authority = found_authority(folder / "keys", "table-1", ["uav1", "uav2"], now_s=NOW_S)
    found_authority(folder / "foreign", "table-1", ["uav1"], now_s=NOW_S)
    found_authority(folder / "mesh", "table-1", ["uav1", "uav2"], now_s=NOW_S, mesh=True)
    shutil.copytree(folder / "keys" / "uav2", folder / "revoked")
    authority.revoke(["uav2"])
    authority.issue({"expired": Role.UAV, "late-router": Role.ROUTER}, now_s=NOW_S - 91 * DAY_S)
    authority.issue({"early": Role.UAV}, now_s=NOW_S + 2 * DAY_S)
    return folder


def handshake(server: Path, client: Path | None, authority: Path | None = None) -> str:
    """Common name that the server learns of the client; empty of one without a certificate.

    Raises:
        ssl.SSLError: one of them refuses the other.
    """
    authority = authority or server
    sides = []
    for protocol, own in ((ssl.PROTOCOL_TLS_SERVER, server), (ssl.PROTOCOL_TLS_CLIENT, client)):
        context = ssl.SSLContext(protocol)
        context.check_hostname = False
        context.verify_mode = ssl.CERT_REQUIRED
        context.verify_flags |= ssl.VERIFY_X509_STRICT
        context.load_verify_locations((own or authority) / "authority.pem")
        if own is not None:
            context.load_cert_chain(own / "certificate.pem", own / "private.key")
        sides.append(context)
    to_server, to_client = ssl.MemoryBIO(), ssl.MemoryBIO()
    ends = [
        sides[0].wrap_bio(to_server, to_client, server_side=True),
        sides[1].wrap_bio(to_client, to_server),
    ]
    for _ in range(6):
        for end in reversed(ends):
            with contextlib.suppress(ssl.SSLWantReadError):
                end.do_handshake()
    certificate = ends[0].getpeercert(binary_form=True)
    assert certificate is not None
    return common_name_of(x509.load_der_x509_certificate(certificate))


def test_everyone_is_let_in_by_the_name_in_the_certificate(folder: Path) -> None:
    keys = folder / "keys"

    for name in ("uav1", "coordinator", "dashboard", "operator", "router"):
        assert handshake(keys / "router", keys / name) == f"{name}@1"


@pytest.mark.parametrize(
    ("client", "reason"),
    [
        ("foreign/uav1", "certificate signature failure|unable to get local issuer|verify failed"),
        ("keys/expired", "certificate has expired"),
        ("keys/early", "certificate is not yet valid"),
        (None, "peer did not return a certificate"),
    ],
)
def test_others_are_refused_by_tls_alone(folder: Path, client: str | None, reason: str) -> None:
    with pytest.raises(ssl.SSLError, match=reason):
        handshake(folder / "keys/router", None if client is None else folder / client)


@pytest.mark.parametrize("server", ["foreign/router", "keys/late-router"])
def test_a_client_goes_to_no_foreign_or_expired_router(folder: Path, server: str) -> None:
    with pytest.raises(ssl.SSLError, match="verify failed"):
        handshake(folder / server, folder / "keys/uav1")


def test_no_uav_can_pass_for_a_router(folder: Path) -> None:
    with pytest.raises(ssl.SSLError, match="unsuitable certificate purpose"):
        handshake(folder / "keys/uav1", folder / "keys/coordinator")


def test_in_a_mesh_everyone_can_be_dialled(folder: Path) -> None:
    mesh = folder / "mesh"

    assert handshake(mesh / "uav1", mesh / "uav2") == "uav2@1"
    assert handshake(mesh / "uav2", mesh / "coordinator") == "coordinator@1"


def test_tls_alone_lets_a_revoked_one_in_which_is_why_there_is_a_door_password(
    folder: Path,
) -> None:
    assert handshake(folder / "keys/router", folder / "revoked") == "uav2@1"
    assert open_authority(folder / "keys").roster.entry("uav2") is None


def test_a_long_id_that_no_host_could_have_makes_a_certificate(tmp_path: Path) -> None:
    name = "A_" + "b." * 27 + "-_"
    found_authority(tmp_path / "keys", "m", [name], now_s=NOW_S)

    assert handshake(tmp_path / "keys/router", tmp_path / "keys" / name) == f"{name}@1"


def test_a_certificate_begins_a_day_early_and_ends_when_it_was_told(folder: Path) -> None:
    certificate = read_certificate((folder / "keys/uav1/certificate.pem").read_bytes())
    usage = certificate.extensions.get_extension_for_class(x509.ExtendedKeyUsage).value

    assert certificate.not_valid_before_utc == datetime.fromtimestamp(int(NOW_S - DAY_S), UTC)
    assert certificate.not_valid_after_utc == datetime.fromtimestamp(int(NOW_S + 90 * DAY_S), UTC)
    assert list(usage) == [ExtendedKeyUsageOID.CLIENT_AUTH]
