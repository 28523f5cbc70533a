"""The disk, and Docker. Nothing is run: a Docker that hangs must not hold up the rest."""

import os
import shutil
import socket
from collections.abc import Iterator, Mapping

from holozen.doctor.finding import ERROR, OK, WARNING, Finding

LOW, FULL = 1_000_000_000, 50_000_000  # bytes
PATIENCE = 0.5  # s for Docker's daemon
SOCKET = "/var/run/docker.sock"
PLUGINS = (
    "~/.docker/cli-plugins", "/usr/libexec/docker/cli-plugins", "/usr/lib/docker/cli-plugins",
    "/usr/local/lib/docker/cli-plugins", "/usr/local/libexec/docker/cli-plugins",
)  # fmt: skip
PING = b"GET /_ping HTTP/1.1\r\nHost: docker\r\nConnection: close\r\n\r\n"


def disk(path: str = ".") -> Finding:
    """Whether there is room where one works."""
    try:
        here = os.path.abspath(path)
        free = shutil.disk_usage(here).free
    except OSError as error:
        return Finding("disk", ERROR, f"the working folder cannot be looked at: {error.strerror}", "go to another one")
    text = f"{free / 1e9:.1f} GB free at {here}"
    if free > LOW:
        return Finding("disk", OK, text)
    return Finding("disk", ERROR if free < FULL else WARNING, text, "make room: bags and images take much")


def docker(environ: Mapping[str, str] = os.environ) -> Iterator[Finding]:
    """Whether compose is there and the daemon answers. Docker is not needed, so nothing of it is an error."""
    client = shutil.which("docker", path=environ.get("PATH"))
    compose = shutil.which("docker-compose", path=environ.get("PATH"))
    if not client and not compose:
        yield Finding("docker", OK, "not installed; only `docker-compose up` needs it, `scripts/up` does not")
        return
    if not compose and not any(os.access(os.path.expanduser(f"{at}/docker-compose"), os.X_OK) for at in PLUGINS):
        yield Finding("docker", WARNING, "there is no compose", "on Debian: apt install docker-compose")
    yield daemon(environ.get("DOCKER_HOST") or f"unix://{SOCKET}")


def daemon(host: str) -> Finding:
    """Whether Docker's daemon answers at `host`."""
    kind, _, place = host.partition("://")
    if kind not in ("unix", "tcp"):
        return Finding("docker", OK, f"the daemon is at {host}, which is not looked at")
    try:
        answer = _ping(kind, place)
    except PermissionError:
        mend = "sudo usermod -aG docker $USER, and log in anew"
        return Finding("docker", WARNING, f"you may not use the daemon at {host}", mend)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        return Finding("docker", WARNING, f"no daemon answers at {host}: {reason}", "sudo systemctl start docker")
    if b" 200 " not in answer.partition(b"\r\n")[0] + b" ":
        return Finding("docker", WARNING, f"what answers at {host} is no Docker", "look at DOCKER_HOST")
    return Finding("docker", OK, f"the daemon answers at {host}")


def _ping(kind: str, place: str) -> bytes:
    host, _, port = place.partition("/")[0].rpartition(":")
    with socket.socket(socket.AF_UNIX if kind == "unix" else socket.AF_INET) as client:
        client.settimeout(PATIENCE)
        client.connect(place if kind == "unix" else (host, int(port)))
        client.sendall(PING)
        return client.recv(1000)
