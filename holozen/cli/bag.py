"""`holozen bag`: info and plot; record and play, as ROS 2 names them."""

import argparse
import json
from typing import TYPE_CHECKING

from holozen import cli
from holozen.console import printable, report
from holozen.flags import Parser

if TYPE_CHECKING:
    from pathlib import Path

VERBS = {"record": "record", "play": "replay"}  # the same as `holozen record` and `holozen replay`
EXAMPLES = {"record": "record odom cmd_vel -o square", "play": "play square.mcap -r 2"}


def parser() -> argparse.ArgumentParser:
    parser = Parser(prog="holozen bag", description="Record, play and inspect bags: MCAP files of messages.")
    verbs = parser.add_subparsers(dest="verb", required=True, metavar="VERB", prog=parser.prog)
    help_line = "what is in a bag: counts, missing messages, rates"
    add = verbs.add_parser(
        "info", help=help_line, description=help_line, epilog="example: holozen bag info square.mcap"
    )
    add.add_argument("files", nargs="+", type=_file, metavar="FILE")
    add.add_argument("--json", action="store_true", help="one JSON object per file and line")
    help_line = "draw the paths and velocities of a bag's robots"
    add = verbs.add_parser(
        "plot", help=help_line, description=help_line, epilog="example: holozen bag plot square.mcap -o square.svg"
    )
    add.add_argument("file", type=_file, metavar="FILE")
    add.add_argument("-o", "--output", type=_file, metavar="PICTURE", help=".png or .svg (default: FILE with .png)")
    add.add_argument("--topics", nargs="+", metavar="KEY", help="only these keys of odometry")
    add.add_argument("--json", action="store_true", help="what was drawn, as one JSON object")
    for name, verb in VERBS.items():
        same = f"the same as `holozen {verb}`"
        verbs.add_parser(name, help=same, description=same, epilog=f"example: holozen bag {EXAMPLES[name]}",
            parents=[cli.command(verb).parser()], add_help=False)  # fmt: skip
    return parser


def _file(text: str) -> "Path":
    from pathlib import Path

    return Path(text)


def main(argv: list[str]) -> int:
    if argv and argv[0] in VERBS:
        code: int = cli.command(VERBS[argv[0]]).main(argv[1:])
        return code
    args = parser().parse_args(argv)
    from holozen.bag import BagError

    try:
        return {"info": info, "plot": plot}[args.verb](args)
    except BagError as error:
        report(f"holozen bag {args.verb}: {error}")
        return 1


def info(args: argparse.Namespace) -> int:
    """Print what is in each file."""
    from holozen.bag.reader import Bag, summarize

    for path in args.files:
        with Bag(path) as bag:
            summary = summarize(bag)
        if args.json:
            print(json.dumps(summary.figures()), flush=True)
        else:
            print("\n".join(map(printable, summary.lines())), flush=True)
    return 0


def plot(args: argparse.Namespace) -> int:
    """Draw a file's odometry into a picture."""
    from holozen.bag.drawing import draw

    target = args.output or args.file.with_suffix(".png")
    drawn = draw(args.file, target, args.topics)
    if args.json:
        print(json.dumps({"file": str(args.file), "picture": str(target), "topics": drawn}))
    else:
        print(printable(f"{target}: {', '.join(f'{key} ({count} messages)' for key, count in drawn.items())}"))
    return 0
