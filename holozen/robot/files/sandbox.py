"""Permanently denies this process what an attacker could abuse: files, the network, other
processes.

Landlock (Linux 5.13 and later) limits the files, seccomp the system calls. Sources: the kernel's
Documentation/userspace-api/landlock.rst and seccomp_filter.rst, and its tables of system calls.
"""

import ctypes
import os
import resource
import struct
from collections.abc import Iterable
from contextlib import suppress

from holozen.system import IS_LINUX

# landlock_create_ruleset, _add_rule, _restrict_self; on every machine
_CREATE, _ADD, _RESTRICT = (444, 445, 446)
_READ_FILE, _READ_FOLDER = 1 << 2, 1 << 3
# ABI -> the rights on files that it knows, all of which are taken: execute, read, write, make,
# remove, refer (2), truncate (3), ioctl on devices (5).
_RIGHTS = {1: (1 << 13) - 1, 2: (1 << 14) - 1, 3: (1 << 15) - 1, 5: (1 << 16) - 1}
_TCP = (4, 0b11)  # from ABI 4: bind and connect
_SCOPES = (6, 0b11)  # from ABI 6: abstract sockets, and signals to others
_NO_NEW_PRIVILEGES, _SECCOMP, _FILTER = 38, 22, 2  # of prctl
_DENIED = {
    "x86_64": (
        0xC000003E,
        (
            41,
            42,
            425,  # socket, connect, io_uring_setup
            56,
            57,
            58,
            435,
            59,
            322,  # clone, fork, vfork, clone3, execve, execveat
            # kill, tkill, tgkill, pidfd_open, ptrace, process_vm_readv, _writev
            62,
            200,
            234,
            434,
            101,
            310,
            311,
            # chmod, fchmod, fchmodat, fchmodat2, chown, fchown, lchown, fchownat
            90,
            91,
            268,
            452,
            92,
            93,
            94,
            260,
            132,
            235,
            261,
            280,  # utime, utimes, futimesat, utimensat
            # setxattr, l..., f..., ...at, removexattr, l..., f..., ...at
            188,
            189,
            190,
            463,
            197,
            198,
            199,
            466,
            # setrlimit, prlimit64, unshare, setns, memfd_create, memfd_secret
            160,
            302,
            272,
            308,
            319,
            447,
            # shm..., sem..., msg..., keys
            *range(29, 32),
            *range(64, 67),
            *range(68, 72),
            *range(248, 251),
        ),
    ),
    "aarch64": (  # which has fewer of them
        0xC00000B7,
        (
            198,
            203,
            425,
            220,
            435,
            221,
            281,
            129,
            130,
            131,
            434,
            117,
            270,
            271,
            52,
            53,
            452,
            55,
            54,
            88,
            5,
            6,
            7,
            463,
            14,
            15,
            16,
            466,
            164,
            261,
            97,
            268,
            279,
            447,
            *range(186, 198),
            217,
            218,
            219,
        ),
    ),
}
"""Machine -> its number in a filter, and the numbers of the system calls that fail with EPERM,
since Landlock does not cover all that they do.
"""


def limit(memory: int, seconds: int, file_size: int) -> None:
    """Limit this process: bytes of address space, seconds of the processor, bytes of a file it
    writes. No core dump.
    """
    for kind, most in (
        (resource.RLIMIT_AS, memory),
        (resource.RLIMIT_CPU, seconds),
        (resource.RLIMIT_FSIZE, file_size),
        (resource.RLIMIT_CORE, 0),
    ):
        hard = resource.getrlimit(kind)[1]
        with suppress(OSError, ValueError):  # the system lacks this limit
            resource.setrlimit(
                kind, (most if hard == resource.RLIM_INFINITY else min(most, hard), hard)
            )


def restrict(readable: Iterable[str]) -> str:
    """From now on this process can read nothing but the files `readable` and all below the folders
    in it; it can change and execute no file, open no socket, and reach no other process. Returns
    what the kernel lacks for that; empty if nothing. macOS has none of it.
    """
    if not IS_LINUX:
        return "Landlock and seccomp"
    library = ctypes.CDLL(None, use_errno=True)
    if library.prctl(_NO_NEW_PRIVILEGES, 1, 0, 0, 0):
        return "no_new_privs"
    done = {"Landlock": _landlock(library, readable), "seccomp": _seccomp(library)}
    return " and ".join(name for name in done if not done[name])


def _landlock(library: ctypes.CDLL, readable: Iterable[str]) -> bool:
    abi = library.syscall(_CREATE, None, 0, 1)
    if abi < 1:
        return False
    rights = _RIGHTS[max(known for known in _RIGHTS if known <= abi)]
    attributes = struct.pack(
        "=QQQ", rights, *(bits if abi >= since else 0 for since, bits in (_TCP, _SCOPES))
    )
    size = 24 if abi >= _SCOPES[0] else 16 if abi >= _TCP[0] else 8
    rules = library.syscall(_CREATE, attributes, size, 0)
    if rules < 0:
        return False
    try:
        for path in readable:
            _allow(library, rules, path)
        return bool(library.syscall(_RESTRICT, rules, 0) == 0)
    finally:
        os.close(rules)


def _allow(library: ctypes.CDLL, rules: int, path: str) -> None:
    """Allow reading a path. One that does not exist, or cannot be opened, stays forbidden."""
    try:
        place = os.open(path, os.O_PATH | os.O_CLOEXEC)
    except (OSError, ValueError):
        return
    try:
        rights = _READ_FILE | (_READ_FOLDER if os.path.isdir(path) else 0)
        library.syscall(_ADD, rules, 1, struct.pack("=Qi", rights, place), 0)
    finally:
        os.close(place)


def _seccomp(library: ctypes.CDLL) -> bool:
    if os.uname().machine not in _DENIED:
        return False
    machine, denied = _DENIED[os.uname().machine]
    # BPF: load a word, jump if equal, jump if not below, return
    load, equal, above, end = (0x20, 0x15, 0x35, 0x06)
    kill, refuse, allow = 0x80000000, 0x00050001, 0x7FFF0000  # the process; with EPERM
    steps = [(load, 0, 0, 4), (equal, 1, 0, machine), (end, 0, 0, kill), (load, 0, 0, 0)]
    # From 0x40000000 on x86_64 has its calls a second time.
    steps += [(above, 0, 1, 0x40000000), (end, 0, 0, refuse)]
    for number in denied:
        steps += [(equal, 0, 1, number), (end, 0, 0, refuse)]
    steps.append((end, 0, 0, allow))
    program = ctypes.create_string_buffer(b"".join(struct.pack("=HBBI", *step) for step in steps))
    head = struct.pack("@HP", len(steps), ctypes.addressof(program))
    return bool(library.prctl(_SECCOMP, _FILTER, head, 0, 0) == 0)
