"""Futures are done once, and their callbacks run where they should."""

import pytest

from holozen.ros.rclpy.task import Future, Task, TaskQueue
from holozen.ros.rclpy.waitable import Waker


def run(tasks: TaskQueue) -> int:
    """Run what waits; how many that were."""
    return sum(work() is None for work in iter(tasks.take, None))


def test_a_future_has_no_result_before_it_is_done() -> None:
    future = Future()
    assert (future.done(), future.result(), future.exception(), future.cancelled()) == (
        False,
        None,
        None,
        False,
    )
    future.set_result(3)
    assert (future.done(), future.result()) == (True, 3)


def test_the_first_result_stays() -> None:
    future = Future()
    future.set_result(1)
    future.set_result(2)
    future.cancel()
    assert (future.result(), future.cancelled()) == (1, False)


def test_an_exception_is_raised_by_result() -> None:
    future = Future()
    future.set_exception(ValueError("no"))
    assert future.done()
    with pytest.raises(ValueError, match=r"^no$"):
        future.result()


def test_an_exception_that_is_never_retrieved_is_reported(
    capsys: pytest.CaptureFixture[str],
) -> None:
    future = Future()
    future.set_exception(ValueError("no"))
    del future
    assert (
        capsys.readouterr().err
        == "the exception of a Future was never retrieved: ValueError('no')\n"
    )


def test_done_callbacks_without_an_executor_run_at_once_also_late_ones() -> None:
    future, called = Future(), list[Future]()
    future.add_done_callback(called.append)
    future.add_done_callback(print)
    assert future.remove_done_callback(print) == 1
    future.set_result(1)
    assert called == [future]
    future.add_done_callback(called.append)
    assert called == [future, future]


def test_done_callbacks_with_an_executor_wait_for_it() -> None:
    tasks, called = TaskQueue(), list[Future]()
    future = Future(executor=tasks)
    future.add_done_callback(called.append)
    future.cancel()
    assert future.cancelled()
    assert called == []
    assert run(tasks) == 1
    assert called == [future]


def test_a_watcher_is_called_at_once_unless_it_was_removed() -> None:
    future, message = Future(executor=TaskQueue()), list[str]()

    def first() -> None:
        message.append("first")

    def second() -> None:
        message.append("second")

    future.watch(first)
    future.watch(second)
    future.unwatch(second)
    future.set_result(None)
    assert message == ["first"]
    future.watch(second)
    assert message == ["first", "second"]


def test_a_task_is_the_future_of_what_its_function_returns() -> None:
    tasks = TaskQueue()
    task = tasks.create_task(lambda a, b: a + b, 1, b=2)
    assert not task.done()
    assert run(tasks) == 1
    assert task.result() == 3


def test_what_a_task_raises_comes_out_of_its_work() -> None:
    tasks = TaskQueue()
    task = tasks.create_task(lambda: 1 / 0)
    work = tasks.take()
    assert work
    with pytest.raises(ZeroDivisionError):
        work()
    assert isinstance(task.exception(), ZeroDivisionError)


def test_a_coroutine_goes_on_when_what_it_awaits_is_done() -> None:
    tasks, future, waker = TaskQueue(), Future(), Waker()

    async def double() -> int:
        return 2 * int(await future)

    task = tasks.create_task(double)
    assert run(tasks) == 1
    assert run(tasks) == 0
    tasks.arm(waker)
    future.set_result(21)
    assert waker.wait(10)
    assert run(tasks) == 1
    assert task.result() == 42


def test_a_coroutine_that_only_yields_comes_again() -> None:
    tasks = TaskQueue()

    class Pause:
        def __await__(self):
            yield

    async def pauses() -> str:
        await Pause()
        await Pause()
        return "done"

    task = tasks.create_task(pauses())
    assert run(tasks) == 3
    assert task.result() == "done"


def test_a_cancelled_task_does_not_run() -> None:
    called: list[int] = []
    task = Task(called.append, [1])
    task.cancel()
    task()
    assert called == []
    assert not task.executing()
