"""A TCP link with faults that a test sets while it runs: delay, jitter, a rate limit, a stall, a
black hole.

As a program, for another host: python proxy.py HOST PORT DELAY; it prints its own port on loopback.
"""

import contextlib
import math
import random
import socket
import sys
import threading
import time
from collections import deque
from dataclasses import dataclass
from typing import Self

SEGMENT = 1448  # bytes; of TCP over Ethernet
CHUNK = 65536  # bytes read at once
BUFFER = 4 << 20  # bytes that wait in one direction of a connection before its sender is held up


@dataclass
class Faults:
    """What happens to the bytes of one direction. Each value can be set at any time, for what is
    sent from then on.

    `delay` and `jitter` are seconds: each chunk takes `delay` and a random part of `jitter`, and
    none overtakes another, as in TCP. `rate` is in bytes/s; 0 is no limit. `loss` is the part of
    the segments that is lost: what it hits comes a round trip later, and all behind it waits, as
    where TCP sends it again at once. `stalled` holds everything back, and delivers it once it is
    False again. `lost` drops everything: the connections that lose bytes stay silent for ever, as
    behind a router that has forgotten them, and those opened afterwards work.
    """

    delay: float = 0.0
    jitter: float = 0.0
    rate: float = 0.0
    loss: float = 0.0
    stalled: bool = False
    lost: bool = False


class Proxy:
    """A link from a free loopback port to another: `upstream` is the way to that port, `downstream`
    the way back.

    A new connection takes a round trip before it carries anything, as TCP's own handshake does.
    """

    def __init__(self, port: int, host: str = "127.0.0.1") -> None:
        self._target = (host, port)
        self.upstream, self.downstream = Faults(), Faults()
        self._closing = threading.Event()
        self._ends: list[socket.socket] = []
        self.ways: list[_Way] = []
        self._threads: list[threading.Thread] = []
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port: int = self._listener.getsockname()[1]
        self.endpoint = f"tcp/127.0.0.1:{self.port}"
        self._start(self._accept)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_error: object) -> None:
        self.close()

    @property
    def carried(self) -> int:
        """The bytes that came to it so far, both ways."""
        return sum(way.carried for way in self.ways)

    def set(self, **values: float) -> None:
        """Set faults of both directions alike."""
        for faults in (self.upstream, self.downstream):
            for name, value in values.items():
                setattr(faults, name, value)

    def stall(self) -> None:
        """Hold everything back, both ways; neither end sees that the link is down."""
        self.set(stalled=True)

    def resume(self) -> None:
        """Deliver what was held back, and carry on."""
        self.set(stalled=False)

    def reset(self) -> None:
        """End all connections. Both ends see it; new connections are carried."""
        for end in self._ends:
            with contextlib.suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)

    def close(self) -> None:
        """End the link and all its connections."""
        self._closing.set()
        with contextlib.suppress(OSError):
            self._listener.shutdown(socket.SHUT_RDWR)
        self._threads[0].join()  # no connection is added from here on
        self.reset()
        for thread in self._threads:
            thread.join()
        for end in (self._listener, *self._ends):
            end.close()

    def _start(self, work: object, *args: object) -> None:
        assert callable(work)
        self._threads.append(threading.Thread(target=work, args=args, daemon=True))
        self._threads[-1].start()

    def _accept(self) -> None:
        while not self._closing.is_set():
            try:
                near = self._listener.accept()[0]
            except OSError:
                return
            try:
                far = socket.create_connection(self._target)
            except OSError:  # no listener there: refused here too
                near.close()
                continue
            for end in (near, far):
                end.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._ends += [near, far]
            there = time.monotonic() + self.upstream.delay
            back = there + self.downstream.delay
            for way in (
                _Way(near, far, self.upstream, back, self._closing),
                _Way(far, near, self.downstream, there, self._closing),
            ):
                self.ways.append(way)
                self._start(way.read)
                self._start(way.write)


class _Way:
    """One direction of one connection: a thread reads and one writes, and what is under way waits
    between them.
    """

    def __init__(
        self,
        source: socket.socket,
        target: socket.socket,
        faults: Faults,
        opened: float,
        closing: threading.Event,
    ) -> None:
        self._source, self._target, self._faults, self._closing = source, target, faults, closing
        # when to deliver, and what; b"" is the end
        self._waiting: deque[tuple[float, bytes]] = deque()
        self.size = 0  # bytes that wait
        self.carried = 0  # bytes that came so far
        self._opened = self._due = opened
        self.has_lost = False  # bytes, and says nothing from then on
        self._changed = threading.Condition()

    def read(self) -> None:
        data = b"."
        while data:
            try:
                data = self._source.recv(CHUNK)
            except OSError:
                data = b""
            with self._changed:
                self._put(data)
                while self.size > BUFFER and not self._closing.is_set():
                    self._changed.wait(0.01)

    def _put(self, data: bytes) -> None:
        faults = self._faults
        self.has_lost |= faults.lost
        if self.has_lost and data:
            return
        sent = max(time.monotonic(), self._opened)
        if faults.rate:
            sent = max(sent, self._due - faults.delay) + len(data) / faults.rate
        took = faults.delay + random.uniform(0, faults.jitter)
        if random.random() > (1 - faults.loss) ** math.ceil(len(data) / SEGMENT):
            took += 2 * faults.delay
        self._due = max(self._due, sent + took)
        self._waiting.append((self._due, data))
        self.size += len(data)
        self.carried += len(data)
        self._changed.notify_all()

    def write(self) -> None:
        while not self._closing.is_set():
            with self._changed:
                if not self._waiting or self._faults.stalled:
                    self._changed.wait(0.005)
                    continue
                due, data = self._waiting[0]
                if (left := due - time.monotonic()) > 0:
                    self._changed.wait(min(left, 0.05))
                    continue
                self._waiting.popleft()
                self.size -= len(data)
                self._changed.notify_all()
            try:
                if data:
                    self._target.sendall(data)
                else:
                    self._target.shutdown(socket.SHUT_WR)
            except OSError:
                return
            if not data:
                return


if __name__ == "__main__":
    with Proxy(int(sys.argv[2]), sys.argv[1]) as link:
        link.set(delay=float(sys.argv[3]))
        print(f"port {link.port}", flush=True)
        time.sleep(3600)
