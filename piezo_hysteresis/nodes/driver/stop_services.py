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

"""`StopServices`: serves `~/stop`, `~/cancel` and `~/release` of the driver in its own thread."""

from __future__ import annotations

import threading
from collections.abc import Callable

from rclpy.executors import SingleThreadedExecutor
from rclpy.task import Future
from std_srvs.srv import Trigger

from ...errors import PiezoError
from ..runtime.companion_node import companion_node
from ..runtime.executor import spin_until
from ..runtime.guarded_node import GuardedNode

SUFFIX = "_stop"
"""Suffix that makes the name of the stop node from the name of the driver."""


class StopServices:
    """Services under the name of the driver, on a node and an executor of their own.

    The driver runs its callbacks one after the other. Behind many large commands, a stop would wait for seconds.

    Parameters
    ----------
    driver : GuardedNode
        The driver. It reports the faults of this thread, for example an answer that cannot be sent.
    **actions : callable
        For the last word of each service name, the function that is called in this thread. It returns the message of
        the answer.
    """

    def __init__(self, driver: GuardedNode, **actions: Callable[[], str]) -> None:
        self._node = companion_node(driver, SUFFIX)
        for word, action in actions.items():
            self._node.create_service(Trigger, f"{driver.get_fully_qualified_name()}/{word}", _answering(action))
        self._executor = SingleThreadedExecutor(context=driver.context)
        self._executor.add_node(self._node)
        self._ended = Future()
        served = (self._executor, self._ended, driver)
        self._thread = threading.Thread(target=spin_until, args=served, name="stop", daemon=True)
        self._thread.start()

    def end(self) -> None:
        """End the services; may be repeated."""
        if not self._ended.done():
            self._ended.set_result(None)
            self._executor.wake()
            self._thread.join()
            self._executor.shutdown()
            self._node.destroy_node()


def _answering(action: Callable[[], str]) -> Callable[[Trigger.Request, Trigger.Response], Trigger.Response]:
    def answer(request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        try:
            response.message, response.success = action(), True
        except PiezoError as error:
            response.message = str(error)
        except Exception as error:  # the thread must survive to serve the next stop
            response.message = f"fault of the driver: {error!r}"
        return response

    return answer
