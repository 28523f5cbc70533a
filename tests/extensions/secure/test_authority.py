"""The certificates of an authority."""

import ssl
from contextlib import suppress
from pathlib import Path

from holozen.secure import authority
from holozen.secure.members import AUTHORITY, CERTIFICATE, KEY
from holozen.secure.roles import ROUTER


def test_a_strict_reader_of_certificates_accepts_the_router(tmp_path: Path) -> None:
    """Such as Python 3.13, by default."""
    authority.initialize(tmp_path / "net", ["robot.lan"], 1)
    folder = tmp_path / "net" / ROUTER
    serves = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    serves.load_cert_chain(folder / CERTIFICATE, folder / KEY)
    asks = ssl.create_default_context(cafile=folder / AUTHORITY)
    asks.verify_flags |= ssl.VERIFY_X509_STRICT
    there, back = ssl.MemoryBIO(), ssl.MemoryBIO()
    router = serves.wrap_bio(there, back, server_side=True)
    client = asks.wrap_bio(back, there, server_hostname="robot.lan")
    for side in (client, router, client):
        with suppress(ssl.SSLWantReadError):
            side.do_handshake()
    subject = client.getpeercert()["subject"]  # type: ignore[index]
    assert subject == ((("commonName", ROUTER),),)
