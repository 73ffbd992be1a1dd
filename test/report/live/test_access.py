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

"""The page is for this machine alone, and for others only with the token."""

from __future__ import annotations

import asyncio
import urllib.error
import urllib.request
from http.cookiejar import CookieJar
from pathlib import Path
from urllib.parse import urlencode

import pytest
from bokeh.document import Document
from bokeh.models import Div
from bokeh.util.token import generate_jwt_token, generate_session_id
from tornado.httpclient import HTTPClientError, HTTPRequest
from tornado.websocket import websocket_connect

from piezo_hysteresis.errors import ParameterError
from piezo_hysteresis.report.live.access import is_local, read_token
from piezo_hysteresis.report.live.server import PageServer

TOKEN = "a-token-of-enough-characters"
SECRET = "what the page shows"


def fill(document: Document) -> None:
    document.title = SECRET
    document.add_root(Div())


@pytest.fixture
def guarded():
    server = PageServer(fill, "0.0.0.0", 0, TOKEN)
    yield server
    server.close()


@pytest.fixture
def visitor():
    """A browser that keeps cookies."""
    opener = urllib.request.build_opener(urllib.request.HTTPCookieProcessor(CookieJar()))

    def visit(url: str, **fields: str) -> str:
        data = urlencode(fields).encode() if fields else None
        try:
            with opener.open(url, data) as answer:
                return answer.read().decode()
        except urllib.error.HTTPError as error:
            with error:
                return f"{error.code} {error.read().decode()}"

    return visit


def is_welcome(port: int, origin: str) -> bool:
    """Whether the server answers a websocket of a page of some origin, whose session is in order."""

    async def ask() -> bool:
        request = HTTPRequest(f"ws://127.0.0.1:{port}/ws", headers={"Origin": origin})
        try:
            socket = await websocket_connect(request, subprotocols=["bokeh", generate_jwt_token(generate_session_id())])
        except HTTPClientError:
            return False
        answer = await asyncio.wait_for(socket.read_message(), 10.0)
        socket.close()
        while answer is not None and await socket.read_message() is not None:
            pass
        return answer is not None

    return asyncio.run(ask())


@pytest.mark.parametrize("address", ["0.0.0.0", "::", "192.0.2.1", "lab-computer"])
def test_no_address_that_others_reach_without_a_token(address):
    assert not is_local(address)
    with pytest.raises(ParameterError, match="without a token"):
        PageServer(fill, address, 0)


@pytest.mark.parametrize("address", ["127.0.0.1", "127.0.0.2", "::1", "localhost"])
def test_addresses_of_this_machine(address):
    assert is_local(address)


def test_the_page_is_shown_after_the_token_and_not_before(guarded, visitor):
    assert SECRET not in (asked := visitor(guarded.url))
    assert 'name="token"' in asked
    assert visitor(f"{guarded.url}login", token="a-token-of-other-characters").startswith("403")
    assert SECRET not in visitor(guarded.url)
    assert SECRET in visitor(f"{guarded.url}login", token=TOKEN)
    assert SECRET in visitor(guarded.url)


def test_the_axis_of_the_address_is_shown_after_the_token_and_no_other_site(visitor):
    def asked(document: Document) -> None:
        document.title = f"asked for {document.session_context.request.arguments}"
        document.add_root(Div())

    server = PageServer(asked, "0.0.0.0", 0, TOKEN)
    try:
        assert 'name="token"' in visitor(f"{server.url}?axis=/stage_y")
        assert "/stage_y" in visitor(f"{server.url}login?next=%2F%3Faxis%3D%2Fstage_y", token=TOKEN)
        for other in ("//example.invalid/", "http://example.invalid/?axis=/stage_y"):
            assert "asked for" in visitor(f"{server.url}login?next={other}", token=TOKEN)
    finally:
        server.close()


def test_a_websocket_needs_the_token_too(guarded):
    assert not is_welcome(guarded.port, f"http://127.0.0.1:{guarded.port}")


def test_pages_of_other_sites_get_no_websocket():
    server = PageServer(fill, port=0)
    try:
        assert not is_welcome(server.port, "http://evil.example")
        assert is_welcome(server.port, f"http://127.0.0.1:{server.port}")
    finally:
        server.close()


@pytest.mark.parametrize("host", ["Lab-PC", "lab-pc.example.org", "[FE80::1]"])
def test_further_names_are_welcome_however_they_are_written(host):
    server = PageServer(fill, port=0, origins=[host])
    try:
        assert is_welcome(server.port, f"http://{host.lower()}:{server.port}")
        assert not is_welcome(server.port, f"http://{host.lower()}:1")
    finally:
        server.close()


@pytest.mark.parametrize("host", ["http://lab-pc", "lab-pc:5006/", "fe80::1", "a:b", "lab pc"])
def test_a_further_name_that_no_browser_sends_is_refused(host):
    with pytest.raises(ParameterError, match=r"^hosts: got '.*', expected names such as lab-pc"):
        PageServer(fill, port=0, origins=[host])


def test_a_port_that_is_taken_is_an_error_in_one_line():
    server = PageServer(fill, port=0)
    try:
        with pytest.raises(ParameterError, match="in use"):
            PageServer(fill, port=server.port)
    finally:
        server.close()


def test_a_token_file_is_private_and_long_enough(tmp_path: Path):
    file = tmp_path / "token"
    with pytest.raises(ParameterError, match="exists"):
        read_token(file)
    file.write_text(f"{TOKEN}\n")
    file.chmod(0o644)
    with pytest.raises(ParameterError, match="chmod 600"):
        read_token(file)
    file.chmod(0o600)
    assert read_token(file) == TOKEN
    file.write_text("short")
    with pytest.raises(ParameterError, match="16"):
        read_token(file)
