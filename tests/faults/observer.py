"""A program that prints each odom of a robot: when the sim sent it (s, of the sim's monotonic
clock), its speed (m/s).

python observer.py ENDPOINT
"""

import sys
import time

from holozen.bus import Bus, BusError, Connection
from holozen.messages import Odometry
from holozen.process import stop_event
from holozen.testing.wire import STAMPED


def main(endpoint: str) -> None:
    stop = stop_event()
    with Bus(
        "observer", Connection(mode="client", connect=(endpoint,), cfg=(STAMPED,)), stop=stop
    ) as bus:
        odometry = bus.subscribe("odom", Odometry, depth=1000)
        while not stop.wait(0.01):
            try:
                while (received := odometry.try_recv()) is not None:
                    if received.message and received.timestamp:
                        sent = received.timestamp[0] * 1e-9 - (time.time() - time.monotonic())
                        linear = received.message.twist.twist.linear
                        print(sent, f"{(linear.x**2 + linear.y**2) ** 0.5:.4f}", flush=True)
            except BusError:
                return


if __name__ == "__main__":
    main(sys.argv[1])
