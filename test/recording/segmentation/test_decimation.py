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

"""A bag that says which of its phases are slow is read like that, unless the reader says otherwise."""

import numpy as np
import pytest

from piezo_hysteresis.errors import RecordingError
from piezo_hysteresis.record import Experiment, Record
from piezo_hysteresis.recording import read, write
from piezo_hysteresis.recording.segmentation.decimation import FILE, load_decimation, save_decimation


def test_slow_phases_are_averaged_on_reading(tmp_path):
    voltage = np.arange(100.0)
    records = [Record(voltage, 1e-6 * voltage, 1e-3, phase=name) for name in ("triangle", "step")]
    write(Experiment(tuple(records)), tmp_path / "run", format="rosbag2")
    assert load_decimation(tmp_path / "run") == {}
    save_decimation(tmp_path / "run", {"triangle": 10})
    triangle, step = read(tmp_path / "run")
    assert (triangle.sample_period, step.sample_period) == (1e-2, 1e-3)
    np.testing.assert_array_equal(triangle.voltage, voltage.reshape(10, 10).mean(axis=1))
    assert [r.size for r in read(tmp_path / "run", decimate={})] == [100, 100]


@pytest.mark.parametrize("text", ["- 1", "triangle: 0", "triangle: ten", "[", "\xff"])
def test_a_broken_file_is_reported(tmp_path, text):
    (tmp_path / FILE).write_text(text, encoding="latin-1")
    with pytest.raises(RecordingError, match="expected phase names and whole numbers"):
        load_decimation(tmp_path)
