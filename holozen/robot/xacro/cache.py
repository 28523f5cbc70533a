"""Expanded texts in the user's cache folder, each with what it was made from.

An entry that is damaged, foreign or of other inputs is as good as none, and a folder that cannot be written is no
reason to fail.
"""

import contextlib
import hashlib
import json
import os
from pathlib import Path
from typing import Any

MOST_ENTRIES = 64
MOST_BYTES = 1_000_000  # of one entry


def folder() -> Path | None:
    """`holozen/xacro` in $XDG_CACHE_HOME or ~/.cache; None where neither is a full path."""
    given = os.environ.get("XDG_CACHE_HOME", "")
    home = given if os.path.isabs(given) else os.path.join(os.path.expanduser("~"), ".cache")
    return Path(home, "holozen", "xacro") if os.path.isabs(home) else None


def load(key: str) -> dict[str, Any] | None:
    """The entry that was stored under `key`, if it is whole and ours."""
    try:
        path = _path(key)
        with open(path, "rb") as file:
            mine = os.fstat(file.fileno()).st_uid == os.getuid()
            head, _, body = file.read(2 * MOST_BYTES).partition(b"\n")
        if not mine or head != _sum(body):
            return None
        entry = json.loads(body)
        return entry if entry["key"] == key else None
    except (OSError, ValueError):
        return None


def store(key: str, entry: dict[str, Any]) -> None:
    """Keep an entry, whole or not at all; then forget the oldest beyond MOST_ENTRIES."""
    body = json.dumps(entry | {"key": key}).encode()
    if len(body) > MOST_BYTES:
        return
    with contextlib.suppress(OSError, ValueError):
        path = _path(key)
        path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        part = path.with_suffix(f".{os.getpid()}.part")
        try:
            part.write_bytes(_sum(body) + b"\n" + body)
            part.replace(path)
        finally:
            part.unlink(missing_ok=True)
        _forget(path.parent)


def _path(key: str) -> Path:
    place = folder()
    if place is None:
        raise OSError("no cache folder")
    return place / f"{hashlib.sha256(key.encode('utf-8', 'surrogateescape')).hexdigest()[:32]}.json"


def _sum(body: bytes) -> bytes:
    return hashlib.sha256(body).hexdigest().encode()


def _forget(place: Path) -> None:
    # The parts of processes that were killed are among them.
    kept = sorted(place.iterdir(), key=lambda path: path.stat().st_mtime_ns)
    for path in kept[:-MOST_ENTRIES]:
        path.unlink(missing_ok=True)
