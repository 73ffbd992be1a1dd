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

"""`Deadline`: limits the time that a call to a device server waits, even if a cable is disconnected."""

from __future__ import annotations

from typing import Any

import grpc


class Deadline(grpc.UnaryUnaryClientInterceptor):  # type: ignore[misc]  # grpc has no types
    """Gives every call a deadline; NI's client sets none.

    Parameters
    ----------
    seconds : float
        Longest time without an answer [s], in addition to the time for which a call waits for samples.
    """

    def __init__(self, seconds: float) -> None:
        self._seconds = seconds

    def intercept_unary_unary(self, continuation: Any, client_call_details: Any, request: Any) -> Any:
        """Pass the call on with its deadline."""
        waits = (getattr(request, name, 0.0) for name in ("timeout", "time_to_wait"))
        allowed = self._seconds + max(*waits, 0.0)
        return continuation(client_call_details._replace(timeout=allowed), request)
