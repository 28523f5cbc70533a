"""What a node is inside. A Node has one name for all of it, so that scripts have the others for theirs."""

import threading
from typing import TYPE_CHECKING, Any, TypeVar

from holozen import threads
from holozen.bus import Bus
from holozen.ros import context as contexts
from holozen.ros import names
from holozen.ros.arguments import Arguments
from holozen.ros.callback_groups import CallbackGroup, MutuallyExclusiveCallbackGroup
from holozen.ros.client import Client
from holozen.ros.clock import ROSClock
from holozen.ros.context import Context
from holozen.ros.entity import Entity
from holozen.ros.exceptions import InvalidHandle, NotInitializedException
from holozen.ros.executor import Executor
from holozen.ros.graph_view import GraphView
from holozen.ros.guard_condition import GuardCondition
from holozen.ros.logging import get_logger
from holozen.ros.parameter_store import Store
from holozen.ros.service import Service
from holozen.ros.subscription import Subscription
from holozen.ros.timer import Timer

if TYPE_CHECKING:
    from holozen.ros.time_source import TimeSource

T = TypeVar("T")

CLOSE_LIMIT = 0.15  # s for the threads of calls to end


class Core:
    """The names, the session, the clock and the parameters of one node, and what it made.

    Raises NotInitializedException before `rclpy.init()`.
    """

    store: Store
    time_source: "TimeSource"

    def __init__(self, node_name: str, namespace: str, context: Context, words: Arguments) -> None:
        if not context.ok():
            raise NotInitializedException(f"cannot create node {node_name!r}")
        self.context, self.arguments = context, words
        self.name = words.node_name(names.check_node_name(node_name))
        self.namespace = words.namespace(names.check_namespace(namespace), node_name)
        self.fqn = names.join(self.namespace, self.name)
        self.logger, self.clock = get_logger(names.key(self.fqn).replace("/", ".")), ROSClock()
        self.executor: Executor | None = None
        self.owned: list[Any] = []  # publishers, subscriptions, timers ... in the order they were made
        self.group: CallbackGroup = MutuallyExclusiveCallbackGroup()
        self._closing = threading.Lock()
        self._closed = self._has_left = False
        self._calls: list[threading.Thread] = []
        self.bus = Bus(names.key(self.fqn), contexts.connection, lasting=True)
        self.context.opened(self)
        self.graph = GraphView(self.bus, self.name, self.namespace, self.check_may_look)

    def all(self, kind: type[T]) -> list[T]:
        """What it made of a kind."""
        return [one for one in list(self.owned) if isinstance(one, kind)]

    def entities(self) -> list[Entity]:
        """What an executor looks at, in that order."""
        tasks = [client.tasks for client in self.all(Client)]
        return [*self.all(Timer), *self.all(Subscription), *self.all(GuardCondition), *self.all(Service), *tasks]

    def own(self, made: T) -> T:
        """Keep what was made until it is destroyed, or the node is."""
        self.owned.append(made)
        if self.executor is not None:
            self.executor.changed()
        return made

    def disown(self, made: Any) -> bool:
        """Destroy what was made; whether it was this node's."""
        if made not in self.owned:
            return False
        self.owned = [one for one in self.owned if one is not made]
        if self.executor is not None:
            self.executor.changed()
        made.destroy()
        return True

    def check_open(self) -> None:
        """Raises InvalidHandle for a node that has left."""
        if self._closed:
            raise InvalidHandle(f"node {self.fqn} was destroyed, or rclpy shut down")

    def check_may_look(self) -> None:
        """Raises what `publish` does where rclpy has ended, InvalidHandle for a node that has left."""
        self.context.check_may_speak("look at the graph")
        self.check_open()

    def resolve(self, name: str, kind: str, only_expand: bool) -> str:
        """The absolute name of a "topic" or a "service", remapped unless `only_expand`."""
        full = names.expand(name, self.name, self.namespace, kind=kind)
        return full if only_expand else self.arguments.remap(full, self.name, self.namespace, kind=kind)

    def leave(self) -> None:
        """Leave the wire, in a thread that the context waits for at its end.

        Many nodes of one process leave side by side so: one after the other, each would tell all others that it goes.
        """
        self._silence()
        threading.Thread(target=self._leave, daemon=True).start()

    def close(self) -> None:
        """Leave the wire. Returns within half a second, whatever the others do, and not before who began it is done."""
        self._silence()
        with self._closing:
            if not self._has_left:
                self.bus.close()
                threads.wait(self._calls, CLOSE_LIMIT)
                self._has_left = True

    def _leave(self) -> None:
        self.close()
        self.context.closed(self)

    def _silence(self) -> None:
        self._closed = True
        owned, self.owned = self.owned, []
        self._calls += [thread for one in owned if isinstance(one, Client) for thread in one.threads()]
        for one in owned:
            one.silence()
