"""Whose commands and clocks count in the secure set-up: those of listed members with a valid certificate."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

from cryptography.hazmat.primitives.serialization import load_pem_private_key

from holozen import authority
from holozen.testing import wait_for
from holozen.transport.members import KEY, Member, Verifier

SENT = ("cmd_vel", "DATA", b"Ann/test@123456;1;2;3", "application/json", b"{}")
NONCE = b"0123456789abcdef"


def test_a_proof_counts_by_the_key_in_the_list_until_it_expires_or_is_revoked(tmp_path: Path) -> None:
    root, keys = tmp_path / "root", dict[str, Any]()
    authority.initialize(root, [], 1)
    for name, days in (("Ann", 1), ("Bob", 1), ("Old", 0)):
        authority.add(root, "operator", name, days)
        keys[name] = load_pem_private_key((root / name / KEY).read_bytes(), None)
    verifier = Verifier(str(root))

    def refusal(name: str, signer: str) -> str:
        key, priority, stamp, encoding, payload = SENT
        proof = Member(name, keys[signer]).attachment(*SENT)
        sample: Any = SimpleNamespace(
            key=key, priority=priority, stamp=stamp, encoding=encoding, payload=payload, attachment=proof,
            source=f"{name}/test@123456",
        )  # fmt: skip
        return verifier.refusal(sample)

    def answerer(name: str, signer: str, nonce: bytes = NONCE) -> str:
        return verifier.answerer("session", NONCE, Member(name, keys[signer]).answer("session", nonce, "1"))

    assert (refusal("Ann", "Ann"), answerer("Ann", "Ann")) == ("", "Ann")
    assert (refusal("Ann", "Bob"), answerer("Ann", "Bob")) == ("unproven: it is not signed by 'Ann'", "")
    assert (refusal("Old", "Old"), answerer("Old", "Old")) == ("unproven: the certificate of 'Old' has expired", "")
    assert answerer("Ann", "Ann", nonce=b"earlier") == ""
    authority.revoke(root, "Ann")
    wait_for(lambda: refusal("Ann", "Ann") == "unproven: 'Ann' may not command")
    assert (refusal("Bob", "Bob"), answerer("Ann", "Ann")) == ("", "")
