"""Who needs a token to open the page, and which ones there are."""

import socket
from types import SimpleNamespace

import pytest

from holozen.cli import up
from holozen.transport.connection import Connection
from holozen.view.__main__ import main, parser, random_token

OPEN, PRIVATE, SECURE = (
    Connection(),
    Connection(private="/run/user/1/holozen"),
    Connection(secure="/members/operator"),
)


def test_a_page_has_a_token_where_more_people_reach_it_than_the_robots() -> None:
    for host in ("127.0.0.1", "127.0.0.2", "localhost", "::1"):
        assert random_token(host, OPEN) == ""
        assert random_token(host, PRIVATE) and random_token(host, SECURE)
    for host in ("0.0.0.0", "::", "127.example.org", "10.0.0.2"):
        assert random_token(host, OPEN)


def test_without_a_token_no_page_is_promised_that_would_be_refused(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(["--host", "192.0.2.1", "--token", "none"]) == 2
    assert "without a token a page opens only at 127.0.0.1" in capsys.readouterr().err


def test_a_token_needs_no_quoting(capsys: pytest.CaptureFixture[str]) -> None:
    assert parser().parse_args(["--token", "a-B.9_~"]).token == "a-B.9_~"
    for wrong in ("a&b", "a;b", "a b", "ä", "a%41", ""):
        with pytest.raises(SystemExit):
            parser().parse_args([f"--token={wrong}"])
        assert f"{wrong!r}: use letters, digits and any of . _ ~ -" in capsys.readouterr().err


def test_only_a_taken_port_is_a_reason_for_another(capsys: pytest.CaptureFixture[str]) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        assert main(["--port", str(port)]) == 1
        assert capsys.readouterr().err.endswith(
            "Address already in use; --port 0 takes a free one\n"
        )
    assert main(["--host", "192.0.2.1"]) == 1
    assert capsys.readouterr().err.endswith("port 8080: Cannot assign requested address\n")


def test_up_starts_no_page_whose_token_the_teleop_would_hide(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sys.stdin", SimpleNamespace(isatty=lambda: True))
    monkeypatch.setattr("sys.stdout", SimpleNamespace(isatty=lambda: True))
    monkeypatch.setattr(up, "Team", lambda *_: pytest.fail("it starts"))
    with pytest.raises(SystemExit):
        up.VERBS["up"].main(["--view", "--private"])
    assert "run `holozen view` in another terminal" in capsys.readouterr().err
