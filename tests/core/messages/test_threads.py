"""Several threads may be the first to decode messages of a type."""

import subprocess
import sys
from collections.abc import Callable

CODE = """
import sys, threading
from holozen.messages import codec
from holozen.messages import simulation_interfaces as s, nav_msgs as n

sys.setswitchinterval(1e-6)
kinds = (s.GetEntityStateReply, n.Odometry)
payloads = [(kind, codec.encode(kind())) for kind in kinds for _ in range(8)]
start = threading.Barrier(len(payloads))

def decode(kind, payload):
    start.wait()
    assert codec.decode(payload, "application/json", (kind,)) == kind()

threads = [threading.Thread(target=decode, args=each) for each in payloads]
for thread in threads:
    thread.start()
for thread in threads:
    thread.join()
"""


def test_threads_that_decode_the_first_message_of_a_type_do_not_crash(
    trials: Callable[[int, int], int],
) -> None:
    for _ in range(trials(4, 20)):
        done = subprocess.run(
            [sys.executable, "-c", CODE], capture_output=True, text=True, timeout=60
        )
        assert (done.returncode, done.stderr) == (0, "")
