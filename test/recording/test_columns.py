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

"""Experiments as columns of arrays and back."""

import numpy as np
import pytest

from piezo_hysteresis import Experiment, Record, from_columns, to_columns
from piezo_hysteresis.errors import RecordingError

RNG = np.random.default_rng(3)


def _record(phase: str, start: float, size: int = 400, **more: object) -> Record:
    time = 1e-3 * np.arange(size)
    drive = 5.0 - 5.0 * np.cos(2 * np.pi * 5.0 * time)
    return Record(drive, 1e-6 * drive + 1e-9 * RNG.normal(size=size), 1e-3, phase, start_time=start, **more)


EXPERIMENT = Experiment((_record("rest", 0.0), _record("triangle", 0.4, continues=True), _record("triangle", 2.0)))


class Frame:
    """What the columns of a DataFrame and of a Dataset have in common: names, and columns that become arrays."""

    class Series:
        """One column."""

        def __init__(self, values: np.ndarray) -> None:
            self.values = values

        def __array__(self, dtype: object = None, copy: object = None) -> np.ndarray:
            return np.array(self.values, dtype=dtype)

    def __init__(self, columns: dict[str, np.ndarray]) -> None:
        self.columns = {name: self.Series(values) for name, values in columns.items()}

    def __iter__(self):
        return iter(self.columns)

    def __getitem__(self, name: str) -> "Frame.Series":
        return self.columns[name]


@pytest.mark.parametrize("kind", [dict, Frame])
def test_an_experiment_is_the_same_after_a_round_trip(kind: type) -> None:
    again = from_columns(kind(to_columns(EXPERIMENT)))
    assert [r.phase for r in again] == ["rest", "triangle", "triangle"]
    assert [r.continues for r in again] == [False, True, False]
    for record, other in zip(EXPERIMENT, again, strict=True):
        np.testing.assert_array_equal(other.voltage, record.voltage)
        np.testing.assert_array_equal(other.displacement, record.displacement)
        assert other.sample_period == pytest.approx(record.sample_period, rel=1e-9)


def test_pandas_and_xarray_where_they_are_installed() -> None:
    pandas = pytest.importorskip("pandas")
    table = pandas.DataFrame(to_columns(EXPERIMENT))
    np.testing.assert_array_equal(from_columns(table[table.record == 2])[0].voltage, EXPERIMENT[1].voltage)
    pytest.importorskip("xarray")
    np.testing.assert_array_equal(from_columns(table.to_xarray())[2].voltage, EXPERIMENT[2].voltage)


def test_units_and_names_are_read_as_those_of_a_file() -> None:
    drive = EXPERIMENT[0].voltage
    columns = {"Channel A": drive, "sensor": 3.0 * drive}
    (record,) = from_columns(
        columns, names={"voltage": 1, "displacement": "sensor"}, units={"displacement": "um"}, sample_period=1e-3
    )
    np.testing.assert_allclose(record.displacement, 3e-6 * drive)


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        ({}, "no column"),
        ({"time_s": [0.0, 1.0], "voltage_V": [0.0], "displacement_m": [0.0, 1.0]}, "one length"),
        ({"time_s": [0.0, 1.0], "voltage_V": [0.0, 1.0]}, "expected a column for displacement"),
    ],
)
def test_invalid_tables_are_refused(columns: dict[str, list[float]], message: str) -> None:
    with pytest.raises(RecordingError, match=message):
        from_columns(columns)
