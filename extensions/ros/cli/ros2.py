"""`holozen ros2`: connects the keys here with ROS 2 nodes that use rmw_zenoh, or that are behind a
bridge to DDS.
"""

import argparse
import os

from holozen.bus import Bus
from holozen.cli.verb import Verb, by_name
from holozen.console import Failure, report
from holozen.process import stop_event
from holozen.transport import connection

STAMPED = ("timestamping/enabled", "true")  # the caches of latched topics need timestamps
EVERY = 0.05  # s between two looks at the nodes


def run(args: argparse.Namespace) -> int:
    """Connect both sides until Ctrl-C."""
    if args.bridge and (args.humble or args.ros_domain_id is not None):
        flag = "--humble" if args.humble else "--ros-domain-id"
        args.error(
            f"{flag} is for rmw_zenoh; with --bridge give the bridge its domain and distribution"
        )
    where, domain = connection.from_arguments(args), _domain(args)
    if where.secure:
        args.error(
            "--secure: no certificate vouches for what ROS 2 nodes write, so they cannot be let in"
        )
    where = where._replace(cfg=(STAMPED, *where.cfg))
    from holozen.ros.gateway import rmw_zenoh, ros2dds
    from holozen.ros.gateway.gateway import Gateway, open_bridges
    from holozen.ros.gateway.sides import NODE

    stop = stop_event()
    with Bus(NODE, where, lasting=True, stop=stop) as bus:
        if args.bridge:
            gateway = Gateway(bus, ros2dds.Form(), open_bridges(args.bridge, STAMPED))
            report(
                f"{NODE}: joins ROS 2 behind the bridge at {', '.join(args.bridge)} and "
                f"{bus.where}; Ctrl-C ends it"
            )
        else:
            gateway = Gateway(bus, rmw_zenoh.Form(domain, args.humble), bus.session)
            report(f"{NODE}: joins ROS 2's domain {domain} at {bus.where}; Ctrl-C ends it")
        while not (why := gateway.update()) and not stop.wait(EVERY):
            pass
        gateway.close()
    if why:
        raise Failure(why)
    return 0


def _domain(args: argparse.Namespace) -> int:
    """The domain by the flag, else by the environment. Exits with code 2 for an invalid one
    there.
    """
    if args.ros_domain_id is not None:
        return int(args.ros_domain_id)
    try:
        return connection.domain(os.environ.get("ROS_DOMAIN_ID") or "0")
    except argparse.ArgumentTypeError as error:
        args.error(f"ROS_DOMAIN_ID {error}")
        raise


def _arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--bridge",
        action="append",
        type=connection.endpoint,
        default=[],
        metavar="ENDPOINT",
        help="where a zenoh-bridge-ros2dds listens, such as tcp/192.168.1.5:7447; can be repeated",
    )
    parser.add_argument(
        "--ros-domain-id",
        type=connection.domain,
        metavar="N",
        help="ROS_DOMAIN_ID of the nodes with rmw_zenoh (default: that variable here, else 0); a "
        "bridge has its own",
    )
    parser.add_argument(
        "--humble",
        action="store_true",
        help="the nodes with rmw_zenoh are of ROS 2 Humble, where keys hold no type hashes",
    )


ABOUT = (
    "join the keys here with the topics and services of ROS 2 nodes: those with rmw_zenoh, or "
    "with --bridge all behind"
    " a zenoh-bridge-ros2dds"
)
NOTES = "What ROS 2 publishes on cmd_vel has the priority of plain data."
VERBS = by_name(
    Verb("ros2", ABOUT, "--connect tcp/192.168.1.5:7447", _arguments, run, json=None, notes=NOTES)
)
