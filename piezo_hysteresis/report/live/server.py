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

"""`PageServer`: an HTTP server in its own thread; without a token only this machine can reach it."""

from __future__ import annotations

import asyncio
import re
import socket
import threading
from collections.abc import Callable, Iterable
from typing import Any

from bokeh.application import Application
from bokeh.application.handlers.function import FunctionHandler
from bokeh.document import Document
from bokeh.server.server import BaseServer
from tornado.ioloop import IOLoop

from ...errors import ParameterError, printable
from .access import TokenAccess, is_local
from .connections import BoundedServer, BoundedTornado

_HOST = re.compile(r"(\[[0-9a-fA-F:.]+\]|[^\s/:\[\]]+)(:[0-9]+)?")
"""A name or an address, with or without a port."""


class PageServer:
    """Serves one kind of page at ``/``.

    Parameters
    ----------
    fill : callable
        Fills the document of a browser window.
    address : str
        Address to listen on; one that other machines reach needs a token.
    port : int
        Port to listen on; 0 takes a free one.
    token : str
        Token that a visitor has to give; empty: none, for this machine only.
    origins : iterable of str
        Names, with or without a port, under which browsers may reach the page besides `address` and localhost.

    Raises
    ------
    ParameterError
        If other machines reach the address and there is no token, address or port are not available, or an origin is
        not a name.
    """

    def __init__(
        self,
        fill: Callable[[Document], Any],
        address: str = "127.0.0.1",
        port: int = 5006,
        token: str = "",
        origins: Iterable[str] = (),
    ) -> None:
        if not token and not is_local(address):
            raise ParameterError(
                f"address: got {address}, which other machines reach, without a token; give token_file, or 127.0.0.1"
            )
        if not 0 <= port <= 65535:
            raise ParameterError(f"port: got {port}, expected 0 to 65535")
        self._application = Application(FunctionHandler(fill))
        self._address, self._port, self._access = address, port, TokenAccess(token) if token else None
        self._origins = tuple(_host(origin) for origin in origins)
        self._loop = asyncio.new_event_loop()
        self._ready = threading.Event()
        self._failure: BaseException | None = None
        self._server: BaseServer | None = None
        self._thread = threading.Thread(target=self._serve, name="page", daemon=True)
        self._thread.start()
        self._ready.wait()
        if self._failure is not None:
            raise ParameterError(
                f"address {address}, port {port}: {getattr(self._failure, 'strerror', None) or self._failure}; "
                "if a page is open there already, give another port"
            ) from self._failure

    @property
    def port(self) -> int:
        """Port of the server."""
        return self._port

    @property
    def url(self) -> str:
        """Address of the page for a browser on this machine."""
        host = f"[{self._address}]" if ":" in self._address else self._address
        return f"http://{'127.0.0.1' if host in ('0.0.0.0', '[::]') else host}:{self.port}/"

    def close(self) -> None:
        """Stop serving."""
        if self._thread.is_alive():
            self._loop.call_soon_threadsafe(self._loop.stop)
            self._thread.join()

    def wait(self) -> None:
        """Serve until the process is interrupted."""
        self._thread.join()

    def _serve(self) -> None:
        asyncio.set_event_loop(self._loop)
        try:
            self._server = self._listen()
        except BaseException as error:
            self._failure = error
        finally:
            self._ready.set()
        if self._server is not None:
            self._server.start()
            self._loop.run_forever()
            self._server.stop(wait=False)
            self._loop.run_until_complete(self._server._http.close_all_connections())
        asyncio.set_event_loop(None)
        self._loop.close()

    def _listen(self) -> BaseServer:
        options: dict[str, Any] = {}
        if self._access is not None:
            options = {"auth_provider": self._access, "cookie_secret": self._access.cookie_secret}
        family = socket.AF_INET6 if ":" in self._address else socket.AF_INET
        listening = socket.create_server((self._address, self._port), family=family)
        listening.setblocking(False)
        port = self._port = int(listening.getsockname()[1])
        try:
            tornado = BoundedTornado(
                {"/": self._application},
                extra_websocket_origins=self._allowed(port),
                check_unused_sessions_milliseconds=2000,
                unused_session_lifetime_milliseconds=5000,
                **options,
            )
            http = BoundedServer(tornado)
            http.add_sockets([listening])
        except BaseException:
            listening.close()
            raise
        return BaseServer(IOLoop.current(), tornado, http)

    def _allowed(self, port: int) -> list[str]:
        """Hosts and ports from which a page may connect to the server; pages of other sites may not."""
        hosts = [*dict.fromkeys((self._address.lower(), "127.0.0.1", "localhost"))]
        own = [f"[{host}]" if ":" in host else host for host in hosts if host not in ("0.0.0.0", "::")]
        return [host if _names_port(host) else f"{host}:{port}" for host in (*own, *self._origins)]


def _host(text: str) -> str:
    """A name as browsers send it, in small letters."""
    if not _HOST.fullmatch(text):
        raise ParameterError(f"hosts: got '{printable(text)}', expected names such as lab-pc, lab-pc:5006 or [fe80::1]")
    return text.lower()


def _names_port(host: str) -> bool:
    return ":" in host.rpartition("]")[2]
