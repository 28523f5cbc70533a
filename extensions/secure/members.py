"""The secure set-up as a member sees it: its folder, the proof of its commands, and the sim's list
of members.

A command's attachment ends with a signature (Ed25519, by the key of the sender's certificate) of
its key, priority, stamp, encoding and payload. The router's access control cannot replace it: it
knows no priorities, and a receiver of a command from the router does not see its sender's
certificate.
"""

import contextlib
import datetime
import json
import math
import os
import shlex
import stat
import time
from pathlib import Path
from typing import NamedTuple

from cryptography import x509
from cryptography.exceptions import InvalidSignature
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey, Ed25519PublicKey
from cryptography.hazmat.primitives.serialization import load_pem_private_key

from holozen.secure.roles import ROLES
from holozen.transport.errors import BusError
from holozen.transport.samples import PRIORITIES, Sample

AUTHORITY, CERTIFICATE, KEY, MEMBERS = "ca.pem", "cert.pem", "key.pem", "members.json"
PAGE_CERTIFICATE, PAGE_KEY = "page.pem", "page.key"  # for browsers
LOOK = 0.5  # s between two checks for a new list
SIGNATURE = 128  # hexadecimal digits
RENEWAL = 30 * 86_400  # s before its end from which a certificate should be renewed


class Member(NamedTuple):
    """The member whose certificate and key a folder holds. The certificate `expires` then (s, Unix
    time).
    """

    name: str
    key: Ed25519PrivateKey
    expires: float = math.inf

    def warning(self) -> str:
        """A warning of a certificate that expires soon; else empty."""
        return _warning(self.name, self.expires)

    def attachment(
        self, key: str, priority: str, stamp: bytes, encoding: str, payload: bytes
    ) -> bytes:
        """The stamp and the proof that this member sent it."""
        return b"%s;%s" % (
            stamp,
            self.key.sign(_signed(key, priority, stamp, encoding, payload)).hex().encode(),
        )


def load(folder: str) -> Member:
    """The member of a folder. Raises BusError if a file is missing, expired, another authority's,
    or open to others.
    """
    path = Path(folder)
    try:
        # who may change that replaces the folder
        root = [path.parent] if (path.parent / AUTHORITY).exists() else []
        for one in (*root, path, path / AUTHORITY, path / CERTIFICATE, path / KEY):
            check_unchanged(one)
        authority = x509.load_pem_x509_certificate((path / AUTHORITY).read_bytes())
        certificate = x509.load_pem_x509_certificate((path / CERTIFICATE).read_bytes())
        if (path / KEY).stat().st_mode & 0o077:
            mend = f"`chmod 600 {shlex.quote(str(path / KEY))}`"
            raise BusError(
                f"{path / KEY}: other users may read it; {mend}, and if any did, revoke it"
            )
        key = load_pem_private_key((path / KEY).read_bytes(), None)
    except OSError as error:
        raise BusError(
            f"{error.filename}: {error.strerror}; `holozen secure init` makes certificates"
        ) from None
    except (ValueError, TypeError):
        raise BusError(f"{path}: {AUTHORITY}, {CERTIFICATE} or {KEY} is not a PEM file") from None
    if not isinstance(key, Ed25519PrivateKey) or key.public_key() != certificate.public_key():
        raise BusError(f"{path / KEY}: it is not the key of {CERTIFICATE}")
    try:
        certificate.verify_directly_issued_by(authority)
    except (ValueError, TypeError, InvalidSignature):
        raise BusError(
            f"{path / CERTIFICATE}: it was not issued by the authority {AUTHORITY}"
        ) from None
    names = certificate.subject.get_attributes_for_oid(x509.NameOID.COMMON_NAME)
    name = str(names[0].value) if names else ""
    end = certificate.not_valid_after_utc
    if end < datetime.datetime.now(datetime.UTC):
        expired = f"the certificate of {name} expired on {end:%Y-%m-%d}"
        raise BusError(f"{path / CERTIFICATE}: {expired}; `holozen secure renew` issues a new one")
    return Member(name, key, end.timestamp())


def check_unchanged(path: Path) -> None:
    """Raise BusError if users besides its owner may change a file or replace what is in a folder,
    and OSError if it is not there.
    """
    mode = path.stat().st_mode
    # there, each replaces only what is their own
    if mode & 0o022 and not (stat.S_ISDIR(mode) and mode & stat.S_ISVTX):
        mend = f"`chmod go-w {shlex.quote(str(path))}`"
        raise BusError(
            f"{path}: other users may change it; {mend}, and if any did, make new certificates"
        )


def read_members(folder: str) -> dict[str, dict[str, str]]:
    """Name -> {"role": ..., "key": public key in hex, "expires": ISO 8601, UTC} of the members.
    Raises BusError.
    """
    path = Path(folder) / MEMBERS
    try:
        check_unchanged(path)
        rows = json.loads(path.read_bytes())["members"]
        return {
            name: {key: str(row[key]) for key in ("role", "key", "expires")}
            for name, row in rows.items()
        }
    except OSError as error:
        raise BusError(
            f"{path}: {error.strerror}; only the folders of a router, a sim or an autopilot have it"
        ) from None
    except (ValueError, TypeError, KeyError, AttributeError):
        raise BusError(f"{path}: it is not a list of members; `holozen secure` writes it") from None


def warnings(folder: str) -> list[str]:
    """Warnings of certificates that expire soon or have expired: that of the member of a folder,
    and, where that is within an authority's, those of all its members. Raises BusError as `load`.
    """
    member, ends = load(folder), {}
    with contextlib.suppress(BusError, ValueError):
        rows = read_members(str(Path(folder).parent))
        ends = {
            name: datetime.datetime.fromisoformat(row["expires"]).timestamp()
            for name, row in rows.items()
        }
    return [
        *filter(None, (_warning(*each) for each in (ends | {member.name: member.expires}).items()))
    ]


def _warning(name: str, end: float) -> str:
    """A warning that the certificate of a member expires soon or has expired, at `end` (s, Unix
    time); else empty.
    """
    if end > (now := time.time()) + RENEWAL:
        return ""
    expires = "expires" if end > now else "expired"
    date = datetime.datetime.fromtimestamp(end, datetime.UTC)
    certificate = f"the certificate of {name} {expires} on {date:%Y-%m-%d %H:%M} UTC"
    return f"{certificate}; `holozen secure renew` issues a new one"


def version(folder: str) -> tuple[int, int]:
    """Identifies the list of members in a folder: it changes whenever the list does. Raises
    OSError.
    """
    found = os.stat(Path(folder) / MEMBERS)
    return found.st_mtime_ns, found.st_ino


class Verifier:
    """Checks the proofs of commands by the list in a folder, which it reads again when it changes.

    A list that cannot be read has no members.
    """

    def __init__(self, folder: str) -> None:
        self._folder, self._looked, self._seen = folder, -LOOK, (0, 0)
        self._known: dict[str, tuple[int, float, Ed25519PublicKey]] = {}
        self.list_error = ""

    def refusal(self, sample: Sample) -> str:
        """Why the proof of a command is refused; empty if its sender proved the name and may use
        the priority.
        """
        self._refresh(time.monotonic())
        stamp, _, proof = sample.attachment.rpartition(b";")
        name = sample.source.partition("/")[0]
        if self.list_error:
            return f"unproven: {self.list_error}"
        if len(proof) != SIGNATURE or sample.stamp is None:
            return "unproven: it is not signed; start its sender with --secure"
        if name not in self._known:
            return f"unproven: {name!r} may not command; `holozen secure show` lists who may"
        top, end, key = self._known[name]
        if PRIORITIES.index(sample.priority) < top:
            return (
                f"unproven: {name!r} may command at {PRIORITIES[top]} and below, not at "
                f"{sample.priority}"
            )
        if time.time() > end:
            return f"unproven: the certificate of {name!r} has expired"
        try:  # last, since it takes 0.1 ms
            signed = _signed(sample.key, sample.priority, stamp, sample.encoding, sample.payload)
            key.verify(bytes.fromhex(proof.decode()), signed)
        except (ValueError, InvalidSignature):
            return f"unproven: it is not signed by {name!r}"
        return ""

    def _refresh(self, now: float) -> None:
        if now - self._looked < LOOK:
            return
        self._looked = now
        try:
            if (seen := version(self._folder)) == self._seen:
                return
            self._known = _commanders(read_members(self._folder))
            self._seen, self.list_error = seen, ""
        except (BusError, OSError, ValueError) as error:
            self._known, self._seen, self.list_error = {}, (0, 0), str(error)


def _commanders(
    members: dict[str, dict[str, str]],
) -> dict[str, tuple[int, float, Ed25519PublicKey]]:
    """Name -> the index of its top priority, when its certificate ends (s, Unix time), its key.
    Raises ValueError.
    """
    return {
        name: (
            PRIORITIES.index(ROLES[row["role"]].top),
            datetime.datetime.fromisoformat(row["expires"]).timestamp(),
            Ed25519PublicKey.from_public_bytes(bytes.fromhex(row["key"])),
        )
        for name, row in members.items()
        if row["role"] in ROLES and ROLES[row["role"]].top
    }


def _signed(key: str, priority: str, stamp: bytes, encoding: str, payload: bytes) -> bytes:
    """What is signed of a command."""
    return _joined(
        b"holozen command 1", key.encode(), priority.encode(), stamp, encoding.encode(), payload
    )


def _joined(*parts: bytes) -> bytes:
    """Each part begins with its length, so that no two messages give the same bytes."""
    return b"".join(len(part).to_bytes(8) + part for part in parts)
