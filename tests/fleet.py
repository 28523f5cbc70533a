"""A fleet in the secure set-up: a router, a sim, and members."""

import contextlib
import json
import shutil
from pathlib import Path
from typing import Any

import zenoh

from holozen.bus import Bus
from holozen.secure import authority
from holozen.testing import Process
from holozen.testing.wire import command, free_port
from holozen.transport.connection import Connection


class Fleet:
    """A router and a sim in the secure set-up, and buses of its members."""

    def __init__(self, root: Path, *sim: str) -> None:
        self.root, self._ends = root, contextlib.ExitStack()
        authority.initialize(root, [], 1)
        for name, role in (("Ann", "operator"), ("Eve", "autopilot"), ("Old", "operator")):
            authority.add(root, role, name, 1)
        shutil.copytree(root / "Old", root.parent / "Old")  # a revoked member keeps a copy
        authority.revoke(root, "Old")
        self.endpoint = f"tls/127.0.0.1:{free_port()}"
        self.start_router()
        self._sim = sim
        self.sim = self.start_sim()

    def start_router(self) -> None:
        """The router, or another one in its place."""
        self.router = self.start("router", "--listen", self.endpoint)
        self.router.wait_for_line("listens at", 60)

    def start_sim(self) -> Process:
        """A sim that listens, with the flags of this fleet."""
        sim = self.start("sim", *self._sim, "--connect", self.endpoint)
        sim.wait_for_line("listens on", 60)
        return sim

    def start(self, verb: str, *words: str, folder: str = "") -> Process:
        """Start `holozen VERB WORDS...`, which ends with the fleet."""
        return self.run(*command(verb, *words, "--secure", str(self.root / folder)))

    def run(self, *words: str, **options: Any) -> Process:
        """Start a program, which ends with the fleet. Options are those of Process."""
        process = Process(words, **options)
        self._ends.callback(lambda: print(f"--- {process}\n{process.out}{process.err}"))
        return self._ends.enter_context(process)

    def bus(self, name: str, **more: Any) -> Bus:
        connection = Connection(
            "client", connect=(self.endpoint,), secure=str(self.root / name), **more
        )
        return self._ends.enter_context(Bus("test", connection))

    def tool(self, name: str, **more: object) -> zenoh.Session:
        """A plain Zenoh session with the certificate of a member, or of `Old`, whom it was taken
        from. `more`: settings of Zenoh, with two underscores for a slash. Raises zenoh.ZError.
        """
        tls, folder = (
            "transport/link/tls",
            self.root.parent / name if name == "Old" else self.root / name,
        )
        values: dict[str, object] = {
            "mode": "client",
            "connect/endpoints": [self.endpoint],
            "connect/timeout_ms": 5000,
            "connect/exit_on_failure": True,
            "listen/endpoints": [],
            "scouting/multicast/enabled": False,
            f"{tls}/root_ca_certificate": f"{folder}/ca.pem",
            f"{tls}/connect_certificate": f"{folder}/cert.pem",
            f"{tls}/connect_private_key": f"{folder}/key.pem",
            f"{tls}/enable_mtls": True,
        }
        config = zenoh.Config()
        for path, value in (
            values | {name.replace("__", "/"): value for name, value in more.items()}
        ).items():
            config.insert_json5(path, json.dumps(value))
        return zenoh.open(config)

    def close(self) -> None:
        self._ends.close()
