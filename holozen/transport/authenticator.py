"""The secure set-up as transport sees it: what it asks of the extension that provides one."""

import importlib
from typing import Protocol, cast

from holozen.transport.errors import BusError
from holozen.transport.samples import Sample

PROVIDER = "holozen.secure.authenticator"  # the module, which is an Authenticator


class Member(Protocol):
    """Who this process is."""

    @property
    def name(self) -> str:
        """The name in its certificate."""

    @property
    def expires(self) -> float:
        """When its certificate ends (s, Unix time)."""

    def warning(self) -> str:
        """A warning of a certificate that expires soon; else empty."""

    def attachment(
        self, key: str, priority: str, stamp: bytes, encoding: str, payload: bytes
    ) -> bytes:
        """The stamp of a command and the proof that this member sent it."""


class Verifier(Protocol):
    """Checks the proofs of commands."""

    def refusal(self, sample: Sample) -> str:
        """Why the proof of a command is refused; empty if its sender proved the name and may use
        the priority.
        """


class Authenticator(Protocol):
    """The members of a network. `folder` is that of one member, and what cannot be used raises
    BusError.
    """

    def load(self, folder: str) -> Member:
        """The member of a folder."""

    def check(self, folder: str, role: str) -> None:
        """Raise BusError if the folder lacks what a process of that role needs."""

    def verifier(self, folder: str) -> Verifier:
        """What checks the commands of others by the list of members in a folder, as that
        changes.
        """

    def access_control(self, folder: str) -> dict[str, object]:
        """Zenoh's access control for a router and the members in its folder."""

    def version(self, folder: str) -> tuple[int, int]:
        """Identifies the list of members in a folder: it changes whenever the list does. Raises
        OSError.
        """

    def warnings(self, folder: str) -> list[str]:
        """Warnings of certificates that expire soon or have expired."""


def authenticator() -> Authenticator:
    """The one of the extension. Raises BusError if that is not there, ImportError if a library of
    it is not.
    """
    try:
        return cast(Authenticator, importlib.import_module(PROVIDER))  # loads cryptography
    except ModuleNotFoundError as error:
        if not f"{PROVIDER}.".startswith(f"{error.name}."):
            raise
        folder = f"extensions/{PROVIDER.split('.')[1]}"
        raise BusError(
            f"--secure needs an extension, the folder {folder}, which is not here"
        ) from None
