"""Large files: what is not wanted is never kept, and what is averaged is averaged on the way."""

import h5py
import numpy as np
import pytest
from scipy import io

from piezo_hysteresis.errors import RecordingError
from piezo_hysteresis.recording import intake, read

PERIOD = 1e-4
ROWS = 60_000
VOLTAGE = np.round(5.0 - 5.0 * np.cos(2 * np.pi * 2.0 * PERIOD * np.arange(ROWS)), 6)
MICRONS = np.round(VOLTAGE + 0.1 * np.roll(VOLTAGE, 300), 6)
CSV = {"columns": {"voltage": 1, "displacement": 2}, "units": {"displacement": "um"}}
OPTIONS = {"sample_period": PERIOD, "phases": "record"}


@pytest.fixture(scope="module", params=["csv", "mat5", "mat73"])
def source(request, tmp_path_factory):
    """The same record as a table, as version 5 and as a matrix of version 7.3; and how to read it."""
    folder = tmp_path_factory.mktemp("large")
    matrix = np.stack((VOLTAGE, MICRONS), axis=1)
    if request.param == "csv":
        np.savetxt(folder / "r.csv", matrix, fmt="%.6f", delimiter=",")
        return folder / "r.csv", CSV
    columns = {"columns": {"voltage": "m[1]", "displacement": "m[2]"}, "units": CSV["units"]}
    if request.param == "mat5":
        io.savemat(folder / "r.mat", {"m": matrix})
    else:
        with h5py.File(folder / "r.mat", "w", userblock_size=512) as file:
            file.create_dataset("m", data=matrix.T, chunks=(1, 4096), compression="gzip")
    return folder / "r.mat", columns


def test_averaging_while_reading_is_decimation(source):
    path, layout = source
    (averaged,) = read(path, average=7, **layout, **OPTIONS)
    (whole,) = read(path, **layout, **OPTIONS)
    decimated = whole.decimate(7)
    np.testing.assert_allclose(averaged.voltage, decimated.voltage, rtol=1e-12)
    np.testing.assert_allclose(averaged.displacement, decimated.displacement, rtol=1e-12)
    assert averaged.sample_period == pytest.approx(7 * PERIOD)


def test_a_part_is_the_same_as_that_part_of_the_whole(source):
    path, layout = source
    (part,) = read(path, rows=(31_234, 50_001), **layout, **OPTIONS)
    np.testing.assert_array_equal(part.voltage, VOLTAGE[31_234:50_001])
    assert part.truncated
    (last,) = read(path, rows=(-500, None), **layout, **OPTIONS)
    np.testing.assert_array_equal(last.voltage, VOLTAGE[-500:])
    (third,) = read(path, rows=(3_000, 9_000), average=3, initial_voltage=0.0, **layout, **OPTIONS)
    np.testing.assert_allclose(third.voltage, VOLTAGE[3_000:9_000].reshape(-1, 3).mean(axis=1), rtol=1e-12)
    assert not third.truncated
    with pytest.raises(RecordingError, match="60000 rows that is not empty"):
        read(path, rows=(70_000, 80_000), **layout, **OPTIONS)


def test_more_than_the_memory_is_meant_to_hold_is_refused_with_the_way_out(source, monkeypatch):
    path, layout = source
    monkeypatch.setattr(intake, "MOST", 50_000)
    with pytest.raises(RecordingError, match=r"more than 50000 samples.*rows, or average"):
        read(path, **layout, **OPTIONS)
    assert read(path, average=2, **layout, **OPTIONS).size == ROWS // 2


def test_the_times_and_labels_of_a_table_are_averaged_with_it(tmp_path):
    labels = np.where(np.arange(600) < 300, "rest", "triangle")
    rows = "".join(f"{PERIOD * i:.4f},{VOLTAGE[i]},{MICRONS[i]},{labels[i]}\n" for i in range(600))
    (tmp_path / "t.csv").write_text("time_s,voltage_V,displacement_um,phase\n" + rows)
    rest, triangle = read(tmp_path / "t.csv", average=10)
    assert (rest.phase, rest.size, triangle.phase, triangle.size) == ("rest", 30, "triangle", 30)
    assert rest.sample_period == pytest.approx(10 * PERIOD)
    assert triangle.continues
