"""Whether anybody looks at this terminal: tmux and screen answer for it also while they are detached.

Both mark that in the mode of their socket: it is executable while a client is attached.
"""

import os
from collections.abc import Callable, Mapping
from pathlib import Path

FOLDERS = ("/run/screen", "/var/run/screen")


def attached(environ: Mapping[str, str] = os.environ) -> Callable[[], bool]:
    """A function that says whether a person may be watching; always true outside of tmux and screen."""
    socket = _socket(environ)
    if socket is None or not socket.exists():
        return lambda: True

    def look() -> bool:
        try:
            return bool(socket.stat().st_mode & 0o100)
        except OSError:
            return False

    return look


def _socket(environ: Mapping[str, str]) -> Path | None:
    if path := environ.get("TMUX", "").partition(",")[0]:
        return Path(path)
    if name := environ.get("STY"):
        folders = [environ["SCREENDIR"]] if environ.get("SCREENDIR") else [f"{at}/S-{_user(environ)}" for at in FOLDERS]
        return next((Path(at) / name for at in folders if (Path(at) / name).exists()), None)
    return None


def _user(environ: Mapping[str, str]) -> str:
    return environ.get("USER") or environ.get("LOGNAME") or ("root" if os.getuid() == 0 else "")
