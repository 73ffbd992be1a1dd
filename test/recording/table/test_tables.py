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

"""Tables of other software: columns, units, sample periods, missing cells, and a measured record."""

import math
import os
from pathlib import Path

import h5py
import numpy as np
import pytest
from scipy import io

from piezo_hysteresis.errors import PiezoError, RecordError, RecordingError
from piezo_hysteresis.recording import read

TIME = np.arange(200) * 5e-3
VOLTAGE = 1.8 + 1.8 * np.sin(2 * np.pi * TIME)
MICRONS = 12.0 * VOLTAGE - 100.0


def kinds(experiment):
    return {notice.kind for notice in experiment.notices}


def text(delimiter, header="", comma=False, number="{:.9g}"):
    rows = (delimiter.join(number.format(x) for x in row) for row in zip(TIME, VOLTAGE, MICRONS, strict=True))
    body = "\n".join(rows) + "\n"
    return header + (body.replace(".", ",") if comma else body)


@pytest.mark.parametrize(
    "content",
    [
        text(",", "time_s,voltage_V,displacement_um\n"),
        text(";", "Time [s];Voltage [V];Displacement [µm]\n", comma=True),
        text("\t", "Instrument 12\nsome words 1 2\n\ntime (s)\tvoltage (V)\tdisplacement (um)\n"),
        text("   ", "# time_s voltage_V displacement_um\n"),
        text(",", '\ufeff"time_s","voltage_V","displacement_um"\n'),
        text(",", "time_s,voltage_V,displacement_um\n").replace("\n", "\r\n"),
    ],
)
def test_titles_give_channels_and_units(tmp_path, content):
    (tmp_path / "table.csv").write_text(content, encoding="utf-8", newline="")
    (record,) = read(tmp_path / "table.csv", phases="sine_1hz")
    np.testing.assert_allclose(record.voltage, VOLTAGE, rtol=1e-8)
    np.testing.assert_allclose(record.displacement, MICRONS * 1e-6, rtol=1e-8)
    assert record.sample_period == 5e-3


@pytest.mark.parametrize(
    ("titles", "units"),
    [
        ("Zeit [s];Spannung [mV];Weg [nm]", (1e-3, 1e-9)),
        ("t_s;Piezo Voltage;Sensor (um)", (1.0, 1e-6)),
        ("Time (s);u;y_um", (1.0, 1e-6)),
        ("elapsed time;Drive/V;Position/um", (1.0, 1e-6)),
    ],
)
def test_titles_of_other_software_are_understood_where_they_leave_no_doubt(tmp_path, titles, units):
    (tmp_path / "t.csv").write_text(text(";", f"{titles}\n"), encoding="utf-8")
    (record,) = experiment = read(tmp_path / "t.csv", phases="sine_1hz")
    np.testing.assert_allclose(record.voltage, VOLTAGE * units[0], rtol=1e-8)
    np.testing.assert_allclose(record.displacement, MICRONS * units[1], rtol=1e-8)
    (notice,) = (n for n in experiment.notices if n.kind == "columns")
    assert all(title in notice.message for title in titles.split(";")[1:])


def test_the_notice_of_columns_names_all_that_are_used(tmp_path):
    (tmp_path / "t.csv").write_text(text(";", "Time (s);Drive (V);Axis 1 Displacement (um)\n"))
    (notice,) = (n for n in read(tmp_path / "t.csv").notices if n.kind == "columns")
    assert "time = 'Time (s)' in s" in notice.message


def test_titles_that_leave_a_doubt_are_not_guessed(tmp_path):
    (tmp_path / "t.csv").write_text(text(";", "t [s];Sensor A [um];Sensor B [um]\n"))
    with pytest.raises(RecordingError, match="expected a column for voltage"):
        read(tmp_path / "t.csv")
    (record,) = read(tmp_path / "t.csv", columns={"voltage": 2, "displacement": "Sensor B [um]"}, phases="x")
    np.testing.assert_allclose(record.displacement, MICRONS * 1e-6, rtol=1e-8)


def test_latin_1_of_old_instruments(tmp_path):
    (tmp_path / "t.txt").write_bytes(text("\t", "time [s]\tvoltage [V]\tdisplacement [µm]\n").encode("latin-1"))
    np.testing.assert_allclose(read(tmp_path / "t.txt")[0].displacement, MICRONS * 1e-6, rtol=1e-8)


@pytest.mark.parametrize("delimiter", [",", ";", "\t", " "])
def test_columns_of_a_table_without_titles_are_numbered_from_one(tmp_path, delimiter):
    (tmp_path / "t.dat").write_text(text(delimiter))
    (record,) = read(
        tmp_path / "t.dat",
        columns={"voltage": 2, "displacement": "3"},
        units={"voltage": "mV", "displacement": "nm"},
        sample_period=1e-3,
        initial_voltage=0.0,
        phases="sine_5hz",
    )
    np.testing.assert_allclose(record.voltage, VOLTAGE * 1e-3, rtol=1e-8)
    np.testing.assert_allclose(record.displacement, MICRONS * 1e-9, rtol=1e-8)
    assert (record.sample_period, record.initial_voltage) == (1e-3, 0.0)


def test_rows_are_a_python_slice(tmp_path):
    (tmp_path / "t.dat").write_text(text(" "))
    for rows, part in (((10, 60), slice(10, 60)), ((None, -20), slice(None, -20)), ((150, None), slice(150, None))):
        (record,) = read(
            tmp_path / "t.dat", columns={"voltage": 2, "displacement": 3}, sample_period=1.0, rows=rows, phases="x"
        )
        np.testing.assert_allclose(record.voltage, VOLTAGE[part], rtol=1e-8)


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({}, "expected a column for voltage"),
        ({"columns": {"voltage": 2, "displacement": 9}}, "got 9 for displacement"),
        ({"columns": {"voltage": "U", "displacement": 3}}, "got 'U' for voltage"),
        ({"columns": {"voltage": 2, "displacement": 3}}, "sample_period"),
        ({"columns": {"voltage": 2, "displacement": 3}, "units": {"displacement": "inch"}}, "got 'inch'"),
        ({"columns": {"current": 2}}, "channel 'current'"),
        ({"columns": {"voltage": 0, "displacement": 1}}, "counted from 1"),
        ({"sample_period": -1.0}, "positive"),
        ({"columns": {"voltage": 2, "displacement": 3}, "sample_period": 1.0, "rows": (500, 600)}, "rows"),
        (
            {"columns": {"voltage": 2, "displacement": 3}, "sample_period": 1.0, "phases": [(0.5, "a"), (0.1, "b")]},
            "growing",
        ),
        ({"format": "wav"}, "expected one of"),
    ],
)
def test_missing_and_invalid_columns_are_reported(tmp_path, options, says):
    (tmp_path / "t.dat").write_text(text(" "))
    with pytest.raises(RecordingError, match=says):
        read(tmp_path / "t.dat", **options)


def test_cells_without_a_number_split_the_record_and_are_counted(tmp_path):
    lines = text(",", "time_s,voltage_V,displacement_um\n").splitlines()
    lines[51:55] = [line.rsplit(",", 1)[0] + "," for line in lines[51:55]]
    lines[55] = lines[55].rsplit(",", 1)[0] + ",overflow"
    (tmp_path / "t.csv").write_text("\n".join(lines))
    experiment = read(tmp_path / "t.csv", phases="x")
    assert [(r.size, r.truncated) for r in experiment] == [(50, False), (145, True)]
    assert {"non_finite", "not_a_number"} <= kinds(experiment)


def test_a_gap_in_time_splits_the_record(tmp_path):
    lines = text(",", "time_s,voltage_V,displacement_um\n").splitlines()
    del lines[101:111]
    (tmp_path / "t.csv").write_text("\n".join(lines))
    first, second = experiment = read(tmp_path / "t.csv", phases="x")
    assert (first.size, second.size, second.truncated) == (100, 90, True)
    assert second.start_time == pytest.approx(110 * 5e-3)
    assert any(n.kind == "gap" and "10 samples" in n.message for n in experiment.notices)


def test_late_time_stamps_are_no_gaps(tmp_path):
    """The times of a busy computer scatter by a tenth of the period, and no sample is missing but two, in a sine."""
    time = np.arange(4000) * 1e-3
    stamps = time + 1e-4 * np.random.default_rng(1).normal(size=time.size)
    assert np.diff(stamps).max() > 1.5e-3
    rows = np.column_stack((stamps, np.sin(9.0 * time), np.sin(9.0 * time)))
    there = np.ones(time.size, bool)
    there[[1700, 3000]] = False
    np.savetxt(tmp_path / "t.csv", rows[there], delimiter=",", header="time_s,voltage_V,displacement_um", comments="")
    experiment = read(tmp_path / "t.csv", phases="x")
    assert [r.size for r in experiment] == [4000]
    messages = {n.kind: n.message for n in experiment.notices}
    assert messages["gap"] == "2 samples are missing in 2 places"
    assert messages["interpolated"].startswith("2 lost samples")
    assert "time_base" in messages


def test_a_rejected_cell_is_shown(tmp_path):
    lines = text(",", "time_s,voltage_V,displacement_um\n").splitlines()
    lines[60:70] = [",".join((*line.split(",")[:2], '"1,234.5"')) for line in lines[60:70]]
    (tmp_path / "t.csv").write_text("\n".join(lines))
    experiment = read(tmp_path / "t.csv", phases="x")
    (message,) = [n.message for n in experiment.notices if n.kind == "not_a_number"]
    assert message == "10 cells are empty or hold no number, e.g. '1,234.5'"


def test_a_row_without_a_time_is_named(tmp_path):
    table = text(",", "time_s,voltage_V,displacement_um\n")
    (tmp_path / "t.csv").write_text(table + "End of file\nmax,9.5,43\n")
    with pytest.raises(RecordError, match="time: got no number in row 201 of 202"):
        read(tmp_path / "t.csv")


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-be"])
def test_utf_16_is_named(tmp_path, encoding):
    mark = "\ufeff" if encoding == "utf-16-be" else ""
    (tmp_path / "t.csv").write_text(mark + text(",", "time_s,voltage_V,displacement_um\n"), encoding=encoding)
    with pytest.raises(RecordingError, match="got text in UTF-16"):
        read(tmp_path / "t.csv")


def test_a_row_that_is_written_twice_is_used_once(tmp_path):
    lines = text(",", "time_s,voltage_V,displacement_um\n").splitlines()
    (tmp_path / "t.csv").write_text("\n".join([*lines[:50], lines[49], *lines[50:]]))
    (record,) = experiment = read(tmp_path / "t.csv", phases="x")
    assert record.size == 200 and "duplicate" in kinds(experiment)


def test_after_a_repeated_time_the_state_continues(tmp_path):
    """The values differ from those of the row before, so that the row may be a sample."""
    lines = text(",", "time_s,voltage_V,displacement_um\n").splitlines()
    twice = lines[49].split(",")[0] + "," + lines[50].split(",", 1)[1]
    (tmp_path / "t.csv").write_text("\n".join([*lines[:50], twice, *lines[50:]]))
    first, second = experiment = read(tmp_path / "t.csv", phases="x")
    assert first.size + second.size == 201
    assert second.continues and not second.truncated and "non_monotonic" in kinds(experiment)


def test_after_a_time_that_decreases_nothing_continues(tmp_path):
    lines = text(",", "time_s,voltage_V,displacement_um\n").splitlines()
    (tmp_path / "t.csv").write_text("\n".join([*lines[:100], *lines[50:]]))
    _, second = read(tmp_path / "t.csv", phases="x")
    assert second.truncated and not second.continues


def test_rounded_times_are_one_record_and_one_finding(tmp_path):
    time = np.round(np.arange(4000) * 5e-4, 3)
    rows = np.column_stack((time, np.sin(9.0 * time), np.sin(9.0 * time)))
    np.savetxt(tmp_path / "t.csv", rows, "%.6f", ",", header="time_s,voltage_V,displacement_um", comments="")
    (record,) = experiment = read(tmp_path / "t.csv", phases="x")
    assert record.sample_period == pytest.approx(5e-4, rel=1e-3)
    assert [n.kind for n in experiment.notices if "sample_period" in n.message] == ["time_base"]


def test_phases_of_a_table_in_one_go_continue(tmp_path):
    rows = "".join(
        f"{t:.6g},{u:.6g},{y:.6g},{'rest' if t < 0.3 else 'triangle'}\n"
        for t, u, y in zip(TIME, VOLTAGE, MICRONS, strict=True)
    )
    (tmp_path / "t.csv").write_text("time_s,voltage_V,displacement_um,phase\n" + rows)
    rest, triangle = read(tmp_path / "t.csv")
    assert (rest.phase, rest.size, rest.continues) == ("rest", 60, False)
    assert (triangle.phase, triangle.size, triangle.continues) == ("triangle", 140, True)


def test_a_table_larger_than_a_block_is_read_piecewise(tmp_path):
    numbers = np.random.default_rng(0).normal(size=(60_000, 2))
    with (tmp_path / "t.txt").open("w") as file:
        file.writelines(f"{a!r} {b!r}\n" for a, b in numbers.tolist())
    assert (tmp_path / "t.txt").stat().st_size > 2 << 20
    (record,) = read(tmp_path / "t.txt", columns={"voltage": 1, "displacement": 2}, sample_period=1e-4, phases="noise")
    np.testing.assert_array_equal(np.stack((record.voltage, record.displacement), axis=1), numbers)


GCS = """# REM Controller
# TYPE = 1
# SEPARATOR = 9
# DIM = 3
# SAMPLE_TIME = 5.00000e-03
# NDATA = {n}
# NAME0 = Commanded Position of axis:A
# NAME1 = Current Position of axis:A
# NAME2 = Voltage of output chan:1
# END_HEADER
"""


def test_a_gcs_array_names_its_columns_and_its_period(tmp_path):
    rows = "".join(f"0.0\t{y:.9g}\t{u:.9g} \n" for y, u in zip(MICRONS, VOLTAGE, strict=True))
    (tmp_path / "a.dat").write_text(GCS.format(n=200) + rows)
    (record,) = read(tmp_path / "a.dat", phases="sine_1hz")
    np.testing.assert_allclose(record.voltage, VOLTAGE, rtol=1e-8)
    np.testing.assert_allclose(record.displacement, MICRONS * 1e-6, rtol=1e-8)
    assert record.sample_period == 5e-3
    (tmp_path / "b.dat").write_text(GCS.format(n=300) + rows)
    assert "cut" in kinds(read(tmp_path / "b.dat"))
    (record,) = read(
        tmp_path / "a.dat", phases="x", columns={"displacement": 3, "voltage": 2}, units={"displacement": "m"}
    )
    np.testing.assert_allclose(record.displacement, VOLTAGE, rtol=1e-8)


@pytest.mark.parametrize("version", ["5", "7.3"])
def test_variables_fields_and_matrix_columns_of_matlab(tmp_path, version):
    path = tmp_path / "m.mat"
    matrix = np.stack((VOLTAGE, MICRONS), axis=1)
    if version == "5":
        io.savemat(path, {"run": {"m": matrix, "Ts": 5e-3}, "unused": np.eye(3)}, do_compression=True)
    else:
        with h5py.File(path, "w", userblock_size=512) as file:
            file["run/m"] = matrix.T  # MATLAB stores column by column
            file["run/Ts"] = [[5e-3]]
    options = {"columns": {"voltage": "run.m[1]", "displacement": "run.m[2]", "sample_period": "run.Ts"}}
    (record,) = read(path, units={"displacement": "um"}, phases="sine_1hz", **options)
    np.testing.assert_array_equal(record.voltage, VOLTAGE)
    np.testing.assert_allclose(record.displacement, MICRONS * 1e-6, rtol=1e-12)
    assert record.sample_period == 5e-3
    for columns in (
        {},
        {"voltage": "run.m", "displacement": "run.m[2]"},
        {"voltage": "run.m[3]", "displacement": "run.m[2]"},
    ):
        with pytest.raises(PiezoError, match=r"m\.mat"):
            read(path, columns=columns, sample_period=5e-3)


@pytest.mark.parametrize("version", ["5", "7.3", "npz"])
@pytest.mark.parametrize("timed", [True, False])
def test_variables_of_other_software_are_understood_where_they_leave_no_doubt(tmp_path, version, timed):
    path = tmp_path / ("r.npz" if version == "npz" else "r.mat")
    variables = {"u_V": VOLTAGE, "pos_um": MICRONS} | ({"time": TIME} if timed else {"Fs": np.array(200.0)})
    if version == "npz":
        np.savez(path, **variables)
    elif version == "5":
        io.savemat(path, {"data": variables})
    else:
        with h5py.File(path, "w", userblock_size=512) as file:
            for name, values in variables.items():
                file[f"data/{name}"] = np.atleast_2d(values)
    (record,) = experiment = read(path, phases="sine_1hz")
    np.testing.assert_array_equal(record.voltage, VOLTAGE)
    np.testing.assert_allclose(record.displacement, MICRONS * 1e-6, rtol=1e-12)
    assert record.sample_period == pytest.approx(5e-3, rel=1e-12)
    assert "columns" in kinds(experiment)


def measured():
    for folder in (os.environ.get("PIEZO_DATA", ""), Path(__file__).parents[4] / "shared" / "data"):
        if folder and (path := Path(folder) / "picma-p885").is_dir():
            return path
    pytest.skip("no measured data: neither PIEZO_DATA nor ../shared/data holds picma-p885")


OPTIONS = {"columns": {"voltage": 1, "displacement": 5}, "units": {"displacement": "um"}, "sample_period": 5e-3}


def test_the_measured_record_is_a_sine_from_zero_volts():
    (record,) = experiment = read(measured() / "Model_Vi_Do.dat", initial_voltage=0.0, **OPTIONS)
    assert (record.phase, record.size, record.sample_period, record.initial_voltage) == ("sine_1hz", 8027, 5e-3, 0.0)
    assert np.ptp(record.voltage) == pytest.approx(3.6, abs=1e-3)
    assert np.ptp(record.displacement) == pytest.approx(45e-6, rel=0.2)
    assert not any(notice.severe for notice in experiment.notices)
    assert "not_at_rest" not in kinds(experiment)


def test_the_measured_record_taken_as_settled_contradicts_rest():
    assert "not_at_rest" in kinds(read(measured() / "Model_Vi_Do.dat", **OPTIONS))


ROWS = [(k / 100, round(5.0 - 5.0 * math.cos(k / 50), 4), round(7.0 - 7.0 * math.cos(k / 50), 4)) for k in range(900)]


@pytest.mark.parametrize(
    ("head", "row"),
    [
        ("Time,Drive,Position\nms,mV,nm\n", lambda t, u, y: f"{1e3 * t:.0f},{1e3 * u:.1f},{1e3 * y:.1f}"),
        ("timestamp,voltage (V),Weg [µm]\n", lambda t, u, y: f"2024-03-12 10:00:{t:06.3f},{u},{y}"),
        (
            "Date;Time;Position 1 [pm];DAC [V]\n",
            lambda t, u, y: f"2024-03-12;10:00:{t:06.3f};{1e6 * y:.0f};{u}",
        ),
        (
            '"t [ms]","Piezo (V)","Sensor (nm)","Target (nm)"\n',
            lambda t, u, y: f'"{1e3 * t:.0f}","{u}","{1e3 * y}","0"',
        ),
        (
            "LabVIEW Measurement\t\nSeparator\tTab\n***End_of_Header***\t\n\t\nSamples\t900\t900\t\n"
            "***End_of_Header***\t\t\t\t\nX_Value\tDrive_V\tPosition_um\tComment\n",
            lambda t, u, y: f"{t:.3f}\t{u}\t{y}\t",
        ),
    ],
    ids=["row of units", "dates", "times of day", "quoted", "LabVIEW"],
)
def test_files_as_instruments_write_them(head, row, tmp_path):
    path = tmp_path / "r.lvm"
    path.write_text(head + "".join(row(*values) + "\n" for values in ROWS), encoding="utf-8")
    (record,) = read(path, phases="record")
    assert record.sample_period == pytest.approx(0.01)
    assert record.start_time == pytest.approx(0.0, abs=1e-9)
    np.testing.assert_allclose(record.voltage, [u for _, u, _ in ROWS], atol=1e-9)
    np.testing.assert_allclose(record.displacement, [1e-6 * y for _, _, y in ROWS], atol=1e-14)


def test_the_stream_of_an_interferometer_is_named(tmp_path):
    path = tmp_path / "run.aws"
    path.write_bytes(b"\0\1\2" * 100)
    with pytest.raises(RecordingError, match="attocube"):
        read(path)


def test_a_part_at_a_longer_period_is_said_not_to_be_used(tmp_path):
    time = np.concatenate((np.arange(0.0, 4.0, 1e-3), np.arange(4.0, 10.0, 1e-2)))
    rows = np.column_stack((time, np.sin(9.0 * time), np.sin(9.0 * time)))
    np.savetxt(tmp_path / "t.csv", rows, delimiter=",", header="time_s,voltage_V,displacement_um", comments="")
    experiment = read(tmp_path / "t.csv", phases="x")
    assert [r.size for r in experiment] == [4001]
    (notice,) = (n for n in experiment.notices if n.kind == "time_base")
    assert notice.message.startswith("599 samples between 4 and 9.99 s are about 0.01 s apart, expected 0.001 s")
    assert notice.severe
    assert not any("missing" in n.message for n in experiment.notices)
    (slow,) = read(tmp_path / "t.csv", phases="x", rows=(4000, 4600))
    assert slow.sample_period == pytest.approx(1e-2)


def test_one_gap_is_one_place(tmp_path):
    lines = text(",", "time_s,voltage_V,displacement_um\n").splitlines()
    del lines[101:111]
    (tmp_path / "t.csv").write_text("\n".join(lines))
    messages = {n.kind: n.message for n in read(tmp_path / "t.csv", phases="x").notices}
    assert messages["gap"] == "10 samples are missing in 1 place"


@pytest.mark.parametrize(
    "title",
    [
        "sensor (V)",
        "Position [mV]",
        "displacement (s)",
        "displacement_V",
        "displacement_furlong",
        "Position [counts]",
        "sensor [%]",
    ],
)
def test_a_displacement_in_a_unit_that_is_no_length_is_not_read_as_metres(tmp_path, title):
    (tmp_path / "t.csv").write_text(text(",", f"time_s,voltage_V,{title}\n"))
    with pytest.raises(RecordingError, match=r"displacement: got the unit .* give the SI value of one"):
        read(tmp_path / "t.csv")
    with pytest.raises(RecordingError, match="give the SI value of one"):
        read(tmp_path / "t.csv", columns={"displacement": 3})
    (record,) = read(tmp_path / "t.csv", phases="x", units={"displacement": 2e-6})
    (metres,) = read(tmp_path / "t.csv", phases="x", units={"displacement": "m"})
    np.testing.assert_allclose(record.displacement, 2e-6 * metres.displacement)


@pytest.mark.parametrize("title", ["displacement_cm", "Displacement (cm)", "Position [cm]"])
def test_centimetres_are_a_length(tmp_path, title):
    (tmp_path / "t.csv").write_text(text(",", f"time_s,voltage_V,{title}\n"))
    (metres,) = read(tmp_path / "t.csv", phases="x", units={"displacement": "m"})
    (record,) = read(tmp_path / "t.csv", phases="x")
    np.testing.assert_allclose(record.displacement, 1e-2 * metres.displacement)


@pytest.mark.parametrize("title", ["Position [0]", "Position (front)", "displacement_x", "sensor"])
def test_a_number_or_a_remark_in_a_title_is_no_unit(tmp_path, title):
    (tmp_path / "t.csv").write_text(text(",", f"time_s,voltage_V,{title}\n"))
    (metres,) = read(tmp_path / "t.csv", phases="x", units={"displacement": "m"})
    (record,) = read(tmp_path / "t.csv", phases="x")
    np.testing.assert_array_equal(record.displacement, metres.displacement)
