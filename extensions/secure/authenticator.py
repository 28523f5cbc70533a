"""What transport asks of this extension: this module is a
holozen.transport.authenticator.Authenticator.
"""

from holozen.secure import roles
from holozen.secure.members import Verifier, load, read_members, version, warnings

__all__ = ["access_control", "check", "load", "verifier", "version", "warnings"]


def check(folder: str, role: str) -> None:
    """Raise BusError if the folder lacks what a process of that role needs."""
    load(folder)
    if role in ("sim", roles.ROUTER):
        read_members(folder)


def verifier(folder: str) -> Verifier:
    """What checks the commands of others by the list of members in a folder, as that changes."""
    return Verifier(folder)


def access_control(folder: str) -> dict[str, object]:
    """Zenoh's access control for a router and the members in its folder. Raises BusError."""
    return roles.access_control({name: row["role"] for name, row in read_members(folder).items()})
