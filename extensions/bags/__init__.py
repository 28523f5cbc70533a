"""Bags: files of messages, recorded from keys, inspected, drawn and played back."""

from typing import NamedTuple

from holozen.console import Failure
from holozen.messages import WIRES

ENCODING = "zenoh_encoding"
"""The key in a channel's metadata that holds the Zenoh Encoding."""
ZENOH = {**WIRES, "protobuf": "application/protobuf"}
"""MCAP's message encoding -> Zenoh's Encoding."""


class BagError(Failure):
    """A file that cannot be read, or not be written any further. The text is one line with the
    reason.
    """


class Channel(NamedTuple):
    """A stream of a bag: its key, Zenoh Encoding, MCAP encoding and type (empty if unknown)."""

    key: str
    encoding: str
    format: str
    type: str


class Message(NamedTuple):
    """A message. `at`: when it was recorded, in ns since 1970 or of the sim's time. `number` counts
    the messages of its channel, including lost ones.
    """

    channel: Channel
    at: int
    payload: bytes
    number: int = 0
