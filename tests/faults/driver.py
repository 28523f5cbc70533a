"""A program that drives a robot at 20 Hz until its end is requested. It prints when it begins to
send each command, and when it has (s, monotonic).

python driver.py ENDPOINT [FOLDER]

It is not a lasting node, just like `holozen topic pub`: when it dies the robot stands by the
silence alone. With the folder of a member it is a node, in the secure set-up.
"""

import sys
import time

from holozen.bus import Bus, Connection
from holozen.messages import Twist
from holozen.process import stop_event

RATE = 20.0  # Hz


def main(endpoint: str, secure: str = "") -> None:
    stop = stop_event()
    where = Connection(mode="client", connect=(endpoint,), secure=secure)
    with Bus("driver", where, lasting=bool(secure), stop=stop) as bus:
        commands = bus.publisher("cmd_vel", Twist)
        while not stop.wait(1 / RATE):
            print("begin", time.monotonic(), flush=True)
            commands.put(Twist.planar(0.3))
            print("end", time.monotonic(), flush=True)
        commands.put(Twist())


if __name__ == "__main__":
    main(*sys.argv[1:])
