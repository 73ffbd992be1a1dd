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

"""`TokenAccess`: restricts a page that other machines can reach to visitors who know the token."""

from __future__ import annotations

import asyncio
import hmac
import ipaddress
import secrets
from collections.abc import Callable
from pathlib import Path
from typing import Any

from bokeh.server.auth_provider import AuthProvider
from tornado.web import RequestHandler

from ...errors import ParameterError
from ...home_path import in_home

SHORTEST_TOKEN = 16
"""Smallest number of characters of a token."""

_LONGEST_TOKEN = 1000
"""Largest number of characters of a token."""

_DELAY = 1.0
"""Delay of the answer to a wrong token [s], which prevents guessing."""

_FORM = """<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">
<title>Piezo stage</title></head>
<body style="font: 16px system-ui, sans-serif; max-width: 24rem; margin: 15vh auto; padding: 0 1rem">
<form method="post"><p>{text}</p>
<p><label>Token<br>
<input name="token" type="password" autofocus required style="width: 100%; font: inherit"></label></p>
<button style="font: inherit">Open the page</button></form></body></html>
"""
"""The page that asks for the token."""


def is_local(address: str) -> bool:
    """True for an address that only this machine reaches."""
    if address == "localhost":
        return True
    try:
        return ipaddress.ip_address(address).is_loopback
    except ValueError:
        return False


def read_token(path: str | Path) -> str:
    """The token in a file: its only line.

    Raises
    ------
    ParameterError
        If there is no such file, others may read it, or its token is too short.
    """
    path = in_home(path)
    try:
        if not path.is_file():
            raise ParameterError(f"token_file: got '{path}', expected a file that exists")
        if path.stat().st_mode & 0o077:
            raise ParameterError(f"token_file: others may read '{path}'; run chmod 600 on it")
        with path.open(encoding="utf-8") as file:
            token = file.read(_LONGEST_TOKEN).strip()
    except (OSError, UnicodeError) as error:
        raise ParameterError(f"token_file: cannot read '{path}': {error}") from None
    if len(token) < SHORTEST_TOKEN or any(character.isspace() for character in token):
        raise ParameterError(
            f"token_file: got {len(token)} characters in '{path}', expected one line of at least {SHORTEST_TOKEN}"
        )
    return token


class TokenAccess(AuthProvider):
    """Admits visitors who have given the token. The browser keeps a signed cookie, which is valid until the server
    ends.

    Parameters
    ----------
    token : str
        The token.
    """

    def __init__(self, token: str) -> None:
        self._token = token.encode()
        self.cookie_secret = secrets.token_hex(32)
        self.cookie = f"piezo_page_{secrets.token_hex(4)}"
        super().__init__()

    def accepts(self, token: str) -> bool:
        """Whether this is the token; takes the same time for every wrong one."""
        return hmac.compare_digest(token.encode(), self._token)

    @property
    def get_user(self) -> Callable[[Any], Any]:
        """The sender of a request; None until the token was given."""
        return lambda handler: handler.get_signed_cookie(self.cookie, max_age_days=1)

    @property
    def get_user_async(self) -> None:
        """Not needed."""

    @property
    def login_url(self) -> str:
        """Address of the form for the token."""
        return "/login"

    @property
    def get_login_url(self) -> None:
        """Not needed: the address is fixed."""

    @property
    def login_handler(self) -> type[RequestHandler]:
        """Class of the form for the token."""
        return TokenForm

    @property
    def logout_url(self) -> None:
        """Not needed: the visit ends with the browser, or after a day."""

    @property
    def logout_handler(self) -> None:
        """None."""


class TokenForm(RequestHandler):
    """Form for the token; it sets the cookie of a visitor who has given it."""

    def get(self) -> None:
        """Show the form."""
        self.write(_FORM.format(text="This page can move a stage."))

    async def post(self) -> None:
        """Check the token."""
        access = self.application.auth_provider
        if access.accepts(self.get_body_argument("token", "")):
            self.set_signed_cookie(access.cookie, "visitor", expires_days=None, httponly=True, samesite="Strict")
            wanted = self.get_query_argument("next", "/").partition("?")[2]  # the axis, and nothing of another site
            self.redirect(f"/?{wanted}" if wanted else "/")
            return
        await asyncio.sleep(_DELAY)
        self.set_status(403)
        self.write(_FORM.format(text="This is not the token."))
