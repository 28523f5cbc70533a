"""Zenoh endpoints, as people write them wrongly."""

PROTOCOLS = ("tcp", "udp", "tls", "quic", "ws", "unixsock-stream", "unixpipe", "serial", "vsock")
"""Those of Zenoh. What the installed one was built without, it says itself."""

_WITH_PORT = ("tcp", "udp", "tls", "quic", "ws")
HOW = "write PROTOCOL/HOST:PORT, such as tcp/10.0.0.2:7447"


def fault(text: str) -> str:
    """What is wrong with an endpoint, as one line that says how to write it; empty for a good one."""
    protocol, slash, address = text.partition("/")
    if not slash or not address or not text.isprintable() or " " in text:
        return f"{text!r} is no endpoint: {HOW}"
    if protocol not in PROTOCOLS:
        from holozen.flags import nearest

        return f"{text!r}: no protocol {protocol!r}{nearest(protocol, PROTOCOLS)}; there are {', '.join(PROTOCOLS)}"
    if protocol not in _WITH_PORT:
        return ""
    host, colon, port = address.partition("#")[0].partition("?")[0].rpartition(":")
    if not host or not colon or not port.isdecimal() or int(port) > 65535:
        return f"{text!r} has no port from 0 to 65535: {HOW}"
    return ""
