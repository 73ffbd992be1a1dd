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

"""`Browser`: the system's Chromium without a window, by its DevTools protocol over Tornado's websocket."""

from __future__ import annotations

import asyncio
import base64
import json
import shutil
import subprocess
import time
import urllib.request
from collections.abc import Callable
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from tornado.websocket import WebSocketClientConnection, websocket_connect

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
"""Path of the browser; None where there is none."""

PATIENCE = 60.0
"""Longest wait for something on the page [s]."""

OPTIONS = (
    "--headless=new",
    "--no-sandbox",
    "--disable-gpu",
    "--remote-debugging-port=0",
    "--no-first-run",
    "--hide-scrollbars",
)

ALL = """(() => { const found = [];
  const walk = node => { for (const child of node.querySelectorAll('*')) {
    found.push(child); if (child.shadowRoot) walk(child.shadowRoot); } };
  walk(document); return found; })()"""
"""Every element of the page, those inside the shadow of others too."""


class Browser:
    """One window.

    Parameters
    ----------
    folder : Path
        For the profile.
    """

    def __init__(self, folder: Path) -> None:
        assert CHROMIUM is not None
        log = folder / "chromium.log"
        with log.open("wb") as output:
            command = [CHROMIUM, *OPTIONS, f"--user-data-dir={folder / 'profile'}", "about:blank"]
            self._process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=output)
        self._loop = asyncio.new_event_loop()
        self._numbers = count(1)
        port = self._until(lambda: _port(folder / "profile"), lambda: log.read_text(errors="replace"))
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/json/list") as answer:
            (target,) = [one for one in json.load(answer) if one["type"] == "page"]
        self._socket: WebSocketClientConnection = self._loop.run_until_complete(_connected(target))
        self.do("Page.enable")

    def close(self) -> None:
        """End the browser."""
        self._loop.run_until_complete(_closed(self._socket))
        self._loop.close()
        self._process.terminate()
        self._process.wait(PATIENCE)

    def do(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Result of one command of the protocol."""
        number = next(self._numbers)
        return self._loop.run_until_complete(self._ask(number, method, parameters))

    async def _ask(self, number: int, method: str, parameters: dict[str, Any]) -> dict[str, Any]:
        await self._socket.write_message(json.dumps({"id": number, "method": method, "params": parameters}))
        while True:
            message = await asyncio.wait_for(self._socket.read_message(), PATIENCE)
            assert message is not None, "the browser has gone"
            answer = json.loads(message)
            if answer.get("id") == number:
                assert "error" not in answer, f"{method}: {answer['error']}"
                return answer["result"]

    def open(self, url: str, width: int = 1200, height: int = 1000) -> None:
        """Go to a page."""
        self.size(width, height)
        self.do("Page.navigate", url=url)

    def size(self, width: int, height: int) -> None:
        """Give the window a size [px]."""
        self.do("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)

    def value(self, expression: str) -> Any:
        """Value of an expression on the page."""
        answer = self.do("Runtime.evaluate", expression=expression, returnByValue=True)
        assert "exceptionDetails" not in answer, answer["exceptionDetails"]
        return answer["result"].get("value")

    def text(self, name: str) -> str:
        """Text of the element with an id, or of the panel of that name."""
        found = f"{ALL}.filter(e => e.id === {json.dumps(name)}).map(e => e.textContent)[0] ?? ''"
        return str(self.value(found))

    def shown(self) -> str:
        """All that can be read on the page."""
        return str(self.value(f"{ALL}.filter(e => e.className === 'bk-clearfix').map(e => e.innerText).join('\\n')"))

    def source(self, name: str) -> dict[str, list[float]]:
        """Columns of a data source of the page, as the browser holds them."""
        column = "Object.fromEntries([...Object.entries(s.data)].map(([k, v]) => [k, Array.from(v)]))"
        return self.value(
            f"(() => {{ const s = globalThis.Bokeh?.documents[0]?.get_model_by_name({json.dumps(name + '_data')});"
            f" return s ? {column} : {{}}; }})()"
        )

    def loop(self) -> dict[str, NDArray[np.float64]]:
        """Points of the loop in the browser: ``voltage``, ``loop_measured``, ``loop_predicted``, without gaps."""
        columns = self.source("lines")
        held = {k: np.array(columns.get(k, []), float) for k in ("voltage", "loop_measured", "loop_predicted")}
        return {name: column[np.isfinite(held["voltage"])] for name, column in held.items()}

    def click(self, label: str) -> None:
        """Press the button with a label, as a mouse does; again, if the page has moved it away under the mouse."""
        shown = "e.tagName === 'BUTTON' && e.getBoundingClientRect().width > 0 && !e.disabled"
        place = (
            f"(() => {{ const b = {ALL}.filter(e => {shown} && e.textContent.trim() === {json.dumps(label)})[0];"
            " if (!b) return null; b.scrollIntoView({block: 'center'}); const r = b.getBoundingClientRect();"
            " globalThis.pressed = false;"
            " b.addEventListener('click', () => { globalThis.pressed = true; }, {once: true, capture: true});"
            " return [r.x + r.width / 2, r.y + r.height / 2]; })()"
        )

        def pressed() -> bool:
            x, y = self.wait(lambda: self.value(place), f"a button '{label}'")
            for kind in ("mousePressed", "mouseReleased"):
                self.do("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1)
            return bool(self.value("globalThis.pressed"))

        self.wait(pressed, f"a press of the button '{label}'")

    def wait(self, condition: Callable[[], Any], what: str) -> Any:
        """Value of a condition, once it holds."""
        return self._until(condition, lambda: f"{what}\n{self.shown()}")

    def _until(self, condition: Callable[[], Any], what: Callable[[], str]) -> Any:
        deadline = time.monotonic() + PATIENCE
        while not (value := condition()):
            if time.monotonic() > deadline:
                raise AssertionError(f"waited {PATIENCE:g} s for {what()}, which did not come")
            time.sleep(0.05)
        return value

    def picture(self, path: Path) -> Path:
        """Write what the whole page looks like as PNG."""
        taken = self.do("Page.captureScreenshot", captureBeyondViewport=True)
        path.write_bytes(base64.b64decode(taken["data"]))
        return path

    def print(self, path: Path) -> Path:
        """Write the printed page as PDF."""
        path.write_bytes(base64.b64decode(self.do("Page.printToPDF", preferCSSPageSize=True)["data"]))
        return path


async def _connected(target: dict[str, Any]) -> WebSocketClientConnection:
    return await websocket_connect(target["webSocketDebuggerUrl"], max_message_size=1 << 28)


async def _closed(socket: WebSocketClientConnection) -> None:
    socket.close()
    while await asyncio.wait_for(socket.read_message(), PATIENCE) is not None:
        pass


def _port(profile: Path) -> int:
    """Port of the protocol, once the browser has written it down; 0 before."""
    file = profile / "DevToolsActivePort"
    lines = file.read_text().splitlines() if file.is_file() else []
    return int(lines[0]) if lines else 0
