"""`--json` of a service: each line that it prints is an object."""

import json

from holozen.testing import Wire, wait_for


def test_a_sim_reports_in_json(wire: Wire) -> None:
    sim = wire.start("sim", "--empty", "--json")
    wait_for(lambda: "\n" in sim.out)
    assert sim.interrupt() == 0
    rows = [json.loads(line) for line in sim.out.splitlines()]
    assert rows and all(list(row) == ["text"] for row in rows)
    assert sim.err == ""
