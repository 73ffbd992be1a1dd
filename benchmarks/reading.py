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

"""Recordings of every format, whole and averaged on the way: seconds and memory per million rows.

Every file is written first, then read by a process of its own, so that its memory is its own too.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.figures import Figures, show
from piezo_hysteresis.record import Experiment, Record
from piezo_hysteresis.recording import write
from piezo_hysteresis.recording.segmentation.decimating_buffer import ENOUGH

PERIOD = 1e-4
_READER = """
import json, sys, time
from piezo_hysteresis.recording import read
def largest():
    return 1024 * int(next(line.split()[1] for line in open("/proc/self/status") if line.startswith("VmHWM")))
read(sys.argv[1], sample_period=1e-4)
before, begin = largest(), time.process_time()
experiment = read(sys.argv[2], sample_period=1e-4)
seconds = time.process_time() - begin
print(json.dumps([experiment.size, seconds, largest() - before]))
"""


def arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the benchmark."""
    parser.add_argument("--rows", type=float, nargs="+", default=[1e6, 3e7], metavar="N", help="default: 1e6 3e7")
    parser.add_argument("--formats", nargs="+", default=list(_WRITERS), choices=list(_WRITERS), metavar="NAME")


def run(options: argparse.Namespace) -> list[Figures]:
    """Write and read; every row is one file."""
    rows = []
    for name in options.formats:
        for count in options.rows:
            with tempfile.TemporaryDirectory() as folder:
                rows.append(_read(name, int(count), Path(folder)))
    title = f"Reading voltage and displacement; above {ENOUGH / 1e6:.1f} million rows averaged on the way"
    head = ("format", "rows [10⁶]", "file [GB]", "kept [10⁶]", "s per 10⁶ rows", "memory beyond the imports [GB]")
    return [Figures(title, head, tuple(rows))]


def _read(name: str, count: int, folder: Path) -> tuple[str, float, float, float, float, float]:
    files = []
    for part, size in (("short", 10_000), ("long", count)):
        (folder / part).mkdir()
        files.append(_WRITERS[name](folder / part, *_signals(size)))
    done = subprocess.run([sys.executable, "-c", _READER, *map(str, files)], capture_output=True, text=True, check=True)
    kept, seconds, memory = json.loads(done.stdout)
    whole = files[1].rglob("*") if files[1].is_dir() else [files[1]]
    size = sum(f.stat().st_size for f in whole)
    return name, count / 1e6, size / 1e9, kept / 1e6, seconds / count * 1e6, memory / 1e9


def _signals(size: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    voltage = 5.0 - 5.0 * np.cos(2 * np.pi * 0.5 * PERIOD * np.arange(size))
    return np.round(voltage, 6), np.round(1e-6 * voltage, 12)


def _csv(folder: Path, voltage: NDArray[np.float64], displacement: NDArray[np.float64]) -> Path:
    with (folder / "r.csv").open("w") as file:
        file.write("voltage_V,displacement_m\n")
        for a in range(0, voltage.size, 1 << 18):
            pairs = zip(voltage[a : a + (1 << 18)].tolist(), displacement[a : a + (1 << 18)].tolist(), strict=True)
            file.write("".join(f"{u:.6f},{y:.6e}\n" for u, y in pairs))
    return folder / "r.csv"


def _npz(folder: Path, voltage: NDArray[np.float64], displacement: NDArray[np.float64]) -> Path:
    np.savez(folder / "r.npz", voltage=voltage, displacement=displacement, sample_period=PERIOD)
    return folder / "r.npz"


def _mat5(folder: Path, voltage: NDArray[np.float64], displacement: NDArray[np.float64]) -> Path:
    from scipy import io

    io.savemat(folder / "r.mat", {"voltage": voltage, "displacement": displacement})
    return folder / "r.mat"


def _mat73(folder: Path, voltage: NDArray[np.float64], displacement: NDArray[np.float64]) -> Path:
    import h5py

    with h5py.File(folder / "r.mat", "w", userblock_size=512) as file:
        for name, values in (("voltage", voltage), ("displacement", displacement)):
            file.create_dataset(name, data=values[None, :], chunks=(1, min(values.size, 1 << 16)), compression=1)
    return folder / "r.mat"


def _bag(folder: Path, voltage: NDArray[np.float64], displacement: NDArray[np.float64]) -> Path:
    write(Experiment((Record(voltage, displacement, PERIOD),)), folder / "r.mcap")
    return folder / "r"


_WRITERS: dict[str, Callable[[Path, NDArray[np.float64], NDArray[np.float64]], Path]] = {
    "csv": _csv,
    "npz": _npz,
    "mat5": _mat5,
    "mat73": _mat73,
    "bag": _bag,
}


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments(parser)
    show(run(parser.parse_args()))
