"""A guard condition runs its callback in spin, whoever triggers it."""

import threading
from collections.abc import Callable
from typing import Any

from holozen.ros import rclpy
from holozen.testing import Wire


def test_a_trigger_from_another_thread_wakes_who_spins(ros: Wire, spin_for: Callable[..., Any]) -> None:
    node, threads = rclpy.create_node("tom"), list[threading.Thread]()
    guard = node.create_guard_condition(lambda: threads.append(threading.current_thread()))
    threading.Thread(target=guard.trigger).start()
    spin_for(lambda: threads, node)
    assert threads == [threading.main_thread()]


def test_triggers_that_wait_are_one_and_a_destroyed_one_is_silent(ros: Wire) -> None:
    node, called = rclpy.create_node("tom"), list[int]()
    guard = node.create_guard_condition(lambda: called.append(1))
    guard.trigger()
    guard.trigger()
    for _ in range(3):
        rclpy.spin_once(node, timeout_sec=0)
    assert called == [1]
    guard.trigger()
    assert node.destroy_guard_condition(guard)
    rclpy.spin_once(node, timeout_sec=0)
    assert called == [1]
