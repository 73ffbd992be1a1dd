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

"""Small recordings of three stages, a Dask cluster of two real processes, and an S3 server on this machine."""

from __future__ import annotations

import socket
import subprocess
import time
import urllib.request
from pathlib import Path

import pytest

from piezo_hysteresis import recording
from piezo_hysteresis.identification.protocol import excitation
from piezo_hysteresis.identification.protocol.drive_limits import DriveLimits
from piezo_hysteresis.record import Experiment
from piezo_hysteresis.stage.plant import PlantParameters
from piezo_hysteresis.stage.simulated import SimulatedStage

ROOT = Path(__file__).parents[2]
S3_SERVER = ROOT / ".venv-s3" / "bin" / "moto_server"
PLACES = [f"stage_{name}/2026-{month}-03" for name in "abc" for month in ("10", "11")]


def play(seed: int, name: str = "triangle") -> Experiment:
    limits = DriveLimits(sample_period=4e-3)
    stage = SimulatedStage(PlantParameters(), seed=seed, sample_period=4e-3)
    drives = ((name, excitation.triangle(limits, (1.0, 0.5), 2.0)), ("validation", excitation.sine(limits, 2.0, 1.0)))
    return Experiment(
        tuple(
            stage.play(limits.from_safe_to_safe(drive), phase, continues=i > 0)
            for i, (phase, drive) in enumerate(drives)
        )
    )


def store(places, folder: Path, first: int = 0) -> None:
    for seed, place in enumerate(places):
        (folder / place).parent.mkdir(parents=True, exist_ok=True)
        recording.write(play(first + seed), folder / place)


@pytest.fixture(scope="session")
def model_text() -> str:
    return (ROOT / "config" / "published_stage.yaml").read_text()


@pytest.fixture
def recordings(tmp_path) -> Path:
    """Two recordings of each of three stages, and one that is damaged."""
    folder = tmp_path / "recordings"
    store(PLACES, folder)
    (folder / "stage_c" / "2026-11-04.npz").write_bytes(b"PK\x03\x04 cut short")
    return folder


@pytest.fixture(scope="session")
def client():
    """Two warm worker processes of one thread."""
    pytest.importorskip("distributed")
    from piezo_hysteresis.fleet.cluster import cluster

    with cluster(workers=2) as started:
        yield started


@pytest.fixture(scope="session")
def s3_server():
    """Address of an S3 server on this machine."""
    if not S3_SERVER.exists():
        pytest.skip("no S3 server: `scripts/setup-checks` installs one into .venv-s3")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    address = f"http://127.0.0.1:{port}"
    server = subprocess.Popen(
        [S3_SERVER, "-H", "127.0.0.1", "-p", str(port)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    try:
        for _ in range(600):
            try:
                urllib.request.urlopen(address, timeout=5).close()
                break
            except OSError:
                assert server.poll() is None
                time.sleep(0.1)
        yield address
    finally:
        server.kill()
        server.wait()
