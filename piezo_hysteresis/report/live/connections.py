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

"""Limits of the connections to the page, so that silent or many connections keep no visitor out and fill no memory."""

from __future__ import annotations

from typing import Any

from bokeh.protocol.exceptions import ProtocolError
from bokeh.server.tornado import BokehTornado
from tornado.httpserver import HTTPServer

MOST_REQUESTS = 64
"""Connections that may be without a window at the same time; a further one ends the oldest."""

MOST_WINDOWS = 16
"""Browser windows that may be open at the same time."""

SILENT_REQUEST = 10.0
"""Time after which a connection without a complete request is ended [s]."""

SILENT_WINDOW = 10.0
"""Time between two questions whether a window is still there, and time that it has for the answer [s]."""

LARGEST_BODY = 1 << 16
"""Size of a request, and of a message of a window, at most [bytes]."""


class BoundedServer(HTTPServer):
    """Ends connections that send nothing, and the oldest ones where there are too many.

    A process has a limited number of open files. Connections that never send would use them up, and nobody could open
    the page any more.
    """

    def initialize(self, tornado: BokehTornado) -> None:
        super().initialize(
            tornado,
            idle_connection_timeout=SILENT_REQUEST,
            body_timeout=SILENT_REQUEST,
            max_body_size=LARGEST_BODY,
        )
        self._waiting: dict[Any, None] = {}

    def start_request(self, server_conn: Any, request_conn: Any) -> Any:
        self._waiting[server_conn] = None
        while len(self._waiting) > MOST_REQUESTS:
            oldest = next(iter(self._waiting))
            del self._waiting[oldest]
            oldest.stream.close()
        return super().start_request(server_conn, request_conn)

    def on_close(self, server_conn: Any) -> None:
        self._waiting.pop(server_conn, None)
        super().on_close(server_conn)


class BoundedTornado(BokehTornado):
    """Serves a limited number of windows, and ends those that do not answer any more.

    What is sent to a window that does not read would otherwise be kept in memory for ever. What a window sends is a
    press or a choice. Bokeh would write more, which it does not understand, into the log.

    Parameters
    ----------
    applications : dict
        As for BokehTornado.
    **options
        As for BokehTornado.
    """

    def __init__(self, applications: dict[str, Any], **options: Any) -> None:
        super().__init__(
            applications,
            websocket_ping_interval=SILENT_WINDOW,
            websocket_ping_timeout=SILENT_WINDOW,
            websocket_max_message_size_bytes=LARGEST_BODY,
            **options,
        )

    def new_connection(self, protocol: Any, socket: Any, application_context: Any, session: Any) -> Any:
        if len(self._clients) >= MOST_WINDOWS:
            raise ProtocolError(f"{MOST_WINDOWS} windows are open already; close one")
        return super().new_connection(protocol, socket, application_context, session)
