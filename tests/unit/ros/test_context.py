"""A context begins once and ends once, and tells those who asked for it."""

from collections.abc import Callable
from typing import Any

import pytest

from holozen.ros.context import Context, get_default_context
from holozen.ros.exceptions import RCLError
from holozen.testing import wait_for


class Open:
    """Something that counts how often it is closed."""

    def __init__(self) -> None:
        self.closed = 0

    def close(self) -> None:
        self.closed += 1


def test_it_begins_once() -> None:
    context = Context()
    assert not context.ok()
    context.init([])
    assert context.ok()
    with pytest.raises(RuntimeError, match=r"^Context\.init\(\) must only be called once; call rclpy\.shutdown\(\)"):
        context.init([])
    context.shutdown()
    with pytest.raises(RuntimeError):
        context.init([])


def test_it_ends_once_and_not_before_it_began() -> None:
    context = Context()
    with pytest.raises(RuntimeError, match="must be initialized before it can be shutdown"):
        context.shutdown()
    context.try_shutdown()
    context.init([])
    context.shutdown()
    assert not context.ok()
    with pytest.raises(RCLError, match="the context was shut down already"):
        context.shutdown()
    context.try_shutdown()


@pytest.mark.parametrize("end", [Context.shutdown, Context.try_shutdown, Context.interrupt])
def test_who_asked_is_told_of_the_end_once(end: Callable[[Context], None]) -> None:
    context, told = Context(), list[str]()

    class Owner:
        def tell(self) -> None:
            told.append("method")

    owner, forgotten = Owner(), Owner()
    context.init([])
    context.on_shutdown(owner.tell)
    context.on_shutdown(forgotten.tell)
    context.on_shutdown(lambda: told.append("function"))
    del forgotten
    end(context)
    wait_for(lambda: len(told) == 2)
    context.try_shutdown()
    assert told == ["method", "function"]
    context.on_shutdown(lambda: told.append("late"))
    assert told[-1] == "late"


def test_what_is_open_is_closed_at_the_end_but_not_by_a_signal() -> None:
    context, opened, closed = Context(), [Open(), Open(), Open()], Open()
    context.init([])
    for one in [*opened, closed]:
        context.opened(one)
    context.closed(closed)
    context.interrupt()
    assert [one.closed for one in opened] == [0, 0, 0]
    context.shutdown()  # welcome after a signal
    context.shutdown()
    assert [one.closed for one in [*opened, closed]] == [1, 1, 1, 0]


def test_an_end_right_after_a_signal_is_welcome(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("_thread.start_new_thread", lambda *_: None)  # it has not run yet
    context = Context()
    context.init([])
    context.interrupt()
    context.shutdown()
    assert not context.ok()


def test_a_block_begins_and_ends_it() -> None:
    with Context() as context:
        assert context.ok()
    assert not context.ok()
    with Context() as context:
        context.shutdown()


def test_a_domain_is_told_to_separate_nobody(capfd: pytest.CaptureFixture[str]) -> None:
    context = Context()
    context.init([], domain_id=7)
    context.shutdown()
    assert "domain_id=7 separates nobody here" in capfd.readouterr().err
    assert context.get_domain_id() == 0


def test_the_default_context_is_another_after_its_end() -> None:
    first: Any = get_default_context()
    assert get_default_context() is first
    assert get_default_context(shutting_down=True) is first
    assert get_default_context() is not first
