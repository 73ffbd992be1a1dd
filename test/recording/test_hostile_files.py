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

"""Files made to harm: each is refused in one line, or read up to the damage, in little time and memory."""

import os
import sqlite3
import struct
import zipfile
import zlib
from contextlib import closing

import h5py
import lz4.frame
import numpy as np
import pytest
import zstandard

from piezo_hysteresis.errors import PiezoError, RecordingError
from piezo_hysteresis.record import Experiment, Record
from piezo_hysteresis.recording import read, write
from piezo_hysteresis.recording.bag.mcap_file import MAGIC
from piezo_hysteresis.stage.back_ends import BACK_ENDS
from piezo_hysteresis.stage.opening import Opening

from ..piezo_command import piezo

MEMORY = 3 << 30
"""Address space of a process that reads a hostile file; importing the package takes half of it."""


def refused(*words):
    """One line and status 2, in a limited memory; returns the line."""
    done = piezo(*words, memory=MEMORY)
    assert done.returncode == 2, done.stderr[-1000:]
    (line,) = done.stderr.splitlines()
    assert line.startswith("piezo: ")
    return line


def experiment(size=2000):
    voltage = 3.5 + 2.5 * np.sin(2 * np.pi * 10 * np.arange(size) * 1e-3)
    return Experiment((Record(voltage, 1e-6 * voltage, 1e-3, "sine_10hz"),))


def database(path, *statements):
    with closing(sqlite3.connect(path)) as connection:
        for statement in statements:
            connection.execute(statement)
        connection.commit()
    return path


TOPICS = "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT, serialization_format TEXT)"
SAMPLES = "INSERT INTO topics VALUES(1, '/samples', 'sensor_msgs/msg/PointCloud2', 'cdr')"
MESSAGES = "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB)"
ENDLESS = "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n)"
ZEROS = f"CREATE VIEW messages AS {ENDLESS} SELECT i AS id, 1 AS topic_id, i AS timestamp, zeroblob(500000000) AS data"
HOSTILE = {
    "endless_messages": (TOPICS, SAMPLES, f"{ZEROS} FROM n"),
    "endless_topics": (
        f"CREATE VIEW topics AS {ENDLESS} SELECT i AS id, 'a' AS name, 'b' AS type, 'cdr' AS serialization_format "
        "FROM n",
        MESSAGES,
    ),
    "endless_definitions": (
        TOPICS,
        MESSAGES,
        f"CREATE VIEW message_definitions AS {ENDLESS} SELECT i AS topic_type, 'ros2msg' AS encoding, "
        "zeroblob(100000000) AS encoded_message_definition FROM n",
    ),
    "virtual": (TOPICS, "CREATE VIRTUAL TABLE messages USING fts5(id, topic_id, timestamp, data)"),
    "computed": (
        TOPICS,
        SAMPLES,
        "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, "
        "data BLOB GENERATED ALWAYS AS (zeroblob(900000000)) VIRTUAL)",
        "INSERT INTO messages(topic_id, timestamp) VALUES(1, 1)",
    ),
}


@pytest.mark.parametrize("name", HOSTILE)
def test_a_database_that_computes_is_refused(tmp_path, name):
    path = database(tmp_path / f"{name}.db3", *HOSTILE[name])
    assert path.stat().st_size < 40_000
    line = refused("import", path, "-o", tmp_path / "out")
    assert "expected a table as rosbag2 writes it" in line


def test_a_default_value_repeated_in_every_row_ends_at_the_size_of_the_file(tmp_path):
    """Rows of ten bytes, each as long as the literal in the definition of the table once it is read."""
    path = tmp_path / "default.db3"
    long = f"x'{'00' * 100_000}'"
    rows = f"{ENDLESS} INSERT INTO messages(id, topic_id, timestamp) SELECT i, 1, i FROM n LIMIT 50000"
    short = "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER)"
    added = f"ALTER TABLE messages ADD COLUMN data BLOB DEFAULT {long}"
    database(path, TOPICS, SAMPLES, short, rows, added)
    assert "no readable samples" in refused("import", path, "-o", tmp_path / "out")


def test_pages_that_name_one_page_again_and_again_end(tmp_path):
    """An interior page whose 400 entries all lead to the same child, three levels deep: 10⁸ rows in some 100 kB."""
    path = tmp_path / "cycle.db3"
    rows = f"{ENDLESS} INSERT INTO messages SELECT i, 1, i, zeroblob(20) FROM n LIMIT 400000"
    database(path, "PRAGMA page_size = 512", TOPICS, SAMPLES, MESSAGES, rows)
    data = bytearray(path.read_bytes())
    for start in range(512, len(data), 512):
        if data[start] == 5:  # interior page of a table: every child becomes the first one
            cells = struct.unpack_from(">H", data, start + 3)[0]
            places = struct.unpack_from(f">{cells}H", data, start + 12)
            first = data[start + places[0] : start + places[0] + 4]
            for place in places:
                data[start + place : start + place + 4] = first
    path.write_bytes(data)
    assert "no readable samples" in refused("import", path, "-o", tmp_path / "out")


def mcap(path, *records):
    """A file of records: opcode and body."""
    path.write_bytes(MAGIC + b"".join(struct.pack("<BQ", code, len(body)) + body for code, body in records))
    return path


def chunk(data, compression, declared, crc=0):
    name = compression.encode()
    head = struct.pack("<QQQI", 0, 0, declared, crc) + struct.pack("<I", len(name)) + name
    return 6, head + struct.pack("<Q", len(data)) + data


ZEROS_OF_CHUNK = b"\0" * (1 << 26)


@pytest.mark.parametrize("compression", ["zstd", "lz4"])
def test_a_chunk_never_unpacks_to_more_than_it_declares(tmp_path, compression):
    if compression == "zstd":
        data = zstandard.ZstdCompressor().compress(ZEROS_OF_CHUNK)
    else:
        data = lz4.frame.compress(ZEROS_OF_CHUNK)
    honest = chunk(data, compression, len(ZEROS_OF_CHUNK))
    lying = chunk(data, compression, 1000)
    for number, records in enumerate(([honest] * 40, [lying] * 5)):
        path = mcap(tmp_path / f"bomb{number}.mcap", *records)
        assert "no readable samples" in refused("import", path, "-o", tmp_path / "out")


def test_a_frame_with_a_false_size_allocates_no_memory(tmp_path):
    """A frame header of zstd can announce terabytes."""
    frame = bytearray(zstandard.ZstdCompressor(write_content_size=True).compress(b"\0" * 100_000))
    assert frame[4] >> 6 == 2  # the length of the content has four bytes
    frame[5:9] = struct.pack("<I", 0xF0000000)
    path = mcap(tmp_path / "lie.mcap", chunk(bytes(frame), "zstd", 10_000))
    assert "no readable samples" in refused("import", path, "-o", tmp_path / "out")


def test_compressed_bags_are_still_read(tmp_path):
    write(experiment(), tmp_path / "plain.mcap")
    data = (tmp_path / "plain" / "plain_0.mcap").read_bytes()
    for compression, pack in (("zstd", zstandard.ZstdCompressor().compress), ("lz4", lz4.frame.compress)):
        records, at = [], len(MAGIC)
        while at + 9 <= len(data) - len(MAGIC):
            code, length = struct.unpack_from("<BQ", data, at)
            body = data[at + 9 : at + 9 + length]
            at += 9 + length
            if code == 6:
                inside = body[28 + 4 + 8 :]
                body = chunk(pack(inside), compression, len(inside), zlib.crc32(inside))[1]
            records.append((code, body))
            if code == 2:
                break
        (record,) = read(mcap(tmp_path / f"{compression}.mcap", *records))
        np.testing.assert_array_equal(record.voltage, experiment()[0].voltage)


def test_an_empty_path_is_none(tmp_path):
    """The present folder was read: a shell variable that was not set named any recording in it."""
    assert "got no path" in refused("import", "", "-o", str(tmp_path / "experiment"))


@pytest.mark.parametrize(
    "name", ["bag.mcap", "bag.db3", "table.csv", "x.npz", "x.mat", "x.dat", "x", "x.tdms", "x.npy"]
)
@pytest.mark.parametrize("kind", ["pipe", "/dev/zero", "/dev/null"])
def test_pipes_and_devices_are_refused(tmp_path, name, kind):
    path = tmp_path / name
    os.mkfifo(path) if kind == "pipe" else path.symlink_to(kind)
    with pytest.raises(RecordingError, match="pipe or a device"):
        read(path)


@pytest.mark.parametrize("format", ["csv", "npz", "mat", "gcs_array", "rosbag2"])
@pytest.mark.parametrize("device", ["/dev/zero", "/dev/null"])
def test_a_device_is_refused_in_whatever_format_it_is_said_to_be(device, format):
    with pytest.raises(RecordingError, match="pipe or a device"):
        read(device, format=format)


@pytest.mark.parametrize("inside", ["02_more.npz", "decimate.yaml"])
def test_a_pipe_inside_a_folder_is_found(tmp_path, inside):
    write(experiment(), tmp_path / "folder")
    os.mkfifo(tmp_path / "folder" / inside)
    assert inside in refused("import", tmp_path / "folder", "-o", tmp_path / "out")


@pytest.mark.parametrize("inside", ["metadata.yaml", "bag_1.mcap", "notes.txt"])
def test_a_pipe_in_the_folder_of_a_bag_is_ignored(tmp_path, inside):
    write(experiment(), tmp_path / "bag.mcap")
    (tmp_path / "bag" / inside).unlink(missing_ok=True)
    os.mkfifo(tmp_path / "bag" / inside)
    done = piezo("import", tmp_path / "bag", "-o", tmp_path / "out", memory=MEMORY)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("end", ["-wal", "-journal", "-shm"])
def test_a_pipe_next_to_a_database_is_found(tmp_path, end):
    path = database(tmp_path / "bag.db3", TOPICS, SAMPLES, MESSAGES)
    os.mkfifo(f"{path}{end}")
    assert f"bag.db3{end}" in refused("import", path, "-o", tmp_path / "out")


ALIASES = "\n".join(["x0: &x0 [1, 2]", *(f"x{k}: &x{k} [{', '.join([f'*x{k - 1}'] * 10)}]" for k in range(1, 10))])
SETTINGS = {
    "aliases": ALIASES,
    "base 60": "x: " + ":".join(["1"] * 30_000),
    "long": "#" * 10_000_000,
    "deep": "[" * 60_000,
    "date": "x: 2024-13-77",
    "binary": "\x00\x01",
}


@pytest.mark.parametrize("name", SETTINGS)
def test_hostile_settings_are_refused(tmp_path, name):
    path = tmp_path / "plant.yaml"
    path.write_text(SETTINGS[name])
    refused("simulate", "-o", tmp_path / "out", "--plant", path)
    with pytest.raises(PiezoError):
        BACK_ENDS["simulated"].open(stage_values(path), Opening(2e-5))


def test_settings_from_pipes_and_devices_are_refused(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path / "pipe", "/dev/zero", "/dev/null", tmp_path):
        assert "expected a regular file" in refused("simulate", "-o", tmp_path / "out", "--plant", path)
        with pytest.raises(PiezoError, match="expected a regular file"):
            BACK_ENDS["simulated"].open(stage_values(path), Opening(2e-5))


def stage_values(path):
    return {row.name: row.value for row in BACK_ENDS["simulated"].rows} | {"plant_file": str(path)}


@pytest.mark.parametrize("shape", ["(-5,)", "(True,)", "(400, -1)", "(99999999999999999999,)", "(False,)"])
def test_shapes_that_no_array_has_are_refused(tmp_path, shape):
    head = f"{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}".ljust(117) + "\n"
    array = b"\x93NUMPY\x01\x00" + struct.pack("<H", len(head)) + head.encode() + b"\0" * 3200
    with zipfile.ZipFile(tmp_path / "01_x.npz", "w") as archive:
        for name in ("voltage", "displacement", "sample_period"):
            archive.writestr(f"{name}.npy", array)
    with pytest.raises(PiezoError, match=r"01_x\.npz"):
        read(tmp_path / "01_x.npz")


@pytest.mark.parametrize("tag", [b"NUMPY:M8", b"NUMPY:M8[7ns/3]", b"NUMPY:a5", b"NUMPY:M8[0s]", b"NUMPY:b1,i4"])
def test_dates_and_other_types_in_hdf5_are_refused_without_a_warning(tmp_path, tag):
    with h5py.File(tmp_path / "dates.mat", "w") as file:
        kind = h5py.h5t.create(h5py.h5t.OPAQUE, 8)
        kind.set_tag(tag)
        h5py.h5d.create(file.id, b"voltage", kind, h5py.h5s.create_simple((400,)))
        file["displacement"], file["sample_period"] = np.arange(400.0), 1e-3
    with pytest.raises(PiezoError, match=r"dates\.mat"):
        read(tmp_path / "dates.mat")


def test_numbers_of_hdf5_that_lie_in_other_files_are_refused(tmp_path):
    (tmp_path / "secret").write_bytes(np.arange(400.0).tobytes())
    with h5py.File(tmp_path / "external.mat", "w") as file:
        place = [(str(tmp_path / "secret"), 0, 3200)]
        file.create_dataset("voltage", (400,), "f8", external=place)
        file["displacement"], file["sample_period"] = np.arange(400.0), 1e-3
    with pytest.raises(PiezoError, match="in other files"):
        read(tmp_path / "external.mat")
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["voltage"] = np.arange(400.0)
    with h5py.File(tmp_path / "virtual.mat", "w") as file:
        options = h5py.VirtualLayout((400,), "f8")
        options[:] = h5py.VirtualSource(str(tmp_path / "other.h5"), "voltage", (400,))
        file.create_virtual_dataset("voltage", options)
        file["displacement"], file["sample_period"] = np.arange(400.0), 1e-3
    with pytest.raises(PiezoError, match="in other files"):
        read(tmp_path / "virtual.mat")
