"""Zenoh's flags become settings; without any, nothing leaves the machine."""

import argparse
import json
import os
from typing import Any

import pytest
import zenoh
from hypothesis import given
from hypothesis import strategies as st

from holozen.transport.connection import (
    LAST_DOMAIN,
    LEASE,
    LOOPBACK,
    NEAR_LEASE,
    Connection,
    add_arguments,
    from_arguments,
    from_environment,
)
from holozen.transport.errors import BusError

RENDEZVOUS = ("tcp/127.0.0.1:7447", "tcp/127.0.0.1:7448", "tcp/127.0.0.1:7449")

endpoints = st.none() | st.lists(
    st.sampled_from(
        ["tcp/127.0.0.1:7447", "tcp/10.0.0.2:1", "udp/[::1]:9", "unixsock-stream//tmp/x"]
    ),
    min_size=1,
).map(tuple)
connections = st.builds(
    Connection,
    mode=st.sampled_from(["peer", "client", "router"]),
    connect=endpoints,
    listen=endpoints,
    config=st.none() | st.just("zenoh.json5"),
    cfg=st.lists(st.tuples(st.sampled_from(["transport/link/tx/lease", "mode"]), st.text())).map(
        tuple
    ),
    wire=st.sampled_from(["json", "cdr"]),
    private=st.just(""),
    secure=st.just(""),
    domain=st.just(0),
)


def parsed(*words: str) -> Connection:
    parser = argparse.ArgumentParser()
    add_arguments(parser)
    return from_arguments(parser.parse_args(words))


def value(connection: Connection, path: str) -> object:
    return json.loads(connection.settings()[path])


def test_no_flags_are_the_default_connection() -> None:
    assert parsed() == Connection()


@given(connections)
def test_the_arguments_of_a_connection_make_the_same_connection(connection: Connection) -> None:
    assert parsed(*connection.arguments()) == connection


@pytest.mark.parametrize("mode", ["peer", "client", "router"])
def test_by_default_every_endpoint_and_the_scouting_is_on_loopback(mode: str) -> None:
    connection = Connection(mode)
    listen, connect = value(connection, "listen/endpoints"), value(connection, "connect/endpoints")
    assert isinstance(listen, list)
    assert isinstance(connect, list)
    assert listen + connect
    assert all(endpoint.startswith("tcp/127.0.0.1:") for endpoint in listen + connect)
    assert value(connection, "scouting/multicast/enabled") is False
    if mode != "client":
        multicast = json.loads(connection.settings()["scouting/multicast"])
        assert (multicast["interface"], multicast["address"]) == ("127.0.0.1", "224.0.0.224:7447")


def test_a_peer_listens_at_a_port_of_its_own_and_where_it_is_told_to() -> None:
    assert value(Connection(), "listen/endpoints") == [LOOPBACK]
    assert value(Connection(), "connect/endpoints") == []
    given = Connection(listen=("tcp/10.0.0.1:7",), connect=("tcp/10.0.0.2:8",))
    assert value(given, "listen/endpoints") == ["tcp/10.0.0.1:7", LOOPBACK]
    assert value(given, "connect/endpoints") == ["tcp/10.0.0.2:8"]


def test_a_client_listens_nowhere() -> None:
    assert value(Connection("client"), "listen/endpoints") == []
    assert value(Connection("client"), "connect/endpoints") == [RENDEZVOUS[0]]


def test_a_router_only_listens() -> None:
    assert value(Connection("router"), "listen/endpoints") == [RENDEZVOUS[0]]
    assert value(Connection("router"), "connect/endpoints") == []


def test_links_are_retried_for_ever_and_given_up_after_a_while_of_silence() -> None:
    assert value(Connection(), "connect/timeout_ms") == -1
    assert value(Connection(), "connect/exit_on_failure") is False
    assert value(Connection(), "scouting/delay") == 0
    for near in (Connection(), Connection("client"), Connection("router")):
        assert value(near, "transport/link/tx/lease") == NEAR_LEASE > 3 * LEASE
    for mode in ("peer", "router"):
        assert (
            value(Connection(mode, listen=("tcp/0.0.0.0:7447",)), "transport/link/tx/lease")
            == LEASE
        )
    for mode in ("peer", "client"):
        assert (
            value(Connection(mode, connect=("tcp/10.0.0.1:7447",)), "transport/link/tx/lease")
            == LEASE
        )


def test_a_setting_by_hand_comes_last_and_wins() -> None:
    settings = parsed("--cfg", "transport/link/tx/lease:2000", "--cfg", "mode:'client'").settings()
    assert settings["transport/link/tx/lease"] == "2000"
    assert settings["mode"] == "'client'"


def test_a_value_may_hold_colons() -> None:
    assert parsed("--cfg", "a/b:tcp/h:1").cfg == (("a/b", "tcp/h:1"),)


@pytest.mark.parametrize("text", ["", "lease", ":2000"])
def test_a_setting_that_is_no_pair_is_wrong_usage(
    text: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as end:
        parsed("--cfg", text)
    assert end.value.code == 2
    assert f"{text!r}: write PATH:VALUE" in capsys.readouterr().err


# else large payloads are corrupted on a busy machine
INTACT = {"transport/shared_memory/enabled": "false"}
TRIES = {"connect/timeout_ms": "10000", "connect/exit_on_failure": "true"}  # of a client


def test_a_configuration_file_decides_what_no_flag_names() -> None:
    assert Connection(config="zenoh.json5").settings() == INTACT
    given = Connection("client", config="zenoh.json5", connect=("tcp/h:1",), cfg=(("a", "1"),))
    assert given.settings() == {
        "mode": '"client"',
        "connect/endpoints": '["tcp/h:1"]',
        "a": "1",
        **TRIES,
        **INTACT,
    }


def test_a_process_is_in_a_group_unless_it_is_told_whom_to_meet() -> None:
    one, two, far = "tcp/127.0.0.1:9", "tcp/127.0.0.1:10", "tcp/10.0.0.2:7447"
    for connection, group in [
        (Connection(), 7447),
        (Connection("router"), 7447),
        (Connection(listen=(one,)), 7447),
        (Connection(listen=("tcp/0.0.0.0:7447",)), 7447),
        (Connection(listen=(one, two), connect=(two,)), 10),
        (Connection(connect=(one,)), 0),
        (Connection(connect=(far,)), 7447),
        (Connection(connect=(far, one)), 0),
        (Connection(connect=(far,), listen=(far,)), 0),
        (Connection("client"), 0),
        (Connection(config="zenoh.json5"), 0),
        (Connection(private="/run/me"), 0),
        (Connection("router", secure="/run/me/router"), 0),
    ]:
        assert connection.group == group, connection
        assert Connection.settings(connection._replace(secure=""))  # never an error
    given = Connection(listen=(one, two), connect=(far, two))
    assert value(given, "connect/endpoints") == [far], (
        "who listens at the point of its own is in the group"
    )
    assert value(given, "listen/endpoints") == [one, two, LOOPBACK]
    for member in (Connection(), Connection("router")):
        assert value(member, "scouting/gossip/autoconnect") == {"router": [], "peer": []}
    assert "scouting/gossip/autoconnect" not in Connection(connect=(far,)).settings()


@pytest.mark.parametrize("mode", ["peer", "client", "router"])
def test_zenoh_takes_every_setting(mode: str) -> None:
    config = zenoh.Config()
    for path, text in Connection(mode).settings().items():
        config.insert_json5(path, text)


def test_variables_set_what_flags_set_and_a_flag_wins(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOLOZEN_MODE", "client")
    monkeypatch.setenv("HOLOZEN_CONNECT", "tcp/10.0.0.2:7447, tcp/10.0.0.3:7447")
    monkeypatch.setenv("HOLOZEN_LISTEN", "")  # as compose passes one on that is not set
    reported = Connection("client", ("tcp/10.0.0.2:7447", "tcp/10.0.0.3:7447"))
    assert parsed() == from_environment() == reported
    assert parsed("--mode", "peer", "--connect", "tcp/h:1") == Connection("peer", ("tcp/h:1",))
    assert parsed(*Connection().arguments()).mode == "peer", "a child gets its parent's mode"


def test_each_domain_has_a_group_and_an_address_of_its_own() -> None:
    every = [Connection(domain=domain) for domain in range(LAST_DOMAIN + 1)]
    assert len({one.group for one in every}) == len({one.address for one in every}) == len(every)
    assert 7446 not in {one.group for one in every}, "that is of Zenoh's own scouting"
    assert Connection(domain=2).where == "tcp/127.0.0.1:7467 (domain 2)"
    assert Connection(connect=("tcp/h:1",), domain=2).where == "tcp/h:1"
    assert value(Connection("client", domain=2), "connect/endpoints") == ["tcp/127.0.0.1:7467"]
    assert len({Connection(domain=domain, private="/run/me").address for domain in (0, 1, 2)}) == 3


def test_the_flag_for_a_domain_wins_over_our_variable_and_that_over_the_one_of_ros(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", "3")
    assert parsed().domain == from_environment().domain == 3
    monkeypatch.setenv("HOLOZEN_DOMAIN", "4")
    assert parsed().domain == 4
    assert parsed("--domain", "0").domain == parsed(*Connection().arguments()).domain == 0


@pytest.mark.parametrize("wrong", ["233", "-1", "x", "1.5", "\u0661", "0000"])
def test_a_domain_is_a_number_from_0_to_232(wrong: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        parsed(f"--domain={wrong}")
    assert f"{wrong!r}: use a number from 0 to 232" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("variable", "value", "reason"),
    [
        ("HOLOZEN_DOMAIN", "lab", "='lab': use a number from 0 to 232, or unset it"),
        ("ROS_DOMAIN_ID", "999", "='999': use a number from 0 to 232, or unset it"),
        (
            "HOLOZEN_MODE",
            "klient",
            "='klient' (did you mean 'client'?); use peer, client, router, or unset it",
        ),
        ("HOLOZEN_CONNECT", "10.0.0.2", "'10.0.0.2' is not an endpoint: write PROTOCOL/HOST:PORT"),
        ("HOLOZEN_LISTEN", "tcp/a:1 tcp/b:2", "is not an endpoint: write PROTOCOL/HOST:PORT"),
        ("HOLOZEN_LISTEN", f"tcp/a:{'9' * 5000}", "has no port from 0 to 65535"),
        ("HOLOZEN_CONFIG", "/nowhere.json5", "='/nowhere.json5': there is no such file"),
    ],
)
def test_a_wrong_variable_is_one_line_that_names_it_unless_a_flag_wins(
    variable: str,
    value: str,
    reason: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setenv(variable, value)
    with pytest.raises(SystemExit) as end:
        parsed()
    message = capsys.readouterr().err
    assert (end.value.code, message.count("\n")) == (2, 1)
    assert message.startswith(f"holozen: {variable}=")
    assert reason in message
    flag = {"ROS_DOMAIN_ID": "--domain"}.get(
        variable, f"--{variable.removeprefix('HOLOZEN_').lower()}"
    )
    parsed(
        flag, {"--mode": "peer", "--config": "there.json5", "--domain": "5"}.get(flag, "tcp/h:1")
    )


def test_a_domain_that_an_endpoint_leaves_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    there = ("tcp/10.0.0.2:7447",)
    with pytest.raises(BusError, match="--domain 5 meets others at port 7497 of this machine"):
        from_environment(domain=5, connect=there)
    assert from_environment(domain=5, connect=("tcp/10.0.0.2:7497",)).domain == 5
    monkeypatch.setenv("ROS_DOMAIN_ID", "5")  # for ROS 2 alone, perhaps
    where = from_environment(connect=there)
    assert (where.connect, "--domain" in where.arguments()) == (there, False)


HOME, POINT = ", ".join(RENDEZVOUS), "tcp/127.0.0.1:9000"
NETWORKS: list[tuple[dict[str, Any], set[str]]] = [
    ({}, {HOME}),
    ({"listen": ("tcp/0.0.0.0:7447",)}, {HOME}),
    ({"connect": ("tcp/LocalHost:7448",), "listen": ()}, {HOME}),
    ({"mode": "client", "connect": ("tcp/[::1]:7447",)}, {HOME}),
    ({"mode": "router"}, {HOME}),
    *(
        ({"connect": (one,), "listen": (POINT,)}, {POINT})
        for one in (
            POINT,
            "tcp/localhost:9000",
            f"tcp/{os.uname().nodename}:9000",
            "tcp/[::ffff:127.0.0.1]:9000",
            "tcp/[::1]:9000",
            "tcp/127.0.0.1:09000",
            "tcp/127.0.0.1:9000#so_sndbuf=65000",
        )
    ),
    ({"connect": (POINT,), "listen": ("tcp/127.0.0.1:0",)}, {POINT}),
    ({"connect": ("tcp/127.0.0.1:1", POINT), "listen": (POINT,)}, {POINT, "tcp/127.0.0.1:1"}),
    ({"listen": ("tcp/[::]:9000",)}, {POINT, HOME}),  # it is in the group, too
    ({"connect": (POINT,)}, {POINT}),
    ({"connect": ("tcp/Robot:7447",), "mode": "client"}, {"tcp/robot:7447"}),
    (
        {"private": "/run/me"},
        {", ".join(f"unixsock-stream//run/me/{number}" for number in (1, 2, 3))},
    ),
    ({"secure": "/run/me/sim", "mode": "client"}, {"tls/127.0.0.1:7447"}),
    (
        {"secure": "/run/me/sim", "mode": "client", "connect": ("tls/localhost:7447",)},
        {"tls/127.0.0.1:7447"},
    ),
    ({"config": "/etc/../a.json5", "connect": (POINT,)}, {"the endpoints of /a.json5", POINT}),
    ({"connect": ("tcp/robot",), "mode": "client"}, {"tcp/robot"}),  # of no use, but no error here
    ({"connect": ("tcp/127.0.0.1:0",), "listen": ("tcp/127.0.0.1:0",)}, {"tcp/127.0.0.1:0"}),
]


def test_networks_are_known_by_their_endpoints_however_these_are_written() -> None:
    for flags, networks in NETWORKS:
        assert {*Connection(**flags).networks} == networks, flags


def test_a_domain_is_one_network_whose_name_stays_as_it_is() -> None:
    """Files of software stops are in a folder of that name."""
    for domain in (1, 232):
        (network,) = Connection(domain=domain).networks
        assert network == ", ".join(
            f"tcp/127.0.0.1:{7447 + 10 * domain + number}" for number in range(3)
        )
        for point in network.split(", "):
            assert Connection(connect=(point,), listen=(point,)).networks == (network,)
    assert len({Connection(domain=domain).networks for domain in range(233)}) == 233
