"""Why a request about the world is refused."""

from holozen.transport.errors import ServiceError


class EntityError(ServiceError):
    """A request about an entity that cannot be granted, with its `Result` code of
    simulation_interfaces.
    """

    def __init__(self, code: int, text: str) -> None:
        super().__init__(text, result={"result": code, "error_message": text})
        self.code = code
