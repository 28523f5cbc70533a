"""`holozen bag`: info and plot; record and play, as ROS 2 names `holozen record` and `holozen
replay`.
"""

import argparse
import json
from typing import TYPE_CHECKING

from holozen.cli.verb import Noun, Verb, argument, by_name
from holozen.console import printable
from holozen.flags import path

if TYPE_CHECKING:
    from pathlib import Path


def info(args: argparse.Namespace) -> int:
    """Print what is in each file."""
    from holozen.bags.reader import Bag, summarize

    for file in args.files:
        with Bag(file) as bag:
            summary = summarize(bag)
        if args.json:
            print(json.dumps(summary.figures()), flush=True)
        else:
            print("\n".join(map(printable, summary.lines())), flush=True)
    return 0


def plot(args: argparse.Namespace) -> int:
    """Draw a file's odometry into a picture."""
    from holozen.bags.deviation import read_path
    from holozen.bags.drawing import draw
    from holozen.bags.reader import recorded

    target = args.output or recorded(args.file).with_suffix(".png")
    paths = {key: read_path(file) for key, file in args.path or ()}
    drawn = draw(args.file, target, args.topics, paths)
    if args.json:
        off = {key: {"mean": mean, "most": most} for key, (mean, most) in drawn.deviations.items()}
        figures = {"file": str(args.file), "picture": str(target), "topics": drawn.topics}
        print(json.dumps(figures | ({"deviations": off} if paths else {})))
    else:
        print(printable(f"{target}: {drawn}"))
    return 0


def _path(text: str) -> tuple[str, "Path"]:
    """`KEY=FILE` or `FILE`, whose key is empty."""
    key, equals, file = text.rpartition("=")
    if equals and not key:
        raise argparse.ArgumentTypeError(
            f"{text!r} has no key before the =; write KEY=FILE, or FILE for all robots"
        )
    return key, path(file)


def _plot_arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("file", type=path, metavar="FILE")
    add(
        "-o",
        "--output",
        type=path,
        metavar="PICTURE",
        help=".png or .svg (default: FILE with .png)",
    )
    add("--topics", nargs="+", metavar="KEY", help="only these keys of odometry")
    add(
        "--path",
        action="append",
        type=_path,
        metavar="[KEY=]FILE",
        help="draw the closed path that a robot should have taken, an x y in m per line of FILE, "
        "and print how far its"
        " odometry is off in mm, from when it comes within 50 mm of the first corner; repeatable",
    )


VERBS = by_name(
    Noun(
        "bag",
        "record, play and inspect bags: MCAP files of messages",
        {"record": "holozen.bags.cli.record", "play": "holozen.bags.cli.replay"},
    ),
    Verb(
        "bag info",
        "show what is in a bag: counts, missing messages, rates",
        "square.mcap",
        argument("files", nargs="+", type=path, metavar="FILE"),
        info,
        "print the contents as JSON, one object per line",
        bus=False,
    ),
    Verb(
        "bag plot",
        "draw the paths and velocities of a bag's robots",
        "square.mcap -o square.svg",
        _plot_arguments,
        plot,
        "print what was drawn as JSON, one object per line",
        bus=False,
    ),
)
