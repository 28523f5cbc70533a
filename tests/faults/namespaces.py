"""Hosts on one machine: network namespaces joined by cables that can be cut, each with a monotonic
clock of its own.

    with Lab() as lab:
        robot, desk = lab.host("robot"), lab.host("desk", clock=1000) cable = lab.cable(robot, desk)
        sim = robot.start(*command("sim", "--listen", f"tcp/{cable.address(robot)}:7447"))
        cable.cut()

No root is needed, where the kernel lets anybody make user namespaces.
"""

import contextlib
import subprocess
from pathlib import Path
from typing import Any, Self

import pytest

from holozen.testing import Process

NEEDS = pytest.mark.needs("ip", "nsenter", "unshare")


class Lab:
    """Hosts and the cables between them; they end with it. A test is skipped where none can be
    made.
    """

    def __init__(self) -> None:
        allowed = subprocess.run(["unshare", "-rnT", "true"], capture_output=True, text=True)
        if allowed.returncode:
            pytest.skip(f"needs namespaces of its own: {allowed.stderr.strip()}")
        self._ends = contextlib.ExitStack()
        self._owner = self._holder("unshare", "-r")
        self._cables = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_error: object) -> None:
        self._ends.close()

    def host(self, name: str, clock: float = 0) -> "Host":
        """A host with loopback up and nothing else. Its monotonic clock is `clock` seconds ahead of
        this machine's.
        """
        offset = ("--monotonic", f"{clock:.0f}", "--boottime", f"{clock:.0f}") if clock else ()
        host = Host(
            name, self._holder(*_enter(self._owner.pid), "unshare", "-nT", *offset), self._ends
        )
        host.check("ip", "link", "set", "lo", "up")
        return host

    def cable(self, one: "Host", other: "Host") -> "Cable":
        """Join two hosts. Each gets one more interface, with an address in a network that only this
        cable has.
        """
        self._cables += 1
        cable = Cable(self._cables, one, other)
        end, far = cable.interface, ("peer", "name", cable.interface, "netns", str(other.pid))
        one.check("ip", "link", "add", end, "type", "veth", *far)
        for host in (one, other):
            host.check("ip", "address", "add", f"{cable.address(host)}/24", "dev", end)
            host.check("ip", "link", "set", end, "up")
        return cable

    def _holder(self, *words: str) -> Process:
        """A process that does nothing, in the namespaces that `words` make."""
        holder = self._ends.enter_context(
            Process([*words, "sh", "-c", "echo up; exec sleep infinity"])
        )
        holder.wait_for_line("up")
        return holder


class Host:
    """A network namespace, and a time namespace."""

    def __init__(self, name: str, holder: Process, ends: contextlib.ExitStack) -> None:
        self.name, self.pid, self._ends = name, holder.pid, ends

    def inside(self, *words: str) -> list[str]:
        """The command that runs a program on this host."""
        return _enter(self.pid, "-n", f"--time=/proc/{self.pid}/ns/time_for_children") + list(words)

    def start(self, *words: str, **options: Any) -> Process:
        """Start a program here; it ends with the lab. The options are those of Process."""
        process = self._ends.enter_context(Process(self.inside(*words), **options))
        # pytest shows it on failure
        self._ends.callback(
            lambda: print(f"--- {self.name}: {process}\n{process.out}{process.err}")
        )
        return process

    def run(self, *words: str, within: float = 120.0) -> subprocess.CompletedProcess[str]:
        """Run a program here until it ends."""
        return subprocess.run(
            self.inside(*words),
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=within,
        )

    def check(self, *words: str) -> str:
        """Run a program here, and return what it wrote. AssertionError if it fails."""
        done = self.run(*words)
        assert done.returncode == 0, f"{' '.join(words)} on {self.name}: {done.stderr}"
        return done.stdout

    def proc_net(self, name: str) -> list[str]:
        """The lines of a file of /proc/net, such as `tcp`."""
        return Path(f"/proc/{self.pid}/net/{name}").read_text().splitlines()


class Cable:
    """A veth pair between two hosts."""

    def __init__(self, number: int, one: Host, other: Host) -> None:
        self.interface, self._number, self._hosts = f"cable{number}", number, (one, other)

    def address(self, host: Host) -> str:
        """The IPv4 address of a host at this cable."""
        return f"10.99.{self._number}.{1 + self._hosts.index(host)}"

    def cut(self) -> None:
        """Pull the plug: the first host has no route, the other no carrier. `lose(1)` is a cut that
        neither end notices.
        """
        self._hosts[0].check("ip", "link", "set", self.interface, "down")

    def join(self) -> None:
        """Plug it in again."""
        self._hosts[0].check("ip", "link", "set", self.interface, "up")

    def lose(self, share: float) -> None:
        """Drop this share of the packets at random, both ways, from 0 (none) to 1. Needs nft."""
        for host in self._hosts:
            host.run("nft", "delete", "table", "inet", self.interface)
            some = f"numgen random mod 1000 < {share * 1000:.0f}" if share < 1 else ""
            chain = (
                f"chain input {{ type filter hook input priority 0; iifname {self.interface} "
                f"{some} drop; }}"
            )
            host.check("nft", f"table inet {self.interface} {{ {chain}; }}")


def _enter(pid: int, *namespaces: str) -> list[str]:
    return ["nsenter", "--preserve-credentials", "-t", str(pid), "-U", *namespaces, "--"]
