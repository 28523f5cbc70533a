"""Lets each side call the services of the other."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from functools import partial
from itertools import count
from typing import Any

import zenoh

from holozen import wire
from holozen.messages import CodecError, cdr, codec
from holozen.messages.definitions import Interface, InterfaceError
from holozen.ros.gateway import rmw_zenoh as rmw
from holozen.ros.gateway.sides import CALL, MANY, NODES, RESULT, Ends, Sides, quietly
from holozen.transport import actions
from holozen.transport import graph as graphs
from holozen.transport.errors import BusError, ServiceError
from holozen.transport.samples import Answers, Sample
from holozen.transport.services import MAX_REQUEST_BYTES, RING, call_bytes, frees, refuse

LATE = (
    f"it was sent more than {wire.MAX_COMMAND_AGE:g} s from this machine's clock: it is late, and "
    "has to be sent again,"
    " or the clocks differ: set them, or use `holozen release`, `controller --resume`, `sim play` "
    "or `action send_goal`"
)
FAILED = 4  # OPERATION_FAILED of simulation_interfaces/msg/Result


class ServiceRoutes:
    """Announces our endpoints to ROS 2, answers calls of our services, and offers those of ROS 2 on
    our side. `closed` is set when the gateway ends.
    """

    def __init__(self, sides: Sides, closed: threading.Event) -> None:
        self._sides, self._closed = sides, closed

    def show(self, token: str, found: rmw.Endpoint | None = None) -> Ends:
        """Show a node or an endpoint of ours to ROS 2, and answer the calls of a service."""
        ends: Ends = []
        if found and found.kind == "sub" and not self._sides.form.shows_readers:
            reader = self._sides.there.declare_subscriber(
                self._sides.form.key(found), zenoh.handlers.RingChannel(1)
            )
            ends.append(quietly(reader.undeclare))
        if found and found.kind == "srv":
            answers = ConcurrentAnswers if found.topic.endswith(RESULT) else Answers
            ends.append(
                self._answers(
                    self._sides.there,
                    self._sides.form.key(found),
                    partial(self._answer, found),
                    answers,
                )
            )
        # Last, so that whoever sees it can call it at once.
        return [*ends, *(self._sides.hold(self._sides.there, token) if token else ())]

    def _answers(
        self, session: Any, key: str, reply: Callable[[Any], None], answers: type[Answers] = Answers
    ) -> Callable[[], object]:
        """Answer the queries on a key with `reply`, in a thread; where it raises an error, with
        that.
        """
        queryable = session.declare_queryable(key, zenoh.handlers.RingChannel(RING), complete=True)

        def answer(query: Any) -> None:
            try:
                if len(query.payload or b"") > MAX_REQUEST_BYTES:
                    raise ServiceError(
                        f"a request of {len(query.payload)} bytes; at most {MAX_REQUEST_BYTES}"
                    )
                reply(query)
            except (ServiceError, CodecError, InterfaceError) as error:
                refuse(query, str(error))
            except (BusError, zenoh.ZError):  # the session is closed, and with it the queryable
                pass

        return quietly(answers(queryable, answer).close)

    def _answer(self, found: rmw.Endpoint, query: Any) -> None:
        """Answer ROS 2's call of one of our services."""
        interface = self._sides.registry.find(found.type)
        assert interface.request
        assert interface.response
        asked = bytes(query.attachment or b"")
        # bridges to DDS send none
        attachment, stamp = (self._sides.form.answered(asked), rmw.attachment(asked))
        request = f"application/cdr;{interface.request.name}"
        try:
            is_late = stamp and abs(time.time() - stamp.sent / 1e9) > wire.MAX_COMMAND_AGE
            payload = bytes(query.payload or b"")
            if is_late and frees(found.topic, payload, request):
                raise ServiceError(LATE)
            reply = self._replied(found.topic, payload, request)
            payload = codec.transcoded(interface.response, reply.payload, reply.encoding)
        except ServiceError as error:
            # A client of ROS 2 ignores an error reply, and would wait for ever.
            fields = _refused(interface.response, error)
            if fields is None:
                self._sides.report(
                    f"/{found.topic}: a caller waits, as {found.type} has no place for an error: "
                    f"{error}"
                )
                raise
            if "accepted" in fields:  # there is no place for the reason
                self._sides.report(f"/{found.topic}: {error}")
            payload = cdr.write(interface.response, fields)
        query.reply(
            self._sides.form.key(found), payload, encoding="application/cdr", attachment=attachment
        )

    def _replied(self, key: str, payload: bytes, encoding: str) -> Sample:
        """The reply of a service of ours. The result of an action comes when the goal has ended."""
        if not key.endswith(RESULT):
            return call_bytes(self._sides.bus, key, payload, encoding, CALL)[0]
        found = actions.wait_for_result(
            self._sides.bus, key.removesuffix(RESULT), payload, encoding, self._closed.is_set
        )
        if found is None:
            raise ServiceError("`holozen ros2` ends")
        return found

    def offer(self, theirs: rmw.Endpoint) -> Ends:
        """Let a service of ROS 2 be called on our side."""
        interface, numbers, key = (
            self._sides.registry.find(theirs.type),
            count(1),
            self._sides.form.key(theirs),
        )
        assert interface.request
        assert interface.response
        asked, answered = interface.request, interface.response
        gid = rmw.gid(self._sides.form.token(theirs._replace(session=self._sides.id), 0))

        def answer(query: Any) -> None:
            payload = codec.transcoded(
                asked, bytes(query.payload or b"{}"), str(query.encoding or "")
            )
            attachment = self._sides.form.attachment(next(numbers), gid)
            for reply in self._sides.there.get(
                key,
                payload=payload,
                encoding="application/cdr",
                attachment=attachment,
                timeout=CALL,
            ):
                if not reply.ok:
                    raise ServiceError(
                        f"/{theirs.topic} of ROS 2: "
                        f"{bytes(reply.err.payload).decode(errors='replace')}"
                    )
                found = bytes(reply.ok.payload)
                cdr.read(answered, found)
                query.reply(theirs.topic, found, encoding=f"application/cdr;{answered.name}")
                return
            raise ServiceError(f"/{theirs.topic} of ROS 2 did not reply within {CALL:g} s")

        shown = graphs.Endpoint(
            theirs.topic, "srv", theirs.type, NODES + theirs.node, self._sides.bus.id
        )
        answers = self._answers(self._sides.bus.session, theirs.topic, answer)
        return [*self._sides.hold(self._sides.bus.session, graphs.token(shown)), answers]

    def may_offer(self, theirs: rmw.Endpoint, ours: list[graphs.Endpoint]) -> bool:
        """Whether a service of theirs may be called from our side. Most of each node's have types
        not known here. Those of an action are left out: a result takes longer than CALL.
        """
        interface = self._sides.interface(theirs.type)
        if not interface or interface.kind != "srv" or actions.BELOW in theirs.topic:
            return False
        if why := self._sides.form.mismatch(theirs, interface):
            return self._sides.refuse(theirs.topic, why)
        if servers := graphs.on_key(ours, theirs.topic, "srv"):
            return self._sides.refuse(theirs.topic, f"{servers[0].node} serves {theirs.topic} here")
        return True


class ConcurrentAnswers(Answers):
    """Answers each query in its own thread, as some take long; at most MANY at a time."""

    def __init__(self, queryable: Any, answer: Callable[[Any], None]) -> None:
        self._room = threading.BoundedSemaphore(MANY)
        super().__init__(queryable, answer)

    def _handle(self, query: Any) -> None:
        self._room.acquire()  # waits while there are too many
        threading.Thread(target=self._handle_one, args=(query,), daemon=True).start()

    def _handle_one(self, query: Any) -> None:
        try:
            super()._handle(query)
        finally:
            self._room.release()


def _refused(response: Interface, error: ServiceError) -> dict[str, Any] | None:
    """A reply that tells ROS 2 of an error; None if the type has no place for it."""
    kinds = {
        field.name: field.nested.name if field.nested else field.type for field in response.fields
    }
    if kinds.keys() >= {"success", "message"}:
        return {"success": False, "message": str(error)}
    if "accepted" in kinds:  # a goal is rejected
        return {"accepted": False}
    if kinds.get("result") == "simulation_interfaces/msg/Result":
        return {
            "result": error.fields.get("result") or {"result": FAILED, "error_message": str(error)}
        }
    return None
