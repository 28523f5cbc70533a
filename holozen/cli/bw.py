"""`holozen topic bw`: how many bytes a second come."""

from holozen.cli.noun import Verb
from holozen.cli.spread import jitter, spread
from holozen.cli.watch import Window, arguments, lost_words, watch

TYPE_CHECKING = False
if TYPE_CHECKING:
    import argparse

    from holozen.cli.watch import Report

WINDOW = 100  # messages, as in ROS 2


def bw(args: "argparse.Namespace") -> int:
    """Print the bytes a second and how the messages' sizes spread, once a second."""
    return watch(args, lambda sample, _now: float(sample.size), bandwidth, text)


def bandwidth(window: Window) -> "Report":
    """The bytes a second and the sizes in bytes. Empty for fewer than two messages."""
    sizes, times = list(window.values), list(window.times)
    span = times[-1] - times[0]
    if len(sizes) < 2:
        return {}
    # The first message begins the time, and so does not count.
    return {
        "bytes_per_second": sum(sizes[1:]) / span if span else 0.0,
        **spread(sizes),
        "jitter": jitter(sizes),
        "window": len(sizes),
    }


def text(report: "Report") -> str:
    """A report as ROS 2 shows it, and a line more."""
    return (
        f"{size(report['bytes_per_second'])}/s from {report['window']} messages\n"
        f"\tMessage size mean: {size(report['mean'])} min: {size(report['min'])} max: {size(report['max'])}\n"
        f"\tp50: {size(report['p50'])} p95: {size(report['p95'])} p99: {size(report['p99'])}"
        f" jitter: {size(report['jitter'])}{lost_words(report)}"
    )


def size(count: float) -> str:
    """Bytes in a unit that is easy to read; 1 KB is 1000 B."""
    for unit in ("B", "KB", "MB"):
        if count < 1000:
            return f"{count:.0f} B" if unit == "B" else f"{count:.2f} {unit}"
        count /= 1000
    return f"{count:.2f} GB"


def _arguments(parser: "argparse.ArgumentParser") -> None:
    arguments(parser, WINDOW)


VERBS = {"bw": Verb("how many bytes a second come", "holozen topic bw odom", _arguments, bw)}
