"""What the kernel tells of a group on loopback."""

import socket
import subprocess
import sys
from contextlib import ExitStack

from holozen.testing.wire import free_port
from holozen.transport.connection import GROUP
from holozen.transport.loopback import sockets

OPENS_AND_CLOSES = """
import socket
import time
print("up", flush=True)
while True:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        one.bind(("127.0.0.1", 0))
        time.sleep(0.0005)
"""


def test_who_is_in_a_group_is_seen_at_each_look_while_others_come_and_go() -> None:
    """The kernel's table is longer than a page then, and leaves sockets out."""
    port = free_port()
    with ExitStack() as ending:
        for host, at, count in ((GROUP, port, 40), ("127.0.0.1", 0, 40)):
            for _ in range(count):
                one = ending.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
                one.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
                one.bind((host, at))
        for _ in range(2):
            busy = ending.enter_context(
                subprocess.Popen([sys.executable, "-c", OPENS_AND_CLOSES], stdout=subprocess.PIPE)
            )
            ending.callback(busy.kill)
            assert busy.stdout and busy.stdout.readline() == b"up\n"
        assert {len(sockets(port)) for _ in range(200)} == {40}
