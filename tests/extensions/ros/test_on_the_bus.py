"""Generated messages and ours meet on the same keys."""

import pytest

from holozen.messages import Odometry, TriggerReply, TriggerRequest, Twist
from holozen.ros import generated
from holozen.testing import Wire, wait_for


def test_topics_go_both_ways(wire: Wire) -> None:
    script, sim = wire.bus("script"), wire.bus("sim")
    wait_for(lambda: script.connected() and sim.connected())
    kinds = [generated.find(name) for name in ("geometry_msgs/msg/Twist", "nav_msgs/msg/Odometry")]
    commands, odoms = sim.subscribe("cmd_vel", Twist), script.subscribe("odom", kinds[1])
    writer, answer = script.publisher("cmd_vel", kinds[0]), sim.publisher("odom", Odometry)
    wait_for(lambda: writer.matched and answer.matched)
    twist = kinds[0]()
    twist.linear.x = 0.5
    writer.put(twist)
    answer.put(Odometry(child_frame_id="base"))
    assert commands.recv().message == Twist.planar(0.5)
    assert odoms.recv().message == kinds[1](child_frame_id="base")


@pytest.mark.parametrize("ours", [True, False])
def test_services_answer_either(ours: bool, wire: Wire) -> None:
    trigger = generated.find("std_srvs/srv/Trigger")
    theirs = (trigger.Request, trigger.Response)
    (request, reply), (asked, expected) = ((TriggerRequest, TriggerReply), theirs)[
        :: 1 if ours else -1
    ]
    wire.bus("server").serve(
        "resume", request, reply, lambda _: reply(success=True, message="done")
    ).start()
    assert wire.bus("client").call("resume", asked(), expected) == expected(
        success=True, message="done"
    )
