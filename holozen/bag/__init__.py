"""Bags: MCAP files of messages, recorded from keys, inspected, drawn and played back."""

ENCODING = "zenoh_encoding"
"""The key in a channel's metadata that holds the Zenoh Encoding."""


class BagError(Exception):
    """A file that cannot be read, or cannot be written any further. The text is one line with the reason."""
