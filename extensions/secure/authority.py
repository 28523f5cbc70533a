"""The certificate authority of the secure set-up: a folder of yours, with a folder for each member
in it.

ROOT/ca.pem, ROOT/ca.key     the authority; `ca.key` stays where members are added ROOT/members.json
the members, and the names that were revoked ROOT/NAME/                   what that member needs, to
be copied to its machine: ca.pem, cert.pem, key.pem;
                             the router's, the sim's and an autopilot's have members.json too,
                             an operator's page.pem and page.key, if it serves a page
"""

import datetime
import ipaddress
import json
import os
import re
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from cryptography import x509
from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey, Ed25519PublicKey
from cryptography.hazmat.primitives.serialization import (
    Encoding,
    NoEncryption,
    PrivateFormat,
    PublicFormat,
    load_pem_private_key,
)
from cryptography.x509.oid import ExtendedKeyUsageOID

from holozen.console import Failure
from holozen.secure.members import (
    AUTHORITY,
    CERTIFICATE,
    KEY,
    MEMBERS,
    PAGE_CERTIFICATE,
    PAGE_KEY,
    check_unchanged,
)
from holozen.secure.roles import ROLES, ROUTER
from holozen.transport.errors import BusError

AUTHORITY_KEY = "ca.key"
# the roles that check others: their folders have the list of members
LISTED = (ROUTER, "sim", "autopilot")
AUTHORITY_DAYS = 3650
HERE = ("localhost", "127.0.0.1", "::1")
NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]{0,31}")
SIGNS_CERTIFICATES = x509.KeyUsage(
    digital_signature=False,
    content_commitment=False,
    key_encipherment=False,
    data_encipherment=False,
    key_agreement=False,
    key_cert_sign=True,
    crl_sign=True,
    encipher_only=False,
    decipher_only=False,
)
"""The use of the authority's key. It and the identifiers of keys are in the profile of RFC 5280,
sections 4.2.1.1 to 4.2.1.3, on which strict readers, such as Python 3.13, insist.
"""


class AuthorityError(Failure):
    """A request about the certificates that cannot be met. The text is one line."""


def initialize(root: Path, hosts: Sequence[str], days: float) -> None:
    """Make an authority, a router that is reached at `hosts` and at loopback, and a member of each
    role.
    """
    if (root / AUTHORITY).exists():
        raise AuthorityError(
            f"{root} has an authority already; `holozen secure show` lists its members"
        )
    root.mkdir(mode=0o700, parents=True, exist_ok=True)
    root.chmod(0o700)
    key = Ed25519PrivateKey.generate()
    builder = _builder(_name("holozen authority"), key.public_key(), AUTHORITY_DAYS)
    builder = builder.add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
    builder = builder.add_extension(SIGNS_CERTIFICATES, critical=True)
    _write_key(root / AUTHORITY_KEY, key)
    _write(
        root / AUTHORITY,
        builder.issuer_name(_name("holozen authority")).sign(key, None).public_bytes(Encoding.PEM),
    )
    _write_members(root, {"members": {}, "revoked": []})
    for name in (ROUTER, *ROLES):
        add(root, name, name, days, [*HERE, *hosts] if name == ROUTER else [])


def add(root: Path, role: str, name: str, days: float, hosts: Sequence[str] = ()) -> None:
    """Add a member. A name that was revoked cannot come back: its old certificate would be valid
    again.
    """
    table = members(root)
    if not NAME.fullmatch(name):
        raise AuthorityError(f"{name!r}: use a letter, then up to 31 letters, digits, '_' or '-'")
    if name in table["members"] or name in table["revoked"]:
        was = "was revoked" if name in table["revoked"] else "is a member already"
        raise AuthorityError(f"{name} {was}; choose another name")
    key = Ed25519PrivateKey.generate()
    certificate = _issue(root, name, key.public_key(), days, [_host(host) for host in hosts])
    folder = root / name
    folder.mkdir(mode=0o700, exist_ok=True)
    _write_key(folder / KEY, key)
    _write(folder / CERTIFICATE, certificate.public_bytes(Encoding.PEM))
    _write(folder / AUTHORITY, (root / AUTHORITY).read_bytes())
    table["members"][name] = {
        "role": role,
        "key": key.public_key().public_bytes(Encoding.Raw, PublicFormat.Raw).hex(),
        "expires": certificate.not_valid_after_utc.isoformat(),
    }
    _write_members(root, table)


def renew(root: Path, names: Sequence[str], days: float) -> None:
    """Issue new certificates, for the same keys, to these members, or to all if there are no
    `names`.
    """
    table = members(root)
    for name, row in {name: _member(table, name) for name in names or table["members"]}.items():
        file, hosts = root / name / CERTIFICATE, []
        if row["role"] == ROUTER:
            old = x509.load_pem_x509_certificate(file.read_bytes())
            hosts = list(old.extensions.get_extension_for_class(x509.SubjectAlternativeName).value)
        certificate = _issue(
            root, name, Ed25519PublicKey.from_public_bytes(bytes.fromhex(row["key"])), days, hosts
        )
        # it may have been moved to the member's machine
        file.parent.mkdir(mode=0o700, exist_ok=True)
        _write(file, certificate.public_bytes(Encoding.PEM))
        row["expires"] = certificate.not_valid_after_utc.isoformat()
    _write_members(root, table)


def revoke(root: Path, name: str) -> None:
    """Remove a member: the router allows it nothing, and the sim refuses its commands."""
    table = members(root)
    _member(table, name)
    del table["members"][name]
    table["revoked"].append(name)
    _write_members(root, table)
    shutil.rmtree(root / name, ignore_errors=True)


def certify_page(root: Path, name: str, hosts: Sequence[str], days: float) -> str:
    """Make a certificate for the page that a member serves at `hosts` and at loopback, and return
    its SHA-256 fingerprint as browsers show it.

    The authority does not sign it: browsers accept no Ed25519, the kind of its key.
    """
    _member(members(root), name)
    key = ec.generate_private_key(ec.SECP256R1())
    subject = _name(hosts[0] if hosts else HERE[0])
    names = x509.SubjectAlternativeName([_host(host) for host in (*hosts, *HERE)])
    builder = _builder(subject, key.public_key(), days).issuer_name(subject)
    builder = builder.add_extension(names, critical=False)
    builder = builder.add_extension(
        x509.ExtendedKeyUsage([ExtendedKeyUsageOID.SERVER_AUTH]), critical=True
    )
    certificate = builder.sign(key, hashes.SHA256())
    folder = root / name
    folder.mkdir(mode=0o700, exist_ok=True)
    _write_key(folder / PAGE_KEY, key)
    _write(folder / PAGE_CERTIFICATE, certificate.public_bytes(Encoding.PEM))
    return certificate.fingerprint(hashes.SHA256()).hex(":").upper()


def members(root: Path) -> dict[str, Any]:
    """The table of an authority: "members", name -> role, key, expires; and "revoked", the
    names.
    """
    try:
        check_unchanged(root)
        check_unchanged(root / MEMBERS)
        table: dict[str, Any] = json.loads((root / MEMBERS).read_bytes())
    except OSError as error:
        raise AuthorityError(
            f"{root / MEMBERS}: {error.strerror}; `holozen secure init` makes an authority"
        ) from None
    except BusError as error:
        raise AuthorityError(str(error)) from None
    except ValueError:
        raise AuthorityError(f"{root / MEMBERS}: it is not JSON") from None
    return table


def _member(table: dict[str, Any], name: str) -> dict[str, str]:
    """The row of a member."""
    row: dict[str, str] | None = table["members"].get(name)
    if row is None:
        raise AuthorityError(
            f"there is no member {name!r}; there are: {', '.join(table['members'])}"
        )
    return row


def _issue(
    root: Path, name: str, key: Ed25519PublicKey, days: float, hosts: Sequence[x509.GeneralName]
) -> x509.Certificate:
    try:
        authority = x509.load_pem_x509_certificate((root / AUTHORITY).read_bytes())
        signer = load_pem_private_key((root / AUTHORITY_KEY).read_bytes(), None)
    except OSError as error:
        raise AuthorityError(
            f"{error.filename}: {error.strerror}; members are added where {AUTHORITY_KEY} is"
        ) from None
    assert isinstance(signer, Ed25519PrivateKey)
    # Only the router's certificate is valid for a server: no member can pose as the router.
    use = ExtendedKeyUsageOID.SERVER_AUTH if hosts else ExtendedKeyUsageOID.CLIENT_AUTH
    builder = _builder(_name(name), key, days).issuer_name(authority.subject)
    builder = builder.add_extension(
        x509.BasicConstraints(ca=False, path_length=None), critical=True
    )
    builder = builder.add_extension(x509.ExtendedKeyUsage([use]), critical=True)
    issuer = x509.AuthorityKeyIdentifier.from_issuer_public_key(signer.public_key())
    builder = builder.add_extension(issuer, critical=False)
    names = hosts or [x509.DNSName(name)]
    return builder.add_extension(x509.SubjectAlternativeName(names), critical=False).sign(
        signer, None
    )


def _builder(
    subject: x509.Name, key: Ed25519PublicKey | ec.EllipticCurvePublicKey, days: float
) -> x509.CertificateBuilder:
    now = datetime.datetime.now(datetime.UTC).replace(microsecond=0)
    begin = now - datetime.timedelta(hours=1)  # for clocks that are slow
    builder = (
        x509.CertificateBuilder().subject_name(subject).public_key(key).not_valid_before(begin)
    )
    own = x509.SubjectKeyIdentifier.from_public_key(key)
    builder = builder.add_extension(own, critical=False)
    return builder.serial_number(x509.random_serial_number()).not_valid_after(
        now + datetime.timedelta(days=days)
    )


def _name(common: str) -> x509.Name:
    return x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, common)])


def _host(text: str) -> x509.GeneralName:
    try:
        return x509.IPAddress(ipaddress.ip_address(text))
    except ValueError:
        return x509.DNSName(text)


def _write_members(root: Path, table: dict[str, Any]) -> None:
    data = json.dumps(table, indent=1).encode()
    for folder in (
        root,
        *(root / name for name, row in table["members"].items() if row["role"] in LISTED),
    ):
        _write(folder / MEMBERS, data)


def _write_key(path: Path, key: Ed25519PrivateKey | ec.EllipticCurvePrivateKey) -> None:
    _write(path, key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption()))


def _write(path: Path, data: bytes) -> None:
    """Replace a file atomically, readable by its owner alone."""
    new = path.with_name(f"{path.name}.new")
    new.unlink(missing_ok=True)
    with os.fdopen(os.open(new, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb") as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())
    new.replace(path)
