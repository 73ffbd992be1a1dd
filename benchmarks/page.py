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

"""The live page: processor time and memory of the page node while one browser window is open, at 50 kHz.

Driver, model node and page node run as processes of their own, on the transports of the launch files; the stage is
driven all the time. The window is a session of Bokeh's own client, which takes all that a browser would be sent. The
exit code is 1 above 20 % of a core or 300 MB.

    scripts/run python -m benchmarks.page --seconds 120
"""

from __future__ import annotations

import argparse
import os
import re
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
from bokeh.client import pull_session

from benchmarks.figures import Figures, alone
from benchmarks.relay import processor_time
from benchmarks.stream_sender import sender
from benchmarks.streaming import memory, waveform
from examples.demo.processes import Processes

ROOT = Path(__file__).parents[1]
PERIOD = 2e-5
"""Sample period of the stage [s]."""
MOST_TIME, MOST_MEMORY = 20.0, 300.0
"""What is promised: % of a core, MB."""
LOOK = 5.0
"""Time between two readings of the memory [s]."""
SETTLED = 180.0
"""Time after which everything was drawn once, so that the memory should remain constant [s]."""


def arguments(parser: argparse.ArgumentParser) -> None:
    """Options."""
    parser.add_argument("--seconds", type=float, default=120.0, help="with the window open, and a quarter without")


def run(options: argparse.Namespace) -> list[Figures]:
    """One row without a window and one with it."""
    os.environ.setdefault("ROS_DOMAIN_ID", str(1 + os.getpid() % 100))
    os.environ["FASTDDS_DEFAULT_PROFILES_FILE"] = str(ROOT / "config" / "launch_transports.xml")
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    with tempfile.TemporaryDirectory() as name, ExitStack() as stack:
        folder = Path(name)
        np.save(folder / "waveform.npy", waveform(1.0 / PERIOD, 10.0))
        processes = stack.enter_context(Processes("/bench", folder / "log"))
        processes.start("driver_node", discovery_time=0.1)
        processes.start("model_node", model_file=ROOT / "config" / "published_stage.yaml")
        processes.start("page_node", port=0)
        stack.enter_context(sender("/bench", PERIOD, folder / "waveform.npy"))
        address = _address(folder / "log" / "page_node.log", processes)
        page = processes.ids["page_node"]
        rows: list[Any] = [("none", *_measured(page, options.seconds / 4, processes))]
        session = pull_session(url=address)
        stack.callback(session.close)
        rows.append(("one", *_measured(page, options.seconds, processes, session.force_roundtrip)))
        drawn = session.document.get_model_by_name("lines_data").data["voltage"]
        points = int(np.count_nonzero(np.isfinite(np.asarray(drawn, dtype=float))))
        failures = [] if points > 100 else [f"the loop has {points} points"]
    for window, _, share, _, most in rows:
        if share > MOST_TIME:
            failures.append(f"window {window}: {share:.1f} % of a core, expected at most {MOST_TIME:g} %")
        if most > MOST_MEMORY:
            failures.append(f"window {window}: {most:.0f} MB, expected at most {MOST_MEMORY:g} MB")
    settled = f"memory after {SETTLED:g} s, MB"
    heads = ("browser window", "time, s", "processor time, % of a core", settled, "most memory, MB")
    return [Figures("Live page at 50 kHz", heads, rows, tuple(failures))]


def _address(log: Path, processes: Processes) -> str:
    deadline = time.monotonic() + 60.0
    while not (found := re.search(r"http://\S+", log.read_text() if log.is_file() else "")):
        processes.check()
        if time.monotonic() > deadline:
            raise TimeoutError(f"no address in {log}")
        time.sleep(0.1)
    return found.group()


def _measured(pid: int, duration: float, processes: Processes, look: object = None) -> tuple[float, ...]:
    time.sleep(LOOK)
    begin, spent, sizes = time.monotonic(), processor_time(pid), list[float]()
    while time.monotonic() - begin < duration:
        if callable(look):
            look()
        time.sleep(min(LOOK, duration))
        processes.check()
        sizes.append(memory(pid))
    elapsed = time.monotonic() - begin
    settled = sizes[min(round(SETTLED / LOOK), len(sizes)) - 1]
    return elapsed, 100 * (processor_time(pid) - spent) / elapsed, settled, max(sizes)


if __name__ == "__main__":
    alone(__name__)
