"""Real sessions on loopback: messages arrive, errors are one line, and everything ends."""

import contextlib
import os
import socket
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from itertools import count
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from holozen.background import background
from holozen.bus import Bus
from holozen.messages import (
    JointState,
    NextGoalReply,
    NextGoalRequest,
    Odometry,
    TriggerReply,
    TriggerRequest,
    Twist,
    TwistStamped,
)
from holozen.output import CDR, SampleReader
from holozen.testing import Wire, wait_for
from holozen.testing.process import PATIENCE
from holozen.transport import services as module
from holozen.transport import session as session_module
from holozen.transport.connection import Connection
from holozen.transport.errors import BusError, NoReply, ServiceError
from holozen.transport.graph import ALL, Endpoint, Graph
from holozen.transport.loopback import listen_error
from holozen.transport.pubsub import Publisher
from holozen.transport.session import Opened, Opening


@pytest.fixture
def pair(wire: Wire) -> tuple[Bus, Bus]:
    """Two buses that have found each other."""
    first, second = wire.bus("first"), wire.bus("second")
    wait_for(lambda: first.connected() and second.connected())
    return first, second


def refusal(use: Callable[[], object]) -> str:
    with pytest.raises(BusError) as error:
        use()
    message = str(error.value)
    assert message.isprintable()
    assert ".rs" not in message
    return message


def after_all(writer: Bus, reader: Bus) -> Callable[[], object]:
    """A function that waits until all that `writer` has put so far is with `reader`."""
    end, numbers = reader.subscribe_raw("end"), count()

    def arrived(mark: bytes) -> bool:
        writer.session.put("end", mark)
        return mark in [sample.payload for sample in iter(end.try_recv, None)]

    return lambda: wait_for(partial(arrived, b"%d" % next(numbers)))


def test_alone_it_has_no_peers(wire: Wire) -> None:
    assert not wire.bus().connected()


def test_a_plain_put_of_any_zenoh_tool_is_read(pair: tuple[Bus, Bus]) -> None:
    writer, reader = pair
    commands = reader.subscribe("cmd_vel", Twist, TwistStamped)
    after_all(writer, reader)()
    writer.session.put("cmd_vel", b'{"linear": {"x": 0.3}}')
    received = commands.recv()
    assert received.message == Twist.planar(0.3)
    assert (received.priority, received.source) == ("DATA", "")


def test_a_source_of_any_bytes_is_read_as_a_short_text(pair: tuple[Bus, Bus]) -> None:
    writer, reader = pair
    tap = reader.subscribe_raw("cmd_vel")
    after_all(writer, reader)()
    writer.session.put("cmd_vel", b"{}", attachment=b"\xff" * 1000)
    assert tap.recv().source == "�" * 80


def test_the_newest_are_kept_when_too_many_came(pair: tuple[Bus, Bus]) -> None:
    writer, reader = pair
    commands = reader.subscribe("cmd_vel", Twist, depth=3)
    wait = after_all(writer, reader)
    wait()
    publisher: Publisher[Twist] = writer.publisher("cmd_vel", Twist)
    for x in range(10):
        publisher.put(Twist.planar(float(x)))
        wait()  # on a busy machine Zenoh would drop some
    found = iter(commands.try_recv, None)
    assert [received.message for received in found] == [Twist.planar(float(x)) for x in (7, 8, 9)]


def test_a_payload_over_the_limit_is_not_even_copied(pair: tuple[Bus, Bus]) -> None:
    writer, reader = pair
    commands = reader.subscribe("cmd_vel", Twist, limit=100)
    after_all(writer, reader)()
    for size in (100, 101):
        writer.session.put("cmd_vel", b"{}" + b" " * (size - 2))
    full, over = commands.recv(), commands.recv()
    assert full.message == Twist()
    assert (over.error, over.payload, over.size) == ("oversized: 101 bytes", b"", 101)


def test_the_latest_message_of_a_key_is_kept(pair: tuple[Bus, Bus]) -> None:
    writer, reader = pair
    odom = reader.latest("odom", Odometry)
    assert odom.read()[0] is None
    publisher: Publisher[Odometry] = writer.publisher("odom", Odometry)
    wait_for(lambda: publisher.matched)
    for name in ("first", "second"):
        publisher.put(Odometry(child_frame_id=name))
    wait_for(lambda: odom.read()[0] == Odometry(child_frame_id="second"))
    assert odom.wait(after=0, timeout=0)


@pytest.mark.parametrize("read", ["tap", "subscribe"])
def test_a_reader_that_waits_can_be_closed(wire: Wire, read: str) -> None:
    bus = wire.bus()
    reader: Any = bus.subscribe_raw("odom") if read == "tap" else bus.subscribe("odom", Odometry)
    with ThreadPoolExecutor() as pool:
        waiting = pool.submit(reader.recv)
        wait_for(waiting.running)
        reader.close()
        with pytest.raises(BusError):
            waiting.result(10)


def test_a_latest_can_be_closed_and_its_thread_ends(wire: Wire) -> None:
    bus, before = wire.bus(), set(threading.enumerate())
    odom = bus.latest("odom", Odometry)
    (thread,) = set(threading.enumerate()) - before
    odom.close()
    thread.join(10)
    assert not thread.is_alive()


def test_a_closed_bus_ends_its_readers_and_may_be_closed_again(wire: Wire) -> None:
    bus = wire.bus()
    tap = bus.subscribe_raw("odom")
    odom, publisher = bus.subscribe("odom", Odometry), bus.publisher("odom", Odometry)
    bus.close()
    bus.close()
    with pytest.raises(BusError):
        tap.recv()
    assert refusal(bus.__enter__) == "closed; make another"
    uses: list[Callable[[], object]] = [
        odom.recv,
        odom.try_recv,
        lambda: publisher.put(Odometry()),
        lambda: publisher.matched,
        publisher.poll_wanted,
    ]
    assert {refusal(use) for use in uses} == {"closed"}
    for use in (lambda: bus.subscribe_raw("odom"), lambda: bus.writers("odom"), bus.graph):
        assert "session closed" in refusal(use)


WRONG_KEYS = ["", "/odom", "odom/", "a//b", "a?b", "a#b", "a$b", "**/**"]


def test_a_wrong_key_is_named_whatever_it_was_for(wire: Wire) -> None:
    bus = wire.bus()
    uses: list[Callable[[str], object]] = [
        bus.subscribe_raw,
        lambda key: bus.subscribe(key, Twist),
        lambda key: bus.latest(key, Twist),
        lambda key: bus.publisher(key, Twist),
        lambda key: bus.serve(key, TriggerRequest, TriggerReply, lambda _: TriggerReply()),
        lambda key: bus.call(key, TriggerRequest(), TriggerReply),
    ]
    for key in WRONG_KEYS:
        for use in uses if "?" not in key else uses[:-1]:  # one may call with parameters
            assert f" {key!r}: Invalid Key Expr `{key}`" in refusal(partial(use, key))
    for use in uses:  # Zenoh would abort this process
        assert "70000 characters; a key has at most 1000" in refusal(partial(use, 70_000 * "a"))


def test_nobody_writes_to_a_wildcard(wire: Wire) -> None:
    """`*/cmd_vel` would drive every robot."""
    bus = wire.bus()
    for use in (lambda: bus.publisher("*/cmd_vel", Twist), lambda: bus.publisher_raw("**", "", "")):
        assert "write to one key" in refusal(use)


def test_a_name_of_a_node_that_would_be_misread_is_refused_at_once(wire: Wire) -> None:
    for name in ("", "a;b", "a@b", "x\n", "#?", "*", "a/", "/a", "a  b", "x" * 256):
        assert refusal(partial(wire.bus, name)).startswith(f"name of a node {name[:9]!r}"[:-1])


def test_the_names_that_programs_give_are_taken(wire: Wire) -> None:
    for name in ("ns/talker", "my script-2.0", "Rüstig"):
        assert wire.bus(name).source.startswith(f"{name}@")


def test_wrong_arguments_are_named_with_what_is_allowed(wire: Wire) -> None:
    bus: Any = wire.bus()
    ask = partial(bus.call, "stop")
    for error, use, expected in (
        (BusError, lambda: bus.publisher("odom", Twist, "HIGH"), "'HIGH'; there are REAL_TIME, "),
        (BusError, lambda: bus.publisher("odom", Twist, wire="xml"), "'xml'; there are json, "),
        (BusError, lambda: wire.bus(wire="yaml"), "'yaml'; there are json, "),
        (
            BusError,
            lambda: ask(TriggerRequest(), TriggerReply, -1),
            "timeout -1: use 0 to 1e[+]09 s",
        ),
        (
            BusError,
            lambda: ask(TriggerRequest(), TriggerReply, float("nan")),
            "timeout nan: use 0 to 1e[+]09 s",
        ),
        (
            BusError,
            lambda: ask(TriggerRequest(), TriggerReply, float("inf")),
            "timeout inf: use 0 to 1e[+]09 s",
        ),
        (
            BusError,
            lambda: ask(TriggerRequest(), TriggerReply, "1"),
            "timeout '1': use 0 to 1e[+]09 s",
        ),
        (
            BusError,
            lambda: bus.subscribe("odom", Twist, depth=0),
            "key 'odom': depth 0: use 1 to 16777216",
        ),
        (
            BusError,
            lambda: bus.subscribe_raw("odom", 10**9),
            "key 'odom': depth 1000000000: use 1 to 16777216",
        ),
        (
            TypeError,
            lambda: bus.publisher("odom", dict),
            "'odom': dict is not the class of a message",
        ),
        (
            TypeError,
            lambda: bus.publisher("odom", TriggerReply()),
            "'odom': TriggerReply(.*) is not the class of",
        ),
        (TypeError, lambda: bus.publisher(5, Twist), "key '5': give a text"),
        (TypeError, lambda: bus.subscribe("odom"), "'odom': None is not the class of a message"),
        (TypeError, lambda: bus.latest("odom", dict), "'odom': dict is not the class"),
        (
            TypeError,
            lambda: bus.serve("stop", TriggerRequest, dict, print),
            "'stop': dict is not the class",
        ),
        (
            TypeError,
            lambda: bus.call_all("stop", TriggerRequest, TriggerReply),
            "'stop': the request .* is not a mess",
        ),
        (TypeError, lambda: ask(TriggerRequest(), dict), "'stop': dict is not the class"),
    ):
        with pytest.raises(error, match=expected) as raised:
            use()
        assert "\n" not in str(raised.value)
    assert bus.endpoints() == []


def test_a_wrong_key_leaves_nothing_in_the_graph(pair: tuple[Bus, Bus]) -> None:
    writer, reader = pair
    refusal(lambda: writer.publisher("a$b", Twist))
    writer.publisher("odom", Odometry)
    graph = reader.graph()
    wait_for(graph.endpoints)
    assert [endpoint.key for endpoint in graph.endpoints()] == ["odom"]


def test_a_service_that_is_not_there_yet_is_waited_for(
    wire: Wire, monkeypatch: pytest.MonkeyPatch
) -> None:
    server, caller = wire.bus("server"), wire.bus("caller")
    pauses: list[float] = []

    def sleep(seconds: float) -> None:
        if not pauses:  # it was asked for once, in vain
            server.serve("resume", TriggerRequest, TriggerReply, lambda _: TriggerReply()).start()
        pauses.append(seconds)
        time.sleep(seconds)

    monkeypatch.setattr(module, "time", SimpleNamespace(monotonic=time.monotonic, sleep=sleep))
    assert caller.call("resume", TriggerRequest(), TriggerReply, 30) == TriggerReply()
    assert pauses


def test_a_service_that_is_not_there_is_named_with_the_time_it_had(wire: Wire) -> None:
    with pytest.raises(
        NoReply,
        match=r"^no reply from 'resume' within 0\.05 s at tcp/127.*; `holozen service list` lists "
        r"the servers$",
    ):
        wire.bus().call("resume", TriggerRequest(), TriggerReply, timeout=0.05)


def test_a_service_that_is_there_but_silent_is_no_refusal(pair: tuple[Bus, Bus]) -> None:
    """The controller asks a service again that did not answer, and gives up at one that refused."""
    server, caller = pair
    # and requests are never read
    server.serve("resume", TriggerRequest, TriggerReply, lambda _: TriggerReply())
    with pytest.raises(NoReply, match=r"within 0\.1 s"):
        caller.call("resume", TriggerRequest(), TriggerReply, timeout=0.1)


def test_a_reply_that_is_none_is_an_error_of_the_service(wire: Wire) -> None:
    bus = wire.bus()
    bus.serve("next_goal", NextGoalRequest, TriggerReply, lambda _: TriggerReply()).start()
    with pytest.raises(
        ServiceError, match=r"^the reply of 'next_goal' is not a NextGoalReply: .*`success`"
    ):
        bus.call("next_goal", NextGoalRequest(), NextGoalReply)


def test_the_graph_shows_readers_writers_and_servers(pair: tuple[Bus, Bus]) -> None:
    writer, reader = pair
    writer.publisher("Fred/odom", Odometry)
    writer.serve("resume", TriggerRequest, TriggerReply, lambda _: TriggerReply())
    reader.subscribe("**/odom", Odometry)
    expected = {
        Endpoint("Fred/odom", "pub", "nav_msgs/msg/Odometry", "first", writer.id),
        Endpoint("resume", "srv", "std_srvs/srv/Trigger", "first", writer.id),
        Endpoint("**/odom", "sub", "nav_msgs/msg/Odometry", "second", reader.id),
    }
    graph = reader.graph()
    wait_for(lambda: set(graph.endpoints()) == expected)
    writer.close()
    wait_for(lambda: {endpoint.node for endpoint in graph.endpoints()} == {"second"})


def test_a_node_that_left_is_gone_even_where_its_link_survives(
    wire: Wire, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As Zenoh lets a link survive that is opened while the session is closed."""
    leaver, watcher = wire.bus("sim", lasting=True), wire.bus("watcher")
    leaver.publisher("odom", Odometry)
    leaver.subscribe("cmd_vel", Twist)
    leaver.serve("resume", TriggerRequest, TriggerReply, lambda _: TriggerReply())
    graph, served = watcher.graph(), watcher.served("resume")
    wait_for(lambda: len(graph.endpoints()) == 4 and served())
    with monkeypatch.context() as patch:
        patch.setattr(Opened, "close", lambda _: None)
        leaver.close()
    wait_for(lambda: not graph.endpoints() and not served())
    assert watcher.connected()
    leaver.session.close()


class Watched(Bus):
    """A bus that keeps the graphs it gave."""

    def __init__(self, wire: Wire) -> None:
        super().__init__("watched", wire.connection)
        self.graphs: list[Graph] = []

    def graph(self, keys: str = ALL) -> Graph:
        self.graphs.append(super().graph(keys))
        return self.graphs[-1]


def test_one_look_at_the_graph_leaves_nothing_declared(wire: Wire) -> None:
    wire.bus("sim", lasting=True)
    with Watched(wire) as bus:
        kept = bus.graph()
        assert [endpoint.node for endpoint in bus.endpoints()] == ["sim"]
        assert [endpoint.node for endpoint in kept.endpoints()] == ["sim"]
        with pytest.raises(BusError, match="closed"):
            bus.graphs[-1].endpoints()


def test_an_echo_that_looks_types_up_leaves_nothing_declared(wire: Wire) -> None:
    """It looked once for each key of unknown type, and every look stayed declared."""
    with Watched(wire) as bus:
        tap, reader = bus.subscribe_raw("**"), SampleReader()
        for number in range(2):
            bus.session.put(f"key/{number}", b"\0\1\0\0", encoding=CDR)
            reader.read(tap.recv(), bus)
        assert len(bus.graphs) == 2
        for graph in bus.graphs:
            with pytest.raises(BusError, match="closed"):
                graph.endpoints()


def test_only_what_runs_long_is_a_node(wire: Wire) -> None:
    lasting = wire.bus("sim", lasting=True)
    wire.bus("topic_echo")
    graph = wire.bus("me").graph()
    wait_for(graph.endpoints)
    assert graph.endpoints() == [Endpoint("", "node", "", "sim", lasting.id)]


def test_peers_meet_in_whatever_order_they_come_and_go(wire: Wire) -> None:
    first, second = wire.bus("first", lasting=True), wire.bus("second", lasting=True)
    wait_for(lambda: linked_to(first) == {second.id})
    first.close()
    wait_for(lambda: not second.connected())
    late = wire.bus("late")
    assert linked_to(late) == {second.id}, "it is there before the bus is open"


def linked_to(bus: Bus) -> set[str]:
    return set(map(str, bus.session.info.peers_zid()))


def test_a_closed_bus_leaves_no_port_and_no_thread(wire: Wire) -> None:
    one, visitor = wire.bus("one"), wire.bus("visitor")
    wait_for(visitor.connected)
    before = set(threading.enumerate())
    one.close()
    wait_for(lambda: not listen_error(wire.endpoint))
    wait_for(lambda: set(threading.enumerate()) <= before)


def sockets() -> Iterator[socket.socket]:
    """Copies of the sockets of this process that wait for anybody."""
    for name in os.listdir("/proc/self/fd"):
        with contextlib.suppress(OSError), socket.socket(fileno=os.dup(int(name))) as one:
            waits = one.type == socket.SOCK_DGRAM or one.getsockopt(
                socket.SOL_SOCKET, socket.SO_ACCEPTCONN
            )
            if waits and one.family in (socket.AF_INET, socket.AF_INET6):
                yield one


def test_a_bus_listens_on_loopback_only(wire: Wire) -> None:
    wire.bus(lasting=True)
    found = list[str]()
    for one in sockets():
        device = one.getsockopt(socket.SOL_SOCKET, socket.SO_BINDTODEVICE, 16)
        found.append("lo" if device == b"lo\0" else one.getsockname()[0])
    assert set(found) == {"127.0.0.1", "lo"}


def test_a_wrong_connection_is_one_line(wire: Wire) -> None:
    for connection, expected in (
        (
            Connection(config="no/such.json5"),
            "Zenoh configuration no/such.json5: No such file or directory",
        ),
        (Connection(connect=("nonsense",)), 'Zenoh setting connect/endpoints:["nonsense"]: '),
        (
            Connection(connect=("pigeon/127.0.0.1:1",)),
            "cannot open Zenoh: Unicast not supported for pigeon",
        ),
        (Connection(cfg=(("no/such", "1"),)), "Zenoh setting no/such:1: "),
        (Connection(cfg=(("mode", "["),)), "Zenoh setting mode:[: "),
        (
            Connection("router", listen=("tcp/192.0.2.1:7447",)),
            "cannot open Zenoh: cannot listen at tcp/192.0.2.1",
        ),
        (Connection("client", connect=()), "cannot open Zenoh: a client needs --connect ENDPOINT"),
    ):
        listening = connection._replace(listen=connection.listen or (wire.endpoint,))
        assert refusal(partial(Bus, "test", listening, patience=0)).startswith(expected)


@pytest.mark.parametrize("text", ["{mode: ", "{nosuch: 1}", "{mode: 'king'}"])
def test_a_wrong_configuration_file_is_one_line_that_names_it(tmp_path: Path, text: str) -> None:
    path = tmp_path / "zenoh.json5"
    path.write_text(text)
    assert refusal(lambda: Bus("test", Connection(config=str(path)))).startswith(
        f"Zenoh configuration {path}: "
    )


def test_a_configuration_file_is_read(wire: Wire, tmp_path: Path) -> None:
    path = tmp_path / "zenoh.json5"
    path.write_text(
        f"{{scouting: {{multicast: {{enabled: false}}}}, connect: {{endpoints: "
        f'["{wire.endpoint}"]}}}}'
    )
    wire.bus("point")
    with Bus("test", Connection(config=str(path), listen=("tcp/127.0.0.1:0",))) as bus:
        wait_for(bus.connected)


def test_a_client_without_its_router_gives_up_after_its_patience(wire: Wire) -> None:
    message = refusal(
        lambda: Bus("test", Connection("client", connect=(wire.endpoint,)), patience=0)
    )
    assert (
        message
        == f"cannot open Zenoh: no router answers at {wire.endpoint}; `holozen router` runs one"
    )


def test_a_waiting_client_ends_cleanly_when_asked(wire: Wire) -> None:
    stop = threading.Event()
    stop.set()
    with pytest.raises(SystemExit) as end:
        Bus("test", Connection("client", connect=(wire.endpoint,)), stop=stop)
    assert end.value.code == 0


def test_a_client_waits_for_its_router_and_reports_it(
    wire: Wire, capsys: pytest.CaptureFixture[str]
) -> None:
    with ThreadPoolExecutor() as pool:
        connection = Connection("client", connect=(wire.endpoint,))
        client = pool.submit(Bus, "client", connection, patience=PATIENCE)
        wait_for(lambda: wire.endpoint in capsys.readouterr().err)
        with Bus("router", Connection("router", listen=(wire.endpoint,))), client.result(30) as bus:
            wait_for(bus.connected)


def test_an_early_bus_opens_in_the_background_and_its_first_use_waits(wire: Wire) -> None:
    with Bus("early", Opening(wire.connection, early=True)) as early, wire.bus("other") as other:
        odom = early.subscribe("odom", Odometry)
        publisher = other.publisher("odom", Odometry)
        wait_for(lambda: publisher.matched)
        publisher.put(Odometry())
        assert odom.recv().message == Odometry()
        assert early.source.startswith("early@")


def test_an_early_bus_that_cannot_open_reports_it_at_its_first_use_and_closes(wire: Wire) -> None:
    nowhere = Connection("client", connect=(wire.endpoint,))
    with Bus("early", Opening(nowhere, patience=0.1, early=True)) as bus:
        for _ in range(2):
            with pytest.raises(BusError, match="no router answers"):
                bus.subscribe_raw("odom")


def test_an_early_bus_that_is_interrupted_as_it_starts_leaves_no_thread_that_opens(
    wire: Wire, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(work: Callable[[], object]) -> None:
        background(work)
        raise KeyboardInterrupt

    monkeypatch.setattr(session_module, "background", interrupted)
    quickly = ("connect/timeout_ms", "500")  # Zenoh tries for so long
    nowhere = Connection("client", connect=(wire.endpoint,), cfg=(quickly,))
    before = threading.active_count()
    with pytest.raises(KeyboardInterrupt):
        Opening(nowhere, patience=60, early=True)
    wait_for(lambda: threading.active_count() <= before, 30)


def test_an_early_bus_may_be_closed_before_it_is_open(wire: Wire) -> None:
    with Bus("early", Opening(Connection("client", connect=(wire.endpoint,)), early=True)):
        pass


def test_a_closed_bus_has_no_link_to_ask_for(wire: Wire) -> None:
    with wire.bus("one") as bus:
        bus.connected()
    with pytest.raises(BusError, match="closed"):
        bus.connected()


def test_a_newer_sim_does_not_blind_an_older_reader_but_a_typo_in_a_command_is_refused(
    pair: tuple[Bus, Bus],
) -> None:
    writer, reader = pair
    odoms, commands = (
        reader.subscribe("odom", Odometry),
        reader.subscribe("Fred/cmd_vel", Twist, TwistStamped),
    )
    for key in ("odom", "Fred/cmd_vel"):
        wait_for(lambda key=key: writer.session.declare_publisher(key).matching_status.matching)  # type: ignore[misc]
        writer.session.put(
            key,
            b'{"child_frame_id": "base", "linear": {}, "speed": 1}',
            encoding="application/json",
        )
    assert odoms.recv().message == Odometry(child_frame_id="base")
    assert "unknown field" in commands.recv().error


def test_a_request_with_an_unknown_field_is_refused_and_one_in_a_reply_ignored(
    pair: tuple[Bus, Bus],
) -> None:
    server, caller = pair
    server.serve("next_goal", NextGoalRequest, NextGoalReply, lambda _: NextGoalReply(1.0)).start()
    with pytest.raises(ServiceError, match="unknown field `gaol`"):
        module.call_bytes(caller, "next_goal", b'{"gaol": 1}', "application/json", 30.0)
    answer = b'{"success": true, "by": "a"}'
    newer = server.session.declare_queryable(
        "release", lambda query: query.reply("release", answer)
    )
    assert caller.call("release", TriggerRequest(), TriggerReply, 30.0) == TriggerReply(True)
    newer.undeclare()


def test_commands_go_out_at_once_and_telemetry_in_batches(pair: tuple[Bus, Bus]) -> None:
    """Sent one by one, the five messages of one step of the sim fill the queue of a link, and some
    are dropped.
    """
    writer, reader = pair
    samples = reader.subscribe_raw("**")
    for key, kind in (("cmd_vel", Twist), ("odom", Odometry), ("Fred/joint_states", JointState)):
        publisher = writer.publisher(key, kind)
        wait_for(lambda publisher=publisher: publisher.matched)  # type: ignore[misc]
        publisher.put(kind())
    express = {
        sample.key: sample.delivery[1]
        for sample in (samples.recv(), samples.recv(), samples.recv())
    }
    assert express == {"cmd_vel": True, "odom": False, "Fred/joint_states": False}


def test_a_graph_that_settles_while_another_thread_closes_its_bus_says_so(wire: Wire) -> None:
    wire.bus("other")
    bus = wire.bus("me")
    graph = bus.graph()
    graph.settled(bus.connected)
    bus.close()
    with pytest.raises(BusError, match="closed"):
        graph.settled(lambda: True)
