"""Certificates of one mission: the authority's own, and those it issues.

All keys are Ed25519. Who may be dialled (a router, or everyone of a mesh) gets serverAuth
besides clientAuth, so that nobody else can pass for a router. Names of machines are not
certified: addresses change, and a mission's authority issues to nobody but the fleet.
"""

from __future__ import annotations

from datetime import UTC, datetime

from cryptography import x509
from cryptography.exceptions import InvalidSignature
from cryptography.hazmat.primitives import serialization
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey, Ed25519PublicKey
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

_AUTHORITY_NAME = "mission authority"


def authority_certificate(
    key: Ed25519PrivateKey, mission: str, *, not_before_s: int, not_after_s: int
) -> x509.Certificate:
    """The certificate in which the holder of ``key`` says to be the authority of ``mission``."""
    name = x509.Name(
        [
            x509.NameAttribute(NameOID.ORGANIZATION_NAME, mission),
            x509.NameAttribute(NameOID.COMMON_NAME, _AUTHORITY_NAME),
        ]
    )
    builder = _builder(name, name, key.public_key(), not_before_s, not_after_s)
    subject_id = x509.SubjectKeyIdentifier.from_public_key(key.public_key())
    return (
        builder.add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
        .add_extension(_key_usage(signs_certificates=True), critical=True)
        .add_extension(subject_id, critical=False)
        .sign(key, None)
    )


def issue_certificate(
    authority: x509.Certificate,
    authority_key: Ed25519PrivateKey,
    public_key: Ed25519PublicKey,
    common_name: str,
    *,
    not_before_s: int,
    not_after_s: int,
    server: bool,
) -> x509.Certificate:
    """A certificate of ``authority`` for the holder of ``public_key``.

    ``common_name`` is ``<name>@<generation>``, of at most 64 characters; ``server`` is whether
    others may dial it. Instants are in unix s.
    """
    name = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, common_name)])
    usages = [ExtendedKeyUsageOID.CLIENT_AUTH]
    if server:
        usages.append(ExtendedKeyUsageOID.SERVER_AUTH)
    # TLS libraries want a name of a host though none is looked at; this one exists nowhere.
    host = "".join(letter if letter.isalnum() else "-" for letter in common_name.lower())[-63:]
    host_names = x509.SubjectAlternativeName([x509.DNSName(f"{host.strip('-')}.invalid")])
    issuer_id = x509.AuthorityKeyIdentifier.from_issuer_public_key(authority_key.public_key())
    builder = _builder(name, authority.subject, public_key, not_before_s, not_after_s)
    return (
        builder.add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        .add_extension(_key_usage(signs_certificates=False), critical=True)
        .add_extension(x509.ExtendedKeyUsage(usages), critical=False)
        .add_extension(host_names, critical=False)
        .add_extension(issuer_id, critical=False)
        .sign(authority_key, None)
    )


def issued_by(certificate: x509.Certificate, authority: x509.Certificate) -> bool:
    """Whether ``authority`` has signed ``certificate``."""
    try:
        certificate.verify_directly_issued_by(authority)
    except (ValueError, TypeError, InvalidSignature):
        return False
    return True


def common_name_of(certificate: x509.Certificate) -> str:
    """Whom it names; empty if nobody."""
    names = certificate.subject.get_attributes_for_oid(NameOID.COMMON_NAME)
    return str(names[0].value) if names else ""


def public_bytes(holder: x509.Certificate | Ed25519PrivateKey) -> bytes:
    """The 32 bytes of an Ed25519 public key.

    Raises:
        ValueError: the certificate is for a key of another kind.
    """
    public_key = holder.public_key()
    if isinstance(public_key, Ed25519PublicKey):
        return public_key.public_bytes_raw()
    raise ValueError("it is for a key that is not Ed25519")


def certificate_pem(certificate: x509.Certificate) -> bytes:
    """As text that Zenoh and others read."""
    return certificate.public_bytes(serialization.Encoding.PEM)


def key_pem(key: Ed25519PrivateKey) -> bytes:
    """The private key as text (PKCS 8), not encrypted."""
    return key.private_bytes(
        serialization.Encoding.PEM,
        serialization.PrivateFormat.PKCS8,
        serialization.NoEncryption(),
    )


def read_certificate(data: bytes) -> x509.Certificate:
    """The certificate in ``data``; ValueError if there is none."""
    try:
        return x509.load_pem_x509_certificate(data)
    except ValueError:
        raise ValueError("it holds no certificate") from None


def read_key(data: bytes) -> Ed25519PrivateKey:
    """The private key in ``data``; ValueError if there is none, or one of another kind."""
    try:
        key = serialization.load_pem_private_key(data, None)
    except (ValueError, TypeError):  # the reason might quote the key
        raise ValueError("it holds no private key") from None
    if isinstance(key, Ed25519PrivateKey):
        return key
    raise ValueError("it holds a key that is not Ed25519")


def _builder(
    subject: x509.Name,
    issuer: x509.Name,
    public_key: Ed25519PublicKey,
    not_before_s: int,
    not_after_s: int,
) -> x509.CertificateBuilder:
    return (
        x509.CertificateBuilder()
        .subject_name(subject)
        .issuer_name(issuer)
        .public_key(public_key)
        .serial_number(x509.random_serial_number())
        .not_valid_before(datetime.fromtimestamp(not_before_s, UTC))
        .not_valid_after(datetime.fromtimestamp(not_after_s, UTC))
    )


def _key_usage(*, signs_certificates: bool) -> x509.KeyUsage:
    return x509.KeyUsage(
        digital_signature=not signs_certificates,
        content_commitment=False,
        key_encipherment=False,
        data_encipherment=False,
        key_agreement=False,
        key_cert_sign=signs_certificates,
        crl_sign=signs_certificates,
        encipher_only=False,
        decipher_only=False,
    )
