"""Zenoh, typed: sessions, topics, services, the graph, parameters. Only this folder imports
zenoh.
"""

from holozen.transport import hardening as _hardening  # noqa: F401  # before Zenoh
