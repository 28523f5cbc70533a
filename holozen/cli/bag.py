"""`holozen bag`: info and plot; record and play, as ROS 2 names `holozen record` and `holozen replay`."""

import argparse
import json

from holozen.cli.verb import Noun, Verb, argument, by_name
from holozen.console import printable
from holozen.flags import path


def info(args: argparse.Namespace) -> int:
    """Print what is in each file."""
    from holozen.bag.reader import Bag, summarize

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
    from holozen.bag.drawing import draw
    from holozen.bag.reader import recorded

    target = args.output or recorded(args.file).with_suffix(".png")
    drawn = draw(args.file, target, args.topics)
    if args.json:
        print(json.dumps({"file": str(args.file), "picture": str(target), "topics": drawn}))
    else:
        print(printable(f"{target}: {', '.join(f'{key} ({count} messages)' for key, count in drawn.items())}"))
    return 0


def _plot_arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("file", type=path, metavar="FILE")
    add("-o", "--output", type=path, metavar="PICTURE", help=".png or .svg (default: FILE with .png)")
    add("--topics", nargs="+", metavar="KEY", help="only these keys of odometry")


VERBS = by_name(
    Noun("bag", "record, play and inspect bags: MCAP files of messages",
        {"record": "record", "play": "replay"}),
    Verb("bag info", "show what is in a bag: counts, missing messages, rates", "square.mcap",
        argument("files", nargs="+", type=path, metavar="FILE"), info,
        "print the contents as JSON, one object per line", bus=False),
    Verb("bag plot", "draw the paths and velocities of a bag's robots", "square.mcap -o square.svg", _plot_arguments,
        plot, "print what was drawn as JSON, one object per line", bus=False),
)  # fmt: skip
