# Copyright 2026 piezo_hysteresis maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Callbacks are served one after the other until somebody says stop, with either executor."""

import importlib
import sys
import threading
from functools import partial

import pytest
import rclpy
from rclpy.clock import Clock, ClockType
from rclpy.executors import SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future
from std_msgs.msg import String
from std_srvs.srv import Trigger

from piezo_hysteresis.nodes.runtime import executor as own
from piezo_hysteresis.nodes.runtime.guarded_node import GuardedNode

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


def test_callbacks_run_until_another_thread_stops_them(executor):
    node, stop, ticks = GuardedNode("served"), Future(), []

    def tick():
        ticks.append(threading.get_ident())
        if len(ticks) == 3:
            threading.Thread(target=stop.set_result, args=(None,)).start()

    node.create_timer(0.01, tick, clock=Clock(clock_type=ClockType.STEADY_TIME))
    executor.add_node(node)
    own.spin_until(executor, stop, node)
    assert len(ticks) >= 3
    assert set(ticks) == {threading.get_ident()}
    node.destroy_node()


def test_a_stop_said_before_is_heard(executor):
    node, stop = GuardedNode("stopped"), Future()
    stop.set_result(None)
    own.spin_until(executor, stop, node)
    node.destroy_node()


def test_no_exception_ends_the_serving(executor):
    """Raised by a timer, a subscription, a service, a task, and where a future is done: each is counted, all go on."""
    node, stop, served = GuardedNode("faulty"), Future(), []
    text = "\x1b[2J\nforged line"

    def fail(name, *_):
        served.append(name)
        raise ValueError(text)

    node.create_timer(0.05, partial(fail, "timer"), clock=Clock(clock_type=ClockType.STEADY_TIME))
    node.create_subscription(String, "anything", partial(fail, "subscription"), 10)
    node.create_service(Trigger, "service", partial(fail, "service"))
    publisher, client = node.create_publisher(String, "anything", 10), node.create_client(Trigger, "service")
    answers = []

    def ask():
        publisher.publish(String(data="x"))
        if client.service_is_ready():
            future = client.call_async(Trigger.Request())
            future.add_done_callback(lambda future: answers.append(future.result()))
            future.add_done_callback(node.guarded(partial(fail, "future")))
        executor.create_task(node.guarded(partial(fail, "task")))
        if min(map(served.count, ("timer", "subscription", "service", "task", "future"))) >= 2:
            stop.set_result(None)

    node.create_timer(0.05, ask, clock=Clock(clock_type=ClockType.STEADY_TIME))
    executor.add_node(node)
    limit = threading.Timer(30.0, lambda: stop.done() or stop.set_result(None))
    limit.start()
    own.spin_until(executor, stop, node)
    limit.cancel()
    assert {name: served.count(name) >= 2 for name in set(served)} == dict.fromkeys(
        ("timer", "subscription", "service", "task", "future"), True
    )
    assert node.faults == len(served)
    assert node.recent_fault.startswith("fault of this program: ValueError")
    assert node.recent_fault.isprintable()
    assert {(answer.success, answer.message) for answer in answers} == {(False, node.recent_fault)}
    node.destroy_node()


def test_a_fault_of_the_executor_itself_is_reported(executor):
    node, stop = GuardedNode("odd"), Future()

    class Odd:
        """An executor that fails twice before it serves."""

        failures = 2

        def spin_until_future_complete(self, future, timeout_sec):
            if self.failures:
                self.failures -= 1
                raise RuntimeError("taking a message failed")
            future.set_result(None)

    own.spin_until(Odd(), stop, node)
    assert node.faults == 2
    node.destroy_node()
