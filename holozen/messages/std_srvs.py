"""Trigger: a request without fields."""

from holozen.messages.message import Message


class TriggerRequest(Message):
    pass


class TriggerReply(Message):
    success: bool = False
    message: str = ""
