"""Limits by which one peer cannot end or occupy a process: Zenoh's own are for peers that behave.

Imported before Zenoh, whose threads have the stack that the environment gives when the first one
starts.
"""

import os

# Zenoh walks the tree of declared keys by recursion. The longest key, 64 KiB, has 32,767 chunks:
# they overflow 2 MB.
os.environ.setdefault("RUST_MIN_STACK", str(16 << 20))

# bytes, by default; Zenoh takes memory for 1 GB of a message before anyone asked for it
LARGEST_MESSAGE = 256 << 20
SETTINGS: dict[str, object] = {
    # Links that wait to be accepted: Zenoh's 100, of 10 s each, are taken by 100 connections that
    # send nothing.
    "transport/unicast/accept_pending": 4000,
    # ms: two round trips of the slowest link that is kept, see LEASE
    "transport/unicast/accept_timeout": 3000,
    "transport/link/rx/max_message_size": LARGEST_MESSAGE,
}
