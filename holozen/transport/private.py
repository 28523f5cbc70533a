"""The folder of `--private`: its Unix sockets are the endpoints of one user's processes.

A process that connects to a Unix socket needs access to its folder, which the kernel grants only to
the owner and root.
"""

import contextlib
import fcntl
import os
import stat
from pathlib import Path

from holozen.transport.errors import BusError

# Of its path: the kernel takes 107 for a socket in it.
MAX_FOLDER_BYTES = 107 - len("/232-4194304-00000000.lock")


def folder() -> str:
    """The path of the folder, made where it is missing. Raises BusError if another user may enter
    or alter it.
    """
    uid = os.geteuid()
    base = os.environ.get("XDG_RUNTIME_DIR", "")
    path = Path(base).resolve() / "holozen" if base else Path(f"/tmp/holozen-{uid}")
    advice = f"; unset XDG_RUNTIME_DIR to use /tmp/holozen-{uid}" if base else ""
    try:
        for parent in path.parents:
            found = parent.stat()
            if found.st_uid not in (0, uid) or (
                found.st_mode & 0o022 and not found.st_mode & stat.S_ISVTX
            ):
                raise BusError(
                    f"cannot be private in {path}: other users may alter {parent}{advice}"
                )
        with contextlib.suppress(FileExistsError):
            path.mkdir(0o700)
        found = path.lstat()
    except OSError as error:
        raise BusError(f"cannot be private in {path}: {error.strerror}{advice}") from None
    if (
        not stat.S_ISDIR(found.st_mode)
        or found.st_uid != uid
        or stat.S_IMODE(found.st_mode) != 0o700
    ):
        raise BusError(
            f"cannot be private in {path}: it is not a folder of yours with mode 0700; remove it"
        )
    text = str(path)
    if (
        len(os.fsencode(text)) > MAX_FOLDER_BYTES
        or not text.isprintable()
        or set(text) & set(" #?;")
    ):
        raise BusError(
            f"cannot be private in {path}: Zenoh takes at most {MAX_FOLDER_BYTES} bytes, none of "
            f"them ' #?;'{advice}"
        )
    _remove_stale(path)
    return text


def sockets(folder: str, domain: int, router: str) -> list[str]:
    """The paths of the sockets of a domain where processes listen, those that hang included.
    `router`: its router's.
    """
    paths = [router, *(str(lock.with_suffix("")) for lock in Path(folder).glob(f"{domain}-*.lock"))]
    return [path for path in paths if is_locked(path)]


def is_locked(socket: str) -> bool:
    """Whether a process listens at a socket: it holds Zenoh's lock beside it. Raises OSError."""
    try:
        with open(f"{socket}.lock", "rb") as lock:
            # A shared lock, so that two processes that check at the same time do not see each
            # other's.
            fcntl.flock(lock, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except FileNotFoundError:
        return False
    except BlockingIOError:
        return True
    return False


def _remove_stale(path: Path) -> None:
    """Remove the sockets of processes that were killed."""
    for lock in path.glob("*-*.lock"):
        socket = lock.with_suffix("")
        pid = socket.name.split("-")[-2]
        # A pid without a process here may be one of another container, which holds the lock.
        with contextlib.suppress(OSError):
            if not Path("/proc", pid).exists() and not is_locked(str(socket)):
                socket.unlink(missing_ok=True)
                lock.unlink()
