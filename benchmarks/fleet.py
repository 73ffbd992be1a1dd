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

"""Many recordings: rows with killed workers, additional processor time, and cost per recording from 100 to 10 000.

In the first two tables the recordings are in an S3 server on this machine (moto, in .venv-s3), otherwise on disk. The
work of the first two reads a recording and waits for one second. All other processor time of this process and of its
workers is the additional time: listing, dispatch, fetching, writing, and waiting workers. The exit code is 1 if a row
is lost or doubled, if this time is above 2 % of the second, or if the cost grows by half.

    scripts/run python -m benchmarks.fleet --recordings 1000 --flat 100 1000 10000
"""

from __future__ import annotations

import argparse
import os
import random
import signal
import socket
import subprocess
import tempfile
import threading
import time
import urllib.request
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import psutil
from pyarrow import fs

from benchmarks.figures import Figures, alone
from benchmarks.fleet_work import Wait
from piezo_hysteresis import recording
from piezo_hysteresis.fleet.cluster import cluster
from piezo_hysteresis.fleet.finding import find_recordings
from piezo_hysteresis.fleet.fleet import open_orders, run_fleet
from piezo_hysteresis.fleet.table.results import Results, read_results
from piezo_hysteresis.record import Experiment
from piezo_hysteresis.stage.simulated import SimulatedStage

ROOT = Path(__file__).parents[1]
MOST = 0.02
"""Processor time beside one second of work that is promised [s]."""
GROWTH = 1.5
"""Largest ratio of the cost per recording at the largest number to that at the smallest."""
STAGES = 20
"""Stages among which the recordings are divided."""


def arguments(parser: argparse.ArgumentParser) -> None:
    """Options."""
    parser.add_argument("--recordings", type=int, default=1000, help="in the S3 server, while workers are killed")
    parser.add_argument("--undisturbed", type=int, default=200, help="in the S3 server, without kills")
    parser.add_argument("--flat", type=int, nargs="*", default=[100, 1000, 10000], help="on disk, short tasks")
    parser.add_argument("--workers", type=int, default=8, help="processes that wait (default: 8)")
    parser.add_argument("--kills", type=float, default=10.0, metavar="S", help="mean time between two kills")
    parser.add_argument("--seed", type=int, default=0)


def run(options: argparse.Namespace) -> list[Figures]:
    """Three tables."""
    with tempfile.TemporaryDirectory() as name, _s3_server() as address:
        folder = Path(name)
        template = _template(folder)
        os.environ |= {"AWS_ACCESS_KEY_ID": "bench", "AWS_SECRET_ACCESS_KEY": "bench", "AWS_ENDPOINT_URL": address}
        figures = []
        if options.recordings:
            figures.append(_killed(options, folder, template, address))
        if options.undisturbed:
            figures.append(_undisturbed(options, folder, template, address))
        if options.flat:
            figures.append(_flat(options, folder, template))
        return figures


def _killed(options: argparse.Namespace, folder: Path, template: bytes, address: str) -> Figures:
    _upload("killed", options.recordings, template, address)
    over, kills, chance = threading.Event(), Counter[int](), random.Random(options.seed)

    def kill(client: Any) -> None:
        while not over.wait(chance.expovariate(1.0 / options.kills)):
            if pids := list(client.run(os.getpid, on_error="ignore").values()):
                victim = chance.choice(pids)
                os.kill(victim, signal.SIGKILL)
                kills[victim] += 1

    sources = find_recordings(["s3://killed"])
    with Results(folder / "killed") as results, cluster(workers=options.workers) as client:
        killer = threading.Thread(target=kill, args=(client,), daemon=True)
        killer.start()
        summary = run_fleet(open_orders(sources, Wait(1.0), results), results, client)
        over.set()
        killer.join()
    rows = Counter(read_results(folder / "killed", ["recording"])["recording"].to_pylist())
    lost = sum(source.url not in rows for source in sources)
    doubled = sum(count > 1 for count in rows.values())
    failures = [f"{lost} rows lost, {doubled} doubled"] if lost or doubled else []
    if summary.counts.get("done") != len(sources):
        failures.append(f"not every recording has a result: {dict(summary.counts)}")
    cells = (
        len(sources),
        options.workers,
        kills.total(),
        lost,
        doubled,
        summary.counts.get("done", 0),
        summary.seconds,
    )
    heads = ("recordings", "workers", "workers killed", "rows lost", "rows doubled", "with a result", "time, s")
    return Figures("One-second tasks, workers killed at random", heads, [cells], tuple(failures))


def _undisturbed(options: argparse.Namespace, folder: Path, template: bytes, address: str) -> Figures:
    _upload("warm", 4 * options.workers, template, address)
    _upload("calm", options.undisturbed, template, address)
    with cluster(workers=options.workers) as client:
        _cost("s3://warm", folder / "warm", Wait(0.0), client)
        work = _work(folder)
        spent, wall = _cost("s3://calm", folder / "calm", Wait(1.0), client)
    processor = spent - work
    share = wall * options.workers - 1.0
    failures = [f"{processor:.4f} s per recording, expected at most {MOST:g} s"] if processor > MOST else []
    cells = (options.undisturbed, options.workers, 1e3 * work, 1e3 * processor, 100 * processor, 1e3 * share)
    heads = (
        "recordings", "workers", "work itself, ms", "additional processor time, ms", "of the second, %",
        "additional time, ms",
    )  # fmt: skip
    return Figures("One-second tasks, undisturbed", heads, [cells], tuple(failures))


def _flat(options: argparse.Namespace, folder: Path, template: bytes) -> Figures:
    rows = []
    with cluster(workers=2) as client:
        (folder / "warm_up").mkdir()
        for i in range(20):
            (folder / "warm_up" / f"r{i}.npz").write_bytes(template)
        _cost(str(folder / "warm_up"), folder / "rows_warm_up", Wait(0.0), client)
        for count in options.flat:
            place = folder / f"flat_{count}"
            for i in range(count):
                file = place / f"stage_{i % STAGES:02d}" / f"r{i:05d}.npz"
                file.parent.mkdir(parents=True, exist_ok=True)
                file.write_bytes(template)
            rows.append((count, *(1e3 * x for x in _cost(str(place), folder / f"rows_{count}", Wait(0.0), client))))
    failures = []
    if rows[-1][1] > GROWTH * rows[0][1]:
        failures.append(f"{rows[-1][1]:.2f} ms at {rows[-1][0]} recordings, {rows[0][1]:.2f} ms at {rows[0][0]}")
    heads = ("recordings", "processor time each, ms", "time each, ms")
    return Figures("Short tasks, two workers", heads, rows, tuple(failures))


def _cost(url: str, folder: Path, work: Wait, client: Any) -> tuple[float, float]:
    """Processor time and time per recording [s], listing and the table included."""
    began, spent = time.monotonic(), _processor_time()
    with Results(folder) as results:
        sources = find_recordings([url])
        summary = run_fleet(open_orders(sources, work, results), results, client)
    assert summary.counts == {"done": len(sources)}, summary.counts
    return (_processor_time() - spent) / len(sources), (time.monotonic() - began) / len(sources)


def _processor_time() -> float:
    """Of this process and of the workers, without the S3 server [s]."""
    me = psutil.Process()
    workers = [p for p in me.children(recursive=True) if not any("moto_server" in word for word in p.cmdline())]
    return sum(p.cpu_times().user + p.cpu_times().system for p in (me, *workers))


def _template(folder: Path) -> bytes:
    """One recording of a simulated stage, 1 s at 1 kHz."""
    stage = SimulatedStage(sample_period=1e-3)
    drive = 5.0 * (1.0 - np.cos(2.0 * np.pi * 4.0 * 1e-3 * np.arange(1000)))
    recording.write(Experiment((stage.play(drive, "triangle"),)), folder / "template")
    (file,) = (folder / "template").iterdir()
    return file.read_bytes()


def _work(folder: Path) -> float:
    """Processor time of the work itself: reading one recording, and waiting for a second [s]."""
    began = time.process_time()
    for _ in range(50):
        experiment = recording.read(folder / "template")
    read = time.process_time()
    for _ in range(3):
        Wait(1.0)(experiment)
    return (read - began) / 50 + (time.process_time() - read) / 3


def _upload(bucket: str, count: int, template: bytes, address: str) -> None:
    server = fs.S3FileSystem(endpoint_override=address, allow_bucket_creation=True, region="us-east-1")
    server.create_dir(bucket, recursive=False)
    for i in range(count):
        with server.open_output_stream(f"{bucket}/stage_{i % STAGES:02d}/2026-{1 + i % 12:02d}-{i:05d}.npz") as file:
            file.write(template)


@contextmanager
def _s3_server() -> Iterator[str]:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    address = f"http://127.0.0.1:{port}"
    command = [ROOT / ".venv-s3" / "bin" / "moto_server", "-H", "127.0.0.1", "-p", str(port)]
    server = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        deadline = time.monotonic() + 60.0
        while True:
            try:
                urllib.request.urlopen(address, timeout=5).close()
                break
            except OSError:
                if time.monotonic() > deadline:
                    raise
                time.sleep(0.1)
        yield address
    finally:
        server.kill()
        server.wait()


if __name__ == "__main__":
    alone(__name__)
