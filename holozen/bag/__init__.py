"""Bags: MCAP files of what came on the keys, written, read, summed up and played again."""

ENCODING = "zenoh_encoding"
"""The name of the channel's metadata that holds the Zenoh Encoding."""
