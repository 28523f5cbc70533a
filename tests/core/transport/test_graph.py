"""The graph is read off liveliness tokens, whatever the keys hold."""

from collections import deque
from types import SimpleNamespace
from typing import Any

import pytest
import zenoh
from hypothesis import given
from hypothesis import strategies as st

from holozen.testing import wait_for
from holozen.transport import graph
from holozen.transport.graph import (
    ALL,
    MAX_GONE,
    Endpoint,
    Graph,
    includes,
    on_key,
    parse,
    subscribers,
    token,
)

chunks = st.text("ab%*$2A4.-_é", min_size=1, max_size=6).filter(
    lambda chunk: "*" not in chunk and "$" not in chunk
)
wild = chunks | st.sampled_from(["*", "**", "a$*b", "%2A", "%24", "%25"])
names = st.text("abcXYZ09_-", min_size=1, max_size=8)


def canonical(parts: list[str]) -> str:
    return str(zenoh.KeyExpr.autocanonize("/".join(parts)))


endpoints = st.builds(
    Endpoint,
    key=st.lists(wild, min_size=1, max_size=4).map(canonical),
    kind=st.sampled_from(["pub", "sub", "srv"]),
    type=st.tuples(names, st.sampled_from(["msg", "srv"]), names).map("/".join),
    # a node of a namespace has slashes
    node=st.lists(names | st.just("%2F"), min_size=1, max_size=3).map("/".join),
    session=names,
)
ODOM = Endpoint("odom", "pub", "nav_msgs/msg/Odometry", "sim", "a1")
SIM = Endpoint("", "node", "", "sim", "a1")


@given(endpoints)
def test_a_token_gives_its_endpoint_back_and_names_one_thing(endpoint: Endpoint) -> None:
    key = zenoh.KeyExpr(token(endpoint))
    assert "*" not in str(key)
    assert zenoh.KeyExpr(ALL).includes(key)
    assert not zenoh.KeyExpr("**").includes(key)
    assert parse(str(key)) == endpoint


def test_a_nodes_token_ends_after_its_kind() -> None:
    assert token(SIM) == "@holozen/a1/sim/node"
    assert parse(token(SIM)) == SIM


@given(st.text("@holozen/nodepubx", max_size=40))
def test_other_keys_are_no_tokens(text: str) -> None:
    endpoint = parse(text)
    assert endpoint is None or token(endpoint) == text


def test_a_node_of_a_namespace_stands_in_one_part_of_its_token() -> None:
    node = SIM._replace(node="Fred/talker")
    assert token(node) == "@holozen/a1/Fred%2Ftalker/node"
    assert parse(token(node)) == node


def test_a_token_of_an_unknown_kind_is_none() -> None:
    assert parse(token(ODOM).replace("/pub/", "/pup/")) is None
    assert parse("@holozen/a1/sim") is None
    assert parse("@holozen/a1/sim/pub/nav_msgs/msg/Odometry") is None
    assert parse(token(ODOM).removeprefix("@")) is None


def test_where_one_robot_listens_a_match_of_another_name_counts_no_subscriber() -> None:
    fred = Endpoint("Fred/cmd_vel", "sub", "geometry_msgs/msg/Twist", "sim", "b2")
    assert subscribers([fred], "Ghost/cmd_vel", matched=True) == 0
    assert subscribers([], "Ghost/cmd_vel", matched=True) == 1, "a foreign node"
    assert subscribers([fred], "cmd_vel", matched=True) == 1
    assert subscribers([fred], "Fred/cmd_vel", matched=False) == 1


@given(
    st.lists(st.sampled_from(["a", "b", "ab", "*", "**"]), min_size=1, max_size=5),
    st.lists(st.sampled_from(["a", "b", "ab"]), min_size=1, max_size=5),
)
def test_a_key_expression_includes_what_zenoh_includes(
    expression: list[str], key: list[str]
) -> None:
    pattern, name = canonical(expression), "/".join(key)
    assert includes(pattern, name) == zenoh.KeyExpr(pattern).includes(zenoh.KeyExpr(name))


def test_endpoints_on_a_key_are_those_of_the_kind_that_include_it() -> None:
    everywhere = Endpoint("**/odom", "sub", "nav_msgs/msg/Odometry", "pose_service", "b2")
    reader = ODOM._replace(kind="sub")
    assert on_key([ODOM, reader, everywhere], "odom", "sub") == [reader, everywhere]
    assert on_key([ODOM, reader, everywhere], "Fred/odom", "sub") == [everywhere]
    assert on_key([ODOM, reader, everywhere], "odom", "pub") == [ODOM]
    assert on_key([reader._replace(key="**/" * 40 + "odom")], "x/" * 40 + "y", "sub") == [], (
        "in a moment"
    )


def graph_of(*changes: tuple[str, bool]) -> Graph:
    waiting = deque(changes)
    return Graph(lambda: waiting.popleft() if waiting else None)


def test_endpoints_come_and_go_with_their_tokens_sorted_by_key() -> None:
    clock = ODOM._replace(key="clock")
    expected = [(token(e), True) for e in (ODOM, SIM, clock, ODOM)]
    assert graph_of(*expected).endpoints() == [SIM, clock, ODOM]
    assert graph_of(*expected, (token(ODOM), False), ("@holozen/x", True)).endpoints() == [
        SIM,
        clock,
    ]
    assert graph_of((token(ODOM), False), (token(ODOM), True)).endpoints() == [ODOM]


def test_what_is_known_stays_known_from_look_to_look() -> None:
    graph = graph_of((token(ODOM), True))
    assert graph.endpoints() == graph.endpoints() == [ODOM]


@pytest.fixture(autouse=True)
def even_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing takes time but sleeping."""
    now = 0.0

    def sleep(seconds: float) -> None:
        nonlocal now
        now += seconds

    monkeypatch.setattr(graph, "time", SimpleNamespace(monotonic=lambda: now, sleep=sleep))


def test_a_settled_graph_knows_what_came_late() -> None:
    """Tokens arrive one by one, with looks in between that find nothing new."""
    changes: deque[tuple[str, bool] | None] = deque(
        [None, (token(SIM), True), None, None, (token(ODOM), True), None]
    )
    connected = deque([False, False, True])
    graph = Graph(lambda: changes.popleft() if changes else None)
    assert graph.settled(lambda: connected.popleft()) == [SIM, ODOM]


def test_without_nodes_the_graph_is_empty_after_the_patience() -> None:
    assert graph_of().settled(lambda: False, patience=0.01) == []


def test_the_nodes_that_left_are_reported_once_by_the_names_of_their_samples() -> None:
    teleop = SIM._replace(node="teleop", session="0123456789")
    came = [(token(e), True) for e in (SIM, teleop, ODOM)]
    graph = graph_of(*came, (token(teleop), False), (token(ODOM), False), ("@holozen/x", False))
    assert [node.source for node in graph.left()] == ["teleop@012345"]
    assert graph.left() == []
    assert graph.endpoints() == [SIM]


def test_a_graph_that_is_never_asked_for_departures_stays_small() -> None:
    graph = graph_of(*((f"@holozen/{number}/sim/node", False) for number in range(MAX_GONE + 5)))
    assert graph.endpoints() == []
    assert len(graph.left()) == MAX_GONE


def test_a_graph_is_settled_only_after_all_known_peers_have_declared_theirs() -> None:
    changes: deque[tuple[str, bool]] = deque()

    def roll_call() -> bool:
        changes.append((token(ODOM), True))
        return True

    graph = Graph(lambda: changes.popleft() if changes else None, roll_call)
    assert graph.settled(lambda: True, quiet=0.0) == [ODOM]


def test_a_peer_that_pauses_between_two_of_its_tokens_is_heard_to_its_end() -> None:
    """On a busy machine it may not run for some time."""
    changes = deque([(token(SIM), True)])
    calls = 0

    def roll_call() -> bool:
        nonlocal calls
        calls += 1
        if calls == 2:
            changes.append((token(ODOM), True))
        return True

    graph = Graph(
        lambda: changes.popleft() if changes else None, roll_call, met=lambda: [SIM.session]
    )
    assert graph.settled(lambda: True) == [SIM, ODOM]


def test_a_peer_that_has_declared_nothing_yet_is_waited_for_longer() -> None:
    """The second of our nodes to be met, when the first has been quiet for long enough."""
    late = ODOM._replace(session="b2")
    looks = iter([*[None] * 30, (token(late), True)])
    changes = deque([(token(ODOM), True)])
    graph = Graph(
        lambda: changes.popleft() if changes else next(looks, None), met=lambda: ["a1", "b2"]
    )
    assert graph.settled(lambda: True) == [ODOM, late]


def test_a_session_that_answers_is_waited_for_and_then_nothing() -> None:
    """It is met after the others have been quiet for longer than a silent peer is waited for. Its
    first token comes before the others.
    """
    late = ODOM._replace(session="b2", node="late")
    looks = iter([*[None] * 200, (token(late._replace(kind="node", key="", type="")), True)])
    calls = iter([None, (token(late), True)])  # the second brings what was under way
    changes = deque([(token(ODOM), True)])

    def roll_call() -> bool:
        if call := next(calls):
            changes.append(call)
        return True

    def read() -> tuple[str, bool] | None:
        return changes.popleft() if changes else next(looks, None)

    graph = Graph(read, roll_call, expected=lambda: ({"a1", "b2"}, 0))
    assert {end.node for end in graph.settled(lambda: True) if end.key == ODOM.key} == {
        ODOM.node,
        "late",
    }


def test_where_one_alone_is_there_it_is_called_once_more_and_nobody_waited_for() -> None:
    late = ODOM._replace(key="tf")
    calls = iter([(token(ODOM), True), (token(late), True)])
    changes = deque[tuple[str, bool]]()

    def roll_call() -> bool:
        changes.append(next(calls))  # a third is an error
        return True

    def read() -> tuple[str, bool] | None:
        return changes.popleft() if changes else None

    graph = Graph(read, roll_call, expected=lambda: ({ODOM.session}, 0))
    assert graph.settled(lambda: True, patience=30, quiet=30) == [ODOM, late]


def test_where_nobody_else_is_there_nobody_is_waited_for() -> None:
    assert (
        Graph(lambda: None, expected=lambda: (set(), 0)).settled(lambda: False, patience=1e9) == []
    )


def test_where_the_first_link_took_long_so_may_the_next() -> None:
    late = ODOM._replace(session="b2")
    looks = iter([*[None] * 30, (token(late), True)])
    changes = deque([(token(ODOM), True)])
    graph = Graph(lambda: changes.popleft() if changes else next(looks, None), took=0.02)
    assert graph.settled(lambda: True) == [ODOM, late]


def test_foreign_tokens_are_ignored() -> None:
    odd = (
        "@holozen",
        "@holozen/x",
        "@holozen/x/y",
        "x",
        "@holozen/a/b/pub/z",
        "@holozen///",
        "@holozen/a/b/node/c",
    )
    graph = graph_of(
        *((key, True) for key in odd), (token(ODOM), True), *((key, False) for key in odd)
    )
    assert graph.endpoints() == [ODOM]
    assert list(graph.publishers(ODOM.key)) == [ODOM.session]
    assert graph.has(ODOM.session)


def test_publishers_of_a_key_come_and_go() -> None:
    other = ODOM._replace(session="ff")
    graph = graph_of((token(ODOM), True), (token(other), True), (token(ODOM), False))
    graph.endpoints()
    assert list(graph.publishers(ODOM.key)) == ["ff"]
    assert not list(graph.publishers("nothing"))


def test_among_thousands_of_tokens_one_that_comes_costs_no_look_at_the_others(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    looked: Any = []
    monkeypatch.setattr(graph, "parse", lambda text: looked.append(text) or parse(text))
    waiting = deque(
        (token(Endpoint(f"key{number}", "sub", "a/b/C", "node", "1")), True)
        for number in range(5000)
    )
    known = Graph(lambda: waiting.popleft() if waiting else None)
    known.endpoints()
    for number in range(100):
        waiting.append((token(Endpoint(f"more{number}", "sub", "a/b/C", "node", "2")), True))
        known.endpoints()
    assert len(looked) == 5100
    # A list of so many is sorted again only after a while.
    wait_for(lambda: known.endpoints() and known.seen == known.changes)
    assert len(known.endpoints()) == 5100
