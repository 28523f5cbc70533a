"""A port beyond loopback is reported at the start and by the doctor."""

import json
from pathlib import Path

import pytest

from holozen.testing import wait_for
from holozen.testing.wire import command

from .namespaces import NEEDS, Host, Lab

pytestmark = NEEDS

ASKS = "asks for no password or certificate"
RISK = f"and {ASKS}: whoever can reach it can drive, stop and delete robots, and set parameters"


@pytest.fixture
def host(lab: Lab) -> Host:
    return lab.host("robot")


def found_by_the_doctor(host: Host) -> list[dict[str, str]]:
    rows = map(json.loads, host.run(*command("doctor", "--json")).stdout.splitlines())
    return [row for row in rows if row["check"] == "network"]


def test_a_sim_that_listens_beyond_loopback_warns_and_the_doctor_finds_it(host: Host) -> None:
    sim = host.start(*command("sim", "--listen", "tcp/[::]:7447"))
    warning = f"listens at tcp/[::]:7447, {RISK}"
    assert sim.wait_for_line(ASKS) == f"sim: {warning}"
    sim.wait_for_line("listens on cmd_vel")
    (row,) = wait_for(lambda: found_by_the_doctor(host))  # a busy sim may answer late
    assert row["level"] == "warning"
    assert warning in row["text"]


@pytest.mark.parametrize("flags", [(), ("--listen", "tcp/localhost:7447")], ids=" ".join)
def test_a_sim_on_loopback_prints_no_network_warning(host: Host, flags: tuple[str, ...]) -> None:
    sim = host.start(*command("sim", *flags))
    sim.wait_for_line("listens on cmd_vel")
    assert "network" not in sim.err and ASKS not in sim.err
    if "tcp/localhost:7447" in flags:  # which is looked up
        assert found_by_the_doctor(host) == []


@pytest.mark.parametrize("way", ["config", "cfg"])
def test_a_router_reports_where_a_configuration_has_it_listen(
    host: Host, tmp_path: Path, way: str
) -> None:
    path = tmp_path / "router.json5"
    path.write_text(
        '{mode: "router", listen: {endpoints: ["tcp/127.0.0.1:7450", "tcp/0.0.0.0:7451"]}}'
    )
    flags = (
        ["--config", str(path)]
        if way == "config"
        else ["--cfg", 'listen/endpoints:["tcp/0.0.0.0:7451"]']
    )
    router = host.start(*command("router", *flags))
    assert router.wait_for_line(ASKS) == f"router: listens at tcp/0.0.0.0:7451, {RISK}"
    both = {"config": "tcp/127.0.0.1:7450, tcp/0.0.0.0:7451", "cfg": "tcp/0.0.0.0:7451"}[way]
    wait_for(lambda: f"router: listens at {both}\n" in router.err)


def test_zenohs_own_default_is_open(host: Host, tmp_path: Path) -> None:
    path = tmp_path / "empty.json5"
    path.write_text("{}")
    router = host.start(*command("router", "--config", str(path)))
    assert router.wait_for_line(ASKS) == f"router: listens at tcp/[::]:7447, {RISK}"


def test_a_router_with_passwords_does_not_warn(host: Host, tmp_path: Path) -> None:
    (tmp_path / "users").write_text("student:secret\n")
    dictionary = f'transport/auth/usrpwd/dictionary_file:"{tmp_path / "users"}"'
    router = host.start(*command("router", "--listen", "tcp/0.0.0.0:7447", "--cfg", dictionary))
    router.wait_for_line("router: listens at tcp/0.0.0.0:7447")
    assert ASKS not in router.err
