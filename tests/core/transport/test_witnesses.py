"""What hangs is known from others, also where they are slow to tell."""

from typing import Any

from holozen.testing import Wire, wait_for
from holozen.transport.graph import ALL_WITNESSES, Endpoint, token

HUNG = Endpoint("Bob/stop", "srv", "std_srvs/srv/Trigger", "sim", "abc")


def test_where_none_tells_in_time_all_are_asked_again(wire: Wire) -> None:
    asks, slow = wire.bus("asks"), wire.bus("slow")
    told = list[str]()

    def tell(query: Any) -> None:
        with query:
            if told:  # the first one ends without an answer, as if that came too late
                query.reply(query.key_expr, token(HUNG))
            told.append(str(query.key_expr))

    slow.session.declare_queryable(ALL_WITNESSES.replace("*", slow.id), tell)
    wait_for(lambda: [*asks.ask_all(ALL_WITNESSES, 1.0)] or told)
    told.clear()
    assert asks.hidden() == [HUNG]
    assert len(told) == 2
