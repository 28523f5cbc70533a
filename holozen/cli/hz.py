"""`holozen topic hz`: how often messages come."""

from itertools import pairwise

from holozen.cli.noun import Verb
from holozen.cli.spread import jitter, spread
from holozen.cli.watch import arguments, lost_words, watch

TYPE_CHECKING = False
if TYPE_CHECKING:
    import argparse

    from holozen.cli.watch import Report

WINDOW = 10_000  # messages, as in ROS 2


def hz(args: "argparse.Namespace") -> int:
    """Print the average rate and how the gaps between arrivals spread, once a second."""
    return watch(args, lambda _sample, now: now, lambda window: rate(list(window.times)), text)


def rate(times: list[float]) -> "Report":
    """What arrivals at `times`, in seconds, say: the rate in Hz, and the gaps in seconds. Empty for fewer than two."""
    gaps = [later - earlier for earlier, later in pairwise(times)]
    if not gaps:
        return {}
    told = spread(gaps)
    average = 1 / told["mean"] if told["mean"] else 0.0
    return {"rate": average, **told, "jitter": jitter(gaps), "window": len(times)}


def text(report: "Report") -> str:
    """A report as ROS 2 shows it, and a line more."""
    return (
        f"average rate: {report['rate']:.3f}\n"
        f"\tmin: {report['min']:.4f}s max: {report['max']:.4f}s std dev: {report['std_dev']:.5f}s"
        f" window: {report['window']}\n"
        f"\tp50: {report['p50']:.4f}s p95: {report['p95']:.4f}s p99: {report['p99']:.4f}s"
        f" jitter: {report['jitter']:.5f}s{lost_words(report)}"
    )


def _arguments(parser: "argparse.ArgumentParser") -> None:
    arguments(parser, WINDOW)


VERBS = {"hz": Verb("how often messages come, how evenly, how many are lost", "holozen topic hz odom", _arguments, hz)}
