"""`holozen ros2`: joins the wire with ROS 2 nodes that use rmw_zenoh."""

import argparse
import os

from holozen.bus import Bus
from holozen.console import report
from holozen.flags import Parser
from holozen.process import stop_event
from holozen.transport import connection

STAMPED = ("timestamping/enabled", "true")  # as the caches of latched topics need
EVERY = 0.05  # s between two looks at the nodes


def parser() -> argparse.ArgumentParser:
    parser = Parser(
        prog="holozen ros2",
        description="Join the keys here with the topics of ROS 2 nodes that use rmw_zenoh: they see our topics and "
        "services, and we see their topics. What a ROS 2 node publishes on cmd_vel has the priority of plain data.",
        epilog="example: holozen ros2 --connect tcp/192.168.1.5:7447",
    )
    parser.add_argument(
        "--ros-domain-id", type=connection.domain, default=os.environ.get("ROS_DOMAIN_ID") or "0", metavar="N",
        help="as ROS_DOMAIN_ID of the ROS 2 nodes (default: that variable here, else 0)",
    )  # fmt: skip
    connection.add_arguments(parser)
    return parser


def main(argv: list[str]) -> int:
    arguments = parser()
    args = arguments.parse_args(argv)
    where = connection.from_arguments(args)
    if where.secure:
        arguments.error("--secure: no certificate vouches for what ROS 2 nodes write, so they cannot be let in")
    where = where.replace(cfg=(STAMPED, *where.cfg))
    from holozen.transport.ros_gateway import NODE, Gateway

    stop = stop_event()
    with Bus(NODE, where, lasting=True, stop=stop) as bus:
        gateway = Gateway(bus, args.ros_domain_id)
        report(f"{NODE}: joins ROS 2's domain {args.ros_domain_id} at {bus.where}; Ctrl-C ends it")
        while not (why := gateway.update()) and not stop.wait(EVERY):
            pass
        gateway.close()
    if why:
        report(f"holozen ros2: {why}")
    return 1 if why else 0
