"""`holozen ros2`: joins the wire with ROS 2 nodes that use rmw_zenoh."""

import argparse
import os

from holozen.bus import Bus
from holozen.cli.verb import Verb, by_name
from holozen.console import report
from holozen.process import stop_event
from holozen.transport import connection

STAMPED = ("timestamping/enabled", "true")  # as the caches of latched topics need
EVERY = 0.05  # s between two looks at the nodes


def run(args: argparse.Namespace) -> int:
    """Join both until Ctrl-C."""
    where = connection.from_arguments(args)
    if where.secure:
        args.error("--secure: no certificate vouches for what ROS 2 nodes write, so they cannot be let in")
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


def _arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--ros-domain-id", type=connection.domain, default=os.environ.get("ROS_DOMAIN_ID") or "0", metavar="N",
        help="as ROS_DOMAIN_ID of the ROS 2 nodes (default: that variable here, else 0)",
    )  # fmt: skip


ABOUT = (
    "Join the keys here with the topics of ROS 2 nodes that use rmw_zenoh: they see our topics and services, and we see"
    " their topics. What a ROS 2 node publishes on cmd_vel has the priority of plain data."
)
VERBS = by_name(Verb("ros2", ABOUT, "--connect tcp/192.168.1.5:7447", _arguments, run, json=None))
