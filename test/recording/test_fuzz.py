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

"""Whatever bytes a reader meets, it answers with an experiment or with one clear line."""

import random
import shutil
import tracemalloc

import h5py
import numpy as np
import pytest

from piezo_hysteresis.errors import PiezoError
from piezo_hysteresis.record import Experiment, Record
from piezo_hysteresis.recording import read, write

FILES = {
    "phases/01_sine_10hz.npz": None,
    "table.csv": None,
    "matlab.mat": None,
    "bag/bag_0.mcap": None,
    "hdf5.mat": None,
    "array.dat": None,
    "bag.db3": None,
}


def experiment():
    generator = np.random.default_rng(0)
    time = np.arange(400) * 1e-3
    voltage = 3.5 + 2.5 * np.sin(2 * np.pi * 10 * time)
    return Experiment((Record(voltage, 1e-6 * voltage + 1e-9 * generator.normal(size=400), 1e-3, "sine_10hz"),))


@pytest.fixture(scope="module")
def intact(tmp_path_factory):
    """One valid file of every format."""
    folder = tmp_path_factory.mktemp("intact")
    (record,) = sent = experiment()
    write(sent, folder / "phases")
    write(sent, folder / "table.csv")
    write(sent, folder / "matlab.mat")
    write(sent, folder / "bag.mcap")
    with h5py.File(folder / "hdf5.mat", "w", userblock_size=512) as file:
        for name in ("voltage", "displacement", "sample_period"):
            file.create_dataset(name, data=np.atleast_2d(getattr(record, name)), compression="gzip")
    rows = "".join(
        f"{u!r} {1e6 * y!r} \n" for u, y in zip(record.voltage.tolist(), record.displacement.tolist(), strict=True)
    )
    header = f"# TYPE = 1 \n# SEPARATOR = 32 \n# DIM = 2 \n# SAMPLE_TIME = 0.001 \n# NDATA = {record.size} \n"
    names = "# NAME0 = Voltage of output channel 1 \n# NAME1 = Position of axis 1 \n# \n# END_HEADER \n"
    (folder / "array.dat").write_text(header + names + rows)
    _to_sqlite(folder / "bag" / "bag_0.mcap", folder / "bag.db3")
    return folder


def _to_sqlite(mcap, path):
    from rosbags.rosbag2 import Reader, StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_KILTED)
    other = path.parent / "other"
    with Reader(mcap.parent) as reader, Writer(other, version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
        topics = {c.topic: writer.add_connection(c.topic, c.msgtype, typestore=store) for c in reader.connections}
        for connection, time_ns, raw in reader.messages():
            writer.write(topics[connection.topic], time_ns, raw)
    shutil.copy(other / "other.db3", path)


def read_or_refuse(path):
    try:
        return read(path)
    except PiezoError as error:
        line = str(error)
    assert path.name in line
    assert "\n" not in line
    return None


@pytest.mark.parametrize("name", FILES)
def test_the_intact_file_is_read(intact, name):
    (record,) = read(intact / name)
    np.testing.assert_allclose(record.voltage, experiment()[0].voltage, rtol=1e-12)
    np.testing.assert_allclose(record.displacement, experiment()[0].displacement, rtol=1e-12)
    assert record.sample_period == 1e-3


@pytest.mark.parametrize("seed", range(25))
@pytest.mark.parametrize("name", FILES)
def test_changed_bytes_are_refused_or_read(intact, tmp_path, name, seed):
    chance = random.Random(f"{name} {seed}")
    data = bytearray((intact / name).read_bytes())
    where = chance.choice((len(data), 200, len(data)))  # headers deserve more than their share
    for _ in range(chance.choice((1, 3, 30))):
        at = chance.randrange(min(where, len(data)))
        change = chance.randrange(4)
        if change == 0:
            data[at] = chance.randrange(256)
        elif change == 1:
            data[at : at + 8] = chance.choice((b"\xff" * 8, b"\0" * 8, chance.randbytes(8)))
        elif change == 2:
            del data[at : at + chance.randrange(1, 20)]
        else:
            data[at:at] = data[at : at + chance.randrange(1, 50)]
    path = tmp_path / name.replace("/", "_")
    path.write_bytes(data)
    read_or_refuse(path)


@pytest.mark.parametrize("share", [0.0, 0.01, 0.1, 0.5, 0.9, 0.99])
@pytest.mark.parametrize("name", FILES)
def test_files_that_end_early_are_refused_or_read(intact, tmp_path, name, share):
    data = (intact / name).read_bytes()
    path = tmp_path / name.replace("/", "_")
    path.write_bytes(data[: int(share * len(data))])
    read_or_refuse(path)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("ending", [".npz", ".csv", ".mat", ".mcap", ".db3", ".dat", ".tsv", ""])
def test_random_bytes_are_refused(tmp_path, ending, seed):
    path = tmp_path / f"noise{ending}"
    path.write_bytes(random.Random(seed).randbytes(random.Random(seed).choice((0, 1, 20, 5000))))
    read_or_refuse(path)


@pytest.mark.parametrize("name", FILES)
def test_memory_stays_in_proportion_to_the_file(intact, tmp_path, name):
    """Every eight bytes in turn become the largest length there is."""
    data = (intact / name).read_bytes()
    path = tmp_path / name.replace("/", "_")
    tracemalloc.start()
    try:
        for at in range(0, min(len(data), 600), 29):
            path.write_bytes(data[:at] + b"\xff\xff\xff\x7f" + data[at + 4 :])
            tracemalloc.reset_peak()
            read_or_refuse(path)
            assert tracemalloc.get_traced_memory()[1] < 100e6 + 100 * len(data)
    finally:
        tracemalloc.stop()


def test_a_folder_or_file_that_is_not_there_is_named(tmp_path):
    read_or_refuse(tmp_path / "nothing")
    read_or_refuse(tmp_path)
