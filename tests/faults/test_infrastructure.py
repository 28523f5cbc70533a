"""The faults happen: what a test sets is what a connection meets."""

import select
import socket
import sys
import time
from collections.abc import Iterator

import pytest

from holozen.testing import wait_for

from .namespaces import NEEDS, Cable, Host, Lab
from .proxy import Proxy

WITHIN = 30.0  # s for what is sent to arrive, also on a busy machine


class Echo:
    """A connection by a proxy, both of whose ends the test holds."""

    def __init__(self, proxy: Proxy, listener: socket.socket) -> None:
        self.near = socket.create_connection(("127.0.0.1", proxy.port), timeout=WITHIN)
        self.far = listener.accept()[0]
        self.far.settimeout(WITHIN)

    def carries(self, data: bytes = b"x") -> float:
        """How long data takes to the far end, in s."""
        begin = time.monotonic()
        self.near.sendall(data)
        left = len(data)
        while left:
            left -= len(self.far.recv(left))
        return time.monotonic() - begin


@pytest.fixture
def listener() -> Iterator[socket.socket]:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        listener.settimeout(WITHIN)
        yield listener


@pytest.fixture
def link(listener: socket.socket) -> Iterator[Proxy]:
    with Proxy(listener.getsockname()[1]) as proxy:
        yield proxy


@pytest.fixture
def echo(link: Proxy, listener: socket.socket) -> Iterator[Echo]:
    echo = Echo(link, listener)
    with echo.near, echo.far:
        yield echo


def test_a_link_without_faults_carries_both_ways_and_ends_as_its_ends_do(echo: Echo) -> None:
    echo.carries(b"there" * 100_000)
    echo.far.sendall(b"back")
    assert echo.near.recv(4) == b"back"
    echo.far.close()
    assert echo.near.recv(1) == b""


def test_a_delay_is_one_way(link: Proxy, echo: Echo) -> None:
    link.upstream.delay = 1.0  # s
    begin = time.monotonic()
    echo.near.sendall(b"there")
    echo.far.sendall(b"back")
    assert echo.near.recv(4) == b"back"
    is_there = bool(select.select([echo.far], [], [], 0)[0])
    assert not is_there or time.monotonic() - begin >= 1.0, (
        "what was sent before is still under way"
    )
    assert echo.far.recv(5) == b"there"
    assert time.monotonic() - begin >= 1.0


def test_a_connection_over_a_slow_link_takes_a_round_trip_to_open(
    link: Proxy, listener: socket.socket
) -> None:
    link.set(delay=0.3)
    begin = time.monotonic()
    echo = Echo(link, listener)
    echo.carries()
    assert time.monotonic() - begin >= 0.9  # three times the delay
    echo.near.close()
    echo.far.close()


def test_jitter_varies_the_delay_and_keeps_the_order(link: Proxy, echo: Echo) -> None:
    link.upstream.jitter = 0.05
    times = [echo.carries(bytes([number])) for number in range(20)]
    assert max(times) - min(times) > 0.01
    for number in range(100):
        echo.near.sendall(bytes([number]))
    got = b""
    while len(got) < 100:
        got += echo.far.recv(100)
    assert got == bytes(range(100))


def test_what_is_lost_comes_a_round_trip_later(link: Proxy, echo: Echo) -> None:
    link.upstream.delay, link.upstream.loss = 0.1, 1.0
    assert echo.carries() >= 0.29


def test_a_rate_limits(link: Proxy, echo: Echo) -> None:
    link.upstream.rate = 1e6
    assert echo.carries(bytes(300_000)) >= 0.29


def test_a_stall_delivers_later_what_was_sent_during_it(link: Proxy, echo: Echo) -> None:
    link.stall()
    echo.near.sendall(b"late")
    echo.far.settimeout(0.2)
    with pytest.raises(TimeoutError):
        echo.far.recv(4)
    link.resume()
    echo.far.settimeout(WITHIN)
    assert echo.far.recv(4) == b"late"


def test_a_black_hole_swallows_and_what_lost_bytes_stays_silent(
    link: Proxy, echo: Echo, listener: socket.socket
) -> None:
    link.set(lost=True)
    echo.near.sendall(b"gone")
    echo.far.settimeout(0.2)
    with pytest.raises(TimeoutError):
        echo.far.recv(4)
    wait_for(lambda: any(way.has_lost for way in link.ways), what="the bytes to be swallowed")
    link.set(lost=False)
    echo.near.sendall(b"gone too")
    with pytest.raises(TimeoutError):
        echo.far.recv(4)
    fresh = Echo(link, listener)
    fresh.carries()
    fresh.near.close()
    fresh.far.close()


@pytest.fixture
def hosts(lab: Lab) -> tuple[Host, Host]:
    return lab.host("one"), lab.host("other", clock=5000)


@pytest.fixture
def cable(lab: Lab, hosts: tuple[Host, Host]) -> Cable:
    return lab.cable(*hosts)


ANSWER = """
import socket, sys
udp = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
udp.bind((sys.argv[1], 4000))
print("up", flush=True)
while True:
    udp.sendto(*udp.recvfrom(100))
"""
PING = """
import socket, sys
udp = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
udp.settimeout(1)
back, count = 0, int(sys.argv[2])
try:
    for number in range(count):
        udp.sendto(b"x", (sys.argv[1], 4000))
    while back < count:
        back += len(udp.recv(100))
except OSError:
    pass
print(back)
"""


def pings(hosts: tuple[Host, Host], cable: Cable, count: int = 3) -> int:
    """How many packets, of so many sent, come back from the other host within a second."""
    return int(hosts[0].check(sys.executable, "-c", PING, cable.address(hosts[1]), str(count)))


@NEEDS
def test_a_cable_carries_until_it_is_cut_and_again_when_it_is_joined(
    hosts: tuple[Host, Host], cable: Cable
) -> None:
    hosts[1].start(sys.executable, "-c", ANSWER, cable.address(hosts[1])).wait_for_line("up")
    wait_for(lambda: pings(hosts, cable) == 3)
    cable.cut()
    assert pings(hosts, cable) == 0
    cable.join()
    wait_for(lambda: pings(hosts, cable) == 3)


@NEEDS
@pytest.mark.needs("nft")
def test_a_cable_loses_a_share_of_its_packets(hosts: tuple[Host, Host], cable: Cable) -> None:
    hosts[1].start(sys.executable, "-c", ANSWER, cable.address(hosts[1])).wait_for_line("up")
    cable.lose(0.5)
    # 50 of them; none in one of 10^25 times, but for a busy machine
    wait_for(lambda: 0 < pings(hosts, cable, 200) < 200)
    cable.lose(1.0)
    assert pings(hosts, cable) == 0
    cable.lose(0.0)
    wait_for(lambda: pings(hosts, cable) == 3)


CLOCKS = "import time; print(time.monotonic(), time.time())"


@NEEDS
def test_each_host_has_a_monotonic_clock_of_its_own_and_the_time_of_day_of_all(
    hosts: tuple[Host, Host],
) -> None:
    clocks = [hosts[0], hosts[1]]
    (mono, day), (other_mono, other_day) = (
        map(float, host.check(sys.executable, "-c", CLOCKS).split()) for host in clocks
    )
    passed = other_day - day
    assert other_mono - mono - passed == pytest.approx(5000, abs=100)
    assert abs(passed) < 100


@NEEDS
def test_a_host_sees_nothing_but_its_own_network(hosts: tuple[Host, Host]) -> None:
    assert [line.split(":")[0].strip() for line in hosts[0].proc_net("dev")[2:]] == ["lo"]
