"""Callbacks are served one after the other until somebody says stop, with either executor."""

import importlib
import sys
import threading

import pytest
import rclpy
from rclpy.clock import Clock, ClockType
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future

from piezo_hysteresis.nodes.runtime import executor as own

pytestmark = pytest.mark.nodes


@pytest.fixture(params=["of this distribution", "of one without events"])
def executor(request, lab, monkeypatch):
    """What nodes are served by here, and where rclpy has no executor of events."""
    if request.param != "of this distribution":
        monkeypatch.setitem(sys.modules, "rclpy.experimental.events_executor", None)
    rclpy.init(domain_id=lab.domain, signal_handler_options=SignalHandlerOptions.NO)
    module = importlib.reload(own)
    executor = module.make_executor()
    assert request.param == "of this distribution" or isinstance(executor, SingleThreadedExecutor)
    yield executor
    executor.shutdown()
    rclpy.try_shutdown()
    monkeypatch.undo()
    importlib.reload(own)


def test_callbacks_are_served_until_another_thread_says_stop(executor):
    node, stop, ticks = Node("served"), Future(), []

    def tick():
        ticks.append(threading.get_ident())
        if len(ticks) == 3:
            threading.Thread(target=stop.set_result, args=(None,)).start()

    node.create_timer(0.01, tick, clock=Clock(clock_type=ClockType.STEADY_TIME))
    executor.add_node(node)
    own.spin_until(executor, stop)
    assert len(ticks) >= 3
    assert set(ticks) == {threading.get_ident()}
    node.destroy_node()


def test_a_stop_said_before_is_heard(executor):
    stop = Future()
    stop.set_result(None)
    own.spin_until(executor, stop)
