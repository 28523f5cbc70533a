"""Work goes on in a thread, and each wait for it gets its result or its error."""

import signal
import threading

import pytest

from holozen.background import at_once, background


def test_work_goes_on_while_its_caller_does_something_else() -> None:
    go = threading.Event()
    result = background(lambda: go.wait(10))
    go.set()
    assert result() is True
    assert result() is True


@pytest.mark.parametrize("error", [ValueError("no"), SystemExit(3), KeyboardInterrupt()])
def test_its_error_is_raised_in_its_waiter(error: BaseException) -> None:
    def work() -> None:
        raise error

    result = background(work)
    for _ in range(2):
        with pytest.raises(type(error)):
            result()


def test_an_interrupted_waiter_may_wait_again() -> None:
    go = threading.Event()
    result = background(lambda: go.wait(10))
    # other tests may have left theirs
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    interrupt = threading.Timer(0.05, signal.pthread_kill, (threading.get_ident(), signal.SIGINT))
    with pytest.raises(KeyboardInterrupt):
        interrupt.start()
        result()
    signal.signal(signal.SIGINT, before)
    go.set()
    assert result() is True


def test_at_once_has_done_its_work_when_it_returns() -> None:
    done: list[int] = []

    def work() -> int:
        done.append(1)
        return len(done)

    result = at_once(work)
    assert done == [1]
    assert result() == result() == 1
    with pytest.raises(ZeroDivisionError):
        at_once(lambda: 1 / 0)
