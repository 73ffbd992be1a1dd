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

"""Connections that send nothing, read nothing, or are too many, and a visitor who gets the page all the same."""

from __future__ import annotations

import base64
import socket
import urllib.request
from contextlib import ExitStack, contextmanager, suppress

import pytest
from bokeh.models import Div
from bokeh.util.token import generate_jwt_token, generate_session_id

from piezo_hysteresis.report.live import connections
from piezo_hysteresis.report.live.server import PageServer

PATIENCE = 20.0


@contextmanager
def page():
    server = PageServer(lambda document: document.add_root(Div(text="the page")), port=0)
    try:
        yield server
    finally:
        server.close()


def connected(stack, server):
    one = stack.enter_context(socket.create_connection(("127.0.0.1", server.port)))
    one.settimeout(PATIENCE)
    return one


def window(stack, server):
    """A websocket that never answers, as raw bytes, after the server has accepted it."""
    one = connected(stack, server)
    key, token = base64.b64encode(bytes(16)).decode(), generate_jwt_token(generate_session_id())
    host = f"127.0.0.1:{server.port}"
    lines = (
        "GET /ws HTTP/1.1",
        f"Host: {host}",
        f"Origin: http://{host}",
        "Upgrade: websocket",
        "Connection: Upgrade",
        "Sec-WebSocket-Version: 13",
        f"Sec-WebSocket-Key: {key}",
        f"Sec-WebSocket-Protocol: bokeh, {token}",
    )
    one.sendall(("\r\n".join(lines) + "\r\n\r\n").encode())
    head = b""
    while not head.endswith(b"\r\n\r\n"):  # byte by byte: the first message of the page may come with it
        head += one.recv(1)
    assert b" 101 " in head
    return one


def rest_of(one) -> bytes:
    """What still comes until the server ends the connection."""
    read = b""
    while part := one.recv(1 << 16):
        read += part
    return read


def test_silent_connections_do_not_block_visitors(monkeypatch):
    monkeypatch.setattr(connections, "MOST_REQUESTS", 4)
    monkeypatch.setattr(connections, "SILENT_REQUEST", 3600.0)
    with page() as server, ExitStack() as stack:
        silent = [connected(stack, server) for _ in range(9)]
        with urllib.request.urlopen(server.url, timeout=PATIENCE) as answer:
            assert b"bokeh" in answer.read().lower()
        assert rest_of(silent[0]) == b""
        silent[-1].settimeout(0.05)
        with pytest.raises(TimeoutError):
            silent[-1].recv(1)


def test_a_connection_that_never_completes_its_request_is_ended(monkeypatch):
    monkeypatch.setattr(connections, "SILENT_REQUEST", 0.2)
    with page() as server, ExitStack() as stack:
        slow = connected(stack, server)
        slow.sendall(b"GET / HTTP/1.1\r\nHost: ")
        assert rest_of(slow) == b""


def test_a_window_that_does_not_answer_is_ended(monkeypatch):
    monkeypatch.setattr(connections, "SILENT_WINDOW", 0.2)
    with page() as server, ExitStack() as stack:
        rest_of(window(stack, server))


def test_a_window_too_many_is_refused_and_the_others_stay(monkeypatch):
    monkeypatch.setattr(connections, "MOST_WINDOWS", 1)
    monkeypatch.setattr(connections, "SILENT_WINDOW", 3600.0)
    with page() as server, ExitStack() as stack:
        first = window(stack, server)
        assert b"ACK" in first.recv(1 << 16)
        assert b"ACK" not in rest_of(window(stack, server))
        first.settimeout(0.05)
        with pytest.raises(TimeoutError):
            rest_of(first)


def test_a_window_that_sends_very_much_is_ended_and_the_log_stays_short(caplog):
    """20 MB of brackets were 20 MB in the log of the node."""
    with page() as server, ExitStack() as stack:
        one, read = window(stack, server), b""
        while b"ACK" not in read:
            read += one.recv(1 << 16)
        with suppress(ConnectionError):  # it is ended at once
            for text in (b'{"msgid": "1", "msgtype": "PATCH-DOC"}', b"{}", b"[" * (1 << 17)):
                one.sendall(b"\x81\xff" + len(text).to_bytes(8, "big") + bytes(4) + text)
            rest_of(one)
    assert len(caplog.text) < 1 << 16
