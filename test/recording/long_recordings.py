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

"""Recordings of any length, written piece by piece, and reading one of them with little memory."""

from __future__ import annotations

import json
import subprocess
import sys
import zipfile
from pathlib import Path

import h5py
import numpy as np

from piezo_hysteresis.recording import BagWriter
from piezo_hysteresis.recording.bag.block_message import TYPE, BlockMessage

PERIOD = 1e-4
PIECE = 200_000
BLOCK = 10_000
"""Samples in a message of a bag."""

VOLTAGE = 5.0 - 5.0 * np.cos(2 * np.pi * np.arange(PIECE) / PIECE)
DISPLACEMENT = 1e-6 * (VOLTAGE + 0.1 * np.roll(VOLTAGE, 300))


def write(folder: Path, kind: str, rows: int) -> Path:
    """A recording of `rows` samples, a multiple of `PIECE`; a period of its drive is one piece."""
    path = folder / {"csv": "r.csv", "npz": "r.npz", "mat5": "r.mat", "mat73": "r73.mat", "bag": "bag"}[kind]
    {"csv": _csv, "npz": _npz, "mat5": _mat5, "mat73": _mat73, "bag": _bag}[kind](path, rows // PIECE)
    return path


def _csv(path, pieces):
    columns = zip(VOLTAGE.tolist(), DISPLACEMENT.tolist(), strict=True)
    text = "".join(f"{u:.6f},{y:.9e}\n" for u, y in columns)
    with path.open("w") as file:
        file.write("voltage_V,displacement_m\n")
        for _ in range(pieces):
            file.write(text)


def _npz(path, pieces):
    header = {"descr": "<f8", "fortran_order": False, "shape": (pieces * PIECE,)}
    with zipfile.ZipFile(path, "w") as archive:
        for name, values in (("voltage", VOLTAGE), ("displacement", DISPLACEMENT)):
            with archive.open(f"{name}.npy", "w", force_zip64=True) as file:
                np.lib.format.write_array_header_1_0(file, header)
                for _ in range(pieces):
                    file.write(values.tobytes())
        archive.writestr("sample_period.npy", _npy(np.array(PERIOD)))


def _npy(value):
    import io

    file = io.BytesIO()
    np.save(file, value)
    return file.getvalue()


def _mat5(path, pieces):
    with path.open("wb") as file:
        file.write(b"MATLAB 5.0".ljust(124) + (0x0100).to_bytes(2, "little") + b"IM")
        for name, values in (("voltage", VOLTAGE), ("displacement", DISPLACEMENT)):
            title = name.encode().ljust(-(-len(name) // 8) * 8, b"\0")
            head = np.array([6, 8, 6, 0, 5, 8, pieces * PIECE, 1, 1, len(name)], "<u4").tobytes() + title
            tag = np.array([9, 8 * pieces * PIECE], "<u4").tobytes()
            size = len(head) + len(tag) + 8 * pieces * PIECE
            file.write(np.array([14, size], "<u4").tobytes() + head + tag)
            for _ in range(pieces):
                file.write(values.tobytes())


def _mat73(path, pieces):
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in (("voltage", VOLTAGE), ("displacement", DISPLACEMENT)):
            data = file.create_dataset(name, (1, pieces * PIECE), "f8", chunks=(1, PIECE), compression=1)
            for first in range(0, pieces * PIECE, PIECE):
                data[0, first : first + PIECE] = values


def _bag(path, pieces):
    with BagWriter(path) as bag:
        bag.add_topic("/samples", TYPE)
        time, phase = PERIOD * np.arange(BLOCK), np.ones(BLOCK, np.uint32)
        for first in range(0, pieces * PIECE, BLOCK):
            stamp = 1_000_000_000 + round(first * PERIOD * 1e9)
            part = slice(first % PIECE, first % PIECE + BLOCK)
            channels = {"voltage": VOLTAGE[part], "displacement": DISPLACEMENT[part]}
            index = (first + np.arange(BLOCK)).astype(np.uint32)
            bag.write("/samples", stamp, BlockMessage(stamp, channels, phase, time, index).to_cdr())


_READER = """
import json, resource, sys
from piezo_hysteresis.errors import RecordingError
from piezo_hysteresis.recording import read
from piezo_hysteresis.recording.segmentation import decimating_buffer as intake
path, average, enough, room = json.loads(sys.argv[1])
intake.ENOUGH = enough or intake.ENOUGH
from piezo_hysteresis.recording.table import column
column.ENOUGH = intake.ENOUGH
layout = {"sample_period": 1e-4}
read(sys.argv[2], **layout)  # whatever is imported and compiled only now
used = int(next(line.split()[1] for line in open("/proc/self/status") if line.startswith("VmData")))
resource.setrlimit(resource.RLIMIT_DATA, (used * 1024 + room, used * 1024 + room))
try:
    record, = read(path, average=average, **layout)
except RecordingError as error:
    print(json.dumps(str(error)))
else:
    print(json.dumps([record.size, record.sample_period, float(record.voltage.mean())]))
"""


def read_within(room: int, path: Path, short: Path, *, average: int | None = None, enough: int | None = None):
    """Size, period [s] and mean voltage [V] of a record that a process reads with `room` more bytes of memory.

    `short` is a recording of the same kind that it reads before, without a limit.
    """
    arguments = json.dumps([str(path), average, enough, room])
    done = subprocess.run(
        [sys.executable, "-c", _READER, arguments, str(short)], capture_output=True, text=True, timeout=3000
    )
    return json.loads(done.stdout) if done.stdout else done.stderr
