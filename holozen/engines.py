"""Which physics engine a sim runs, and why: pybullet where it is installed, else mujoco."""

import os
import sys
from importlib.util import find_spec
from typing import NamedTuple

from holozen.console import Failure
from holozen.flags import AUTO, ENGINES
from holozen.install import advice

PYBULLET, MUJOCO = ENGINES
OLDEST = (3, 11)  # of Python, for holozen and for mujoco
NEWEST_OF_PYBULLET = (3, 11)
PYBULLET_MACHINES = {("Linux", "x86_64")}
MUJOCO_MACHINES = {("Linux", "x86_64"), ("Linux", "aarch64"), ("Darwin", "arm64")}
SYSTEMS = {"Darwin": "macOS"}
PACKAGES = {"pybullet": "pybullet", "mujoco": "mujoco-core"}
"""Engine -> the package that has its wheel."""


class Machine(NamedTuple):
    """The machine that wheels have to suit.

    system, processor: as of `os.uname()`, such as Linux and aarch64.
    python: the version of CPython, (major, minor).
    """

    system: str
    processor: str
    python: tuple[int, int]

    def __str__(self) -> str:
        major, minor = self.python
        return f"Python {major}.{minor} on {self.place}"

    @property
    def place(self) -> str:
        """The system and its processor, as people name them."""
        return f"{SYSTEMS.get(self.system, self.system)} {self.processor}"

    @property
    def engines(self) -> list[str]:
        """The engines that have a wheel for this machine, the default first."""
        place = (self.system, self.processor)
        pybullet = place in PYBULLET_MACHINES and OLDEST <= self.python <= NEWEST_OF_PYBULLET
        mujoco = place in MUJOCO_MACHINES and self.python >= OLDEST
        return [PYBULLET] * pybullet + [MUJOCO] * mujoco


class Choice(NamedTuple):
    """An engine, one of ENGINES, and why it is used."""

    engine: str
    reason: str

    def __str__(self) -> str:
        return f"{self.engine}, {self.reason}"


def this_machine() -> Machine:
    """The machine, and the Python, of this process."""
    uname = os.uname()
    return Machine(uname.sysname, uname.machine, sys.version_info[:2])


def is_installed(engine: str) -> bool:
    """Whether an engine can be imported; it is not loaded."""
    return find_spec(engine) is not None


def choose(given: str = AUTO) -> Choice:
    """The engine that `--engine` asks for. If it is missing, raises Failure with the command that
    installs one here.
    """
    here = this_machine()
    if given != AUTO:
        if is_installed(given):
            return Choice(given, "as --engine asks")
        if given in here.engines:
            raise Failure(f"{given} is not installed; {_install(given, here)}")
        raise Failure(
            f"{_no_wheel(given, here)}; leave out --engine, or use --engine {_other(given)}"
        )
    if is_installed(PYBULLET):
        return Choice(PYBULLET, "which is installed")
    if is_installed(MUJOCO):
        lack = (
            "pybullet is not installed" if PYBULLET in here.engines else _no_wheel(PYBULLET, here)
        )
        return Choice(MUJOCO, f"since {lack}")
    if not here.engines:
        raise Failure(
            f"no physics engine has a wheel for {here}; run the sim in a container, or on another "
            "machine"
        )
    raise Failure(f"no physics engine is installed; {_install(here.engines[0], here)}")


def _install(engine: str, here: Machine) -> str:
    """What to do; the extra `sim` installs the default engine of the machine."""
    return advice("sim" if engine == here.engines[0] else engine)


def _no_wheel(engine: str, here: Machine) -> str:
    return f"{engine} has no wheel for {here}"


def _other(engine: str) -> str:
    return MUJOCO if engine == PYBULLET else PYBULLET
