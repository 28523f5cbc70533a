"""`holozen topic hz`: how often messages come."""

import argparse
import statistics
import threading
import time
from collections import deque
from itertools import pairwise

from holozen import connection
from holozen.bus import Bus
from holozen.errors import BusError
from holozen.process import stop_event
from holozen.tell import say

EVERY = 1.0  # s between two lines


def hz(args: argparse.Namespace) -> int:
    """Print the average rate, and the shortest, longest and typical deviation of the gaps, once a second."""
    stop = stop_event()
    arrivals: deque[float] = deque(maxlen=max(args.window, 2))
    with Bus("topic_hz", connection.from_arguments(args), patience=3.0) as bus:
        tap = bus.tap(args.key)

        def listen() -> None:
            while True:
                try:
                    tap.recv()
                except BusError:
                    return
                arrivals.append(time.monotonic())

        threading.Thread(target=listen, daemon=True).start()
        seen = 0.0
        while not stop.wait(EVERY):
            times = list(arrivals)
            if len(times) < 2 or times[-1] == seen:
                say(f"no new messages on {args.key}")
            else:
                seen = times[-1]
                print(rate(times), flush=True)
    return 0


def rate(times: list[float]) -> str:
    """The line for arrivals at `times`, in seconds; at least two."""
    gaps = [later - earlier for earlier, later in pairwise(times)]
    average = len(gaps) / sum(gaps) if sum(gaps) else 0.0
    return (
        f"average rate: {average:.3f}\n"
        f"\tmin: {min(gaps):.4f}s max: {max(gaps):.4f}s std dev: {statistics.pstdev(gaps):.5f}s window: {len(times)}"
    )
