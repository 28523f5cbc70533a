"""Samples of anybody as plain values: JSON, msgpack, text, and CDR where the type is known."""

from holozen.bus import Bus
from holozen.cli.show import Hex, decode, hex_dump
from holozen.graph import on_key
from holozen.tap import Sample

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path
    from typing import Any

    Packages = Iterable[tuple[str, Path]]

CDR = "application/cdr"
SAYS_NOTHING = ("", "zenoh/bytes", "application/octet-stream")
CDR_STARTS = (b"\0\0", b"\0\1")  # the encapsulation of plain CDR: big and little endian


class Reader:
    """Reads the samples of a bus. `type_name` is that of CDR, where a sample or its publisher does not say it;
    `packages` are those of `--package`.

    Raises ValueError for a type that nobody knows.
    """

    def __init__(self, type_name: str = "", packages: "Packages" = ()) -> None:
        self.why = ""  # the last sample could not be read that could not
        self._given, self._packages = type_name, packages
        self._interfaces: dict[str, Any] = {}
        self._registry: Any = None
        self._told: dict[str, str] = {}  # key -> the type that its publishers told
        if type_name:
            self._interface(type_name)

    def read(self, sample: Sample, bus: Bus) -> "Any":
        """The value of a sample; a show.Hex where its bytes cannot be decoded."""
        name, _, schema = sample.encoding.partition(";")
        if name != CDR and (name not in SAYS_NOTHING or sample.payload[:2] not in CDR_STARTS):
            value = decode(sample.payload, sample.encoding)
            self.why = "neither text, JSON, msgpack nor CDR" if isinstance(value, Hex) else self.why
            return value
        try:
            if kind := self._given or schema or self._type_told(sample.key, bus):
                return self._cdr(kind, sample.payload)
            self.why = "for CDR give the type: --type T"
        except ValueError as error:  # bytes of another type, or a type that is not known here
            told = f", its encoding says {schema}" if schema not in ("", self._given) else ""
            self.why = f"{error}; --type is wrong, or the bytes are{told}" if self._given else str(error)
        return hex_dump(sample.payload, sample.encoding)

    def _cdr(self, kind: str, payload: bytes) -> "Any":
        from holozen import cdr

        return cdr.read(self._interface(kind), payload)

    def _interface(self, name: str) -> "Any":
        if name not in self._interfaces:
            from holozen.interfaces import Registry

            self._registry = self._registry or Registry(dict(self._packages))
            self._interfaces[name] = self._registry.find(name)
        return self._interfaces[name]

    def _type_told(self, key: str, bus: Bus) -> str:
        if key not in self._told:
            types = {end.type for end in on_key(bus.graph().settled(bus.connected), key, "pub")}
            self._told[key] = min(types, default="")
        return self._told[key]
