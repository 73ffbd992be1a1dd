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
