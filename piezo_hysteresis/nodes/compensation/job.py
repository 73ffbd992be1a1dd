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

"""`Job`: work in steps, one for every tick of the node, and what its steps wait for."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Generator
from concurrent.futures import Future
from typing import Any

TICK = 0.02
"""Period at which a job goes on [s]."""
REST_TIME = 0.2
"""Shortest time for which the drive of a stage at rest is watched [s]."""

Job = Generator[None]


def rest() -> Job:
    """Wait until fast motion has ended: a plan continues from the present one, and its drive begins later."""
    begin = time.monotonic()
    while time.monotonic() < begin + REST_TIME:
        yield


def in_thread(compute: Callable[..., Any], *arguments: object) -> Generator[None, None, Any]:
    """Compute in a thread of its own. Neither the next job nor the end of the process waits for it after a stop."""
    future: Future[Any] = Future()

    def call() -> None:
        try:
            future.set_result(compute(*arguments))
        except BaseException as error:
            future.set_exception(error)

    threading.Thread(target=call, name="plan", daemon=True).start()
    while not future.done():
        yield
    return future.result()
