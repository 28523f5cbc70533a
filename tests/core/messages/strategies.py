"""Every value of a type that a definition describes."""

from typing import Any

from hypothesis import strategies as st

from holozen.messages.definitions import INTEGERS, Field, Interface


def elements(field: Field) -> st.SearchStrategy[Any]:
    """Every value of one element."""
    if field.nested:
        return values(field.nested)
    if field.type in ("byte", "char"):
        # rosbags takes a byte as signed, ROS 2 as unsigned: one byte all the same
        return st.integers(0, 127)
    if field.type in INTEGERS:
        return st.integers(*INTEGERS[field.type])
    if field.type.startswith("float"):
        return st.floats(width=int(field.type[5:]), allow_nan=False)  # type: ignore[arg-type]
    # An independent library may not keep a NUL within a text.
    return (
        st.booleans()
        if field.type == "bool"
        else st.text(st.characters(exclude_characters="\0", codec="utf-8"))
    )


def values(interface: Interface) -> st.SearchStrategy[dict[str, Any]]:
    """Every value of a type, with short lists."""

    def of(field: Field) -> st.SearchStrategy[Any]:
        most = field.bound if field.array == "fixed" else min(3, field.bound or 3)
        return (
            st.lists(elements(field), min_size=field.bound and most, max_size=most)
            if field.array
            else elements(field)
        )

    return st.fixed_dictionaries({field.name: of(field) for field in interface.fields})
