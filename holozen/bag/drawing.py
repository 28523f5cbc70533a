"""A picture of a bag: the robots' paths, and their velocities beside what was commanded."""

from pathlib import Path
from typing import Any

from holozen.bag.errors import BagError
from holozen.bag.reader import Bag
from holozen.bag.tracks import Track, Tracks, tracks

FORMATS = (".png", ".svg")
SIZE = (12.0, 6.0)  # inches
PANELS = ((3, "forward in m/s"), (4, "left in m/s"), (5, "turn in rad/s"))  # column of a track, title


def draw(source: Path, target: Path, keys: list[str] | None = None) -> dict[str, int]:
    """Draw the bag `source` into the picture `target`; the keys drawn, with their numbers of messages.

    Raises BagError, also where there is nothing to draw.
    """
    if target.suffix.lower() not in FORMATS:
        raise BagError(f"{target}: pictures end in {' or '.join(FORMATS)}")
    with Bag(source) as bag:
        found = tracks(bag.messages())
    if missing := [key for key in keys or () if key not in found.odometry]:
        raise BagError(f"{source} has no odometry on {', '.join(missing)}; on: {', '.join(found.odometry) or 'none'}")
    if not found.odometry:
        raise BagError(f"{source} has no odometry to draw; `holozen bag info` shows what it has")
    if keys:
        found.odometry = {key: found.odometry[key] for key in keys}
    try:
        _figure(found, source.name).savefig(target, dpi=100)
    except OSError as error:
        raise BagError(f"cannot write {target}: {error.strerror or error}") from None
    return {track.key: track.count for track in (*found.odometry.values(), *found.commands.values())}


def _figure(found: Tracks, title: str) -> Any:
    from matplotlib.figure import Figure

    figure = Figure(figsize=SIZE, layout="constrained")
    halves: Any = figure.subfigures(1, 2)
    left, right = halves
    figure.suptitle(title)
    path, panels = left.subplots(), right.subplots(len(PANELS), 1, sharex=True)
    for index, track in enumerate(found.odometry.values()):
        _draw_path(path, track, f"C{index % 10}")
        for panel, (column, _) in zip(panels, PANELS, strict=True):
            panel.plot(track.column(0), track.column(column), color=f"C{index % 10}", label=track.key)
            if command := found.commands.get(track.key.removesuffix("odom") + "cmd_vel"):
                panel.plot(command.column(0), command.column(column), ":", color="0.4", label=command.key)
    path.set(xlabel="x in m", ylabel="y in m", aspect="equal")
    path.legend()
    for panel, (_, name) in zip(panels, PANELS, strict=True):
        panel.set_ylabel(name)
        panel.grid(alpha=0.3)
    panels[0].legend(fontsize="small")
    panels[-1].set_xlabel("s")
    return figure


def _draw_path(panel: Any, track: Track, color: str) -> None:
    x, y = track.column(1), track.column(2)
    panel.plot(x, y, color=color, label=track.key)
    panel.plot(x[:1], y[:1], "o", color=color)  # a dot where it began, a square where it ended
    panel.plot(x[-1:], y[-1:], "s", color=color)
    panel.grid(alpha=0.3)
