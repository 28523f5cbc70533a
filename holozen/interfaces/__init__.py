"""What ROS's .msg and .srv files say: the fields of each type, looked up by its name.

The tables beside this file hold the usual packages; any other is read from its own files.
"""

from holozen.interfaces.definition import Constant, Field, Interface, InterfaceError
from holozen.interfaces.registry import Registry

__all__ = ["Constant", "Field", "Interface", "InterfaceError", "Registry"]
