"""Whose commands count in the secure set-up: those of listed members with a valid certificate."""

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from cryptography.hazmat.primitives.serialization import load_pem_private_key

from holozen.secure import authority
from holozen.secure.members import (
    AUTHORITY,
    CERTIFICATE,
    KEY,
    MEMBERS,
    Member,
    Verifier,
    load,
    read_members,
)
from holozen.testing import wait_for
from holozen.transport.errors import BusError

SENT = ("cmd_vel", "DATA", b"Ann/test@123456;1;ab:3", "application/json", b"{}")


def test_a_proof_counts_by_the_key_in_the_list_until_it_expires_or_is_revoked(
    tmp_path: Path,
) -> None:
    root, keys = tmp_path / "root", dict[str, Any]()
    authority.initialize(root, [], 1)
    for name, days in (("Ann", 1), ("Bob", 1), ("Old", 0)):
        authority.add(root, "operator", name, days)
        keys[name] = load_pem_private_key((root / name / KEY).read_bytes(), None)
    verifier = Verifier(str(root))

    def refusal(name: str, signer: str, echo: bytes = b"ab:3") -> str:
        key, priority, stamp, encoding, payload = SENT
        proof = Member(name, keys[signer]).attachment(*SENT).replace(b"ab:3", echo)
        sample: Any = SimpleNamespace(
            key=key,
            priority=priority,
            stamp=stamp,
            encoding=encoding,
            payload=payload,
            attachment=proof,
            source=f"{name}/test@123456",
        )
        return verifier.refusal(sample)

    assert refusal("Ann", "Ann") == ""
    assert (
        refusal("Ann", "Bob")
        == refusal("Ann", "Ann", b"ab:9")
        == "unproven: it is not signed by 'Ann'"
    )
    assert refusal("Old", "Old") == "unproven: the certificate of 'Old' has expired"
    authority.revoke(root, "Ann")
    wait_for(lambda: refusal("Ann", "Ann").startswith("unproven: 'Ann' may not command"))
    assert refusal("Bob", "Bob") == ""


def test_what_others_may_change_is_refused_with_the_command_that_mends_it(tmp_path: Path) -> None:
    root = tmp_path / "my root"
    authority.initialize(root, [], 1)
    sim = root / "sim"
    for path in (root, sim, sim / AUTHORITY, sim / CERTIFICATE, sim / MEMBERS):
        use: Callable[[str], object] = read_members if path.name == MEMBERS else load
        mode = path.stat().st_mode & 0o777
        for wider in (0o020, 0o002):
            path.chmod(mode | wider)
            with pytest.raises(BusError) as error:
                use(str(sim))
            assert str(error.value).startswith(
                f"{path}: other users may change it; `chmod go-w '{path}'`"
            )
        path.chmod(mode)
        use(str(sim))
    (root / MEMBERS).chmod(0o666)
    with pytest.raises(authority.AuthorityError, match="other users may change it"):
        authority.add(root, "operator", "Ann", 1)
