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

"""Defects are found where they are, and good data are left alone."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import lfilter

from piezo_hysteresis.record import Experiment, Record
from piezo_hysteresis.recording import from_columns, inspect, read, write
from piezo_hysteresis.recording.checks.initial_condition_check import departures, is_within_its_loop
from piezo_hysteresis.recording.checks.lag import lag_of
from piezo_hysteresis.recording.table import text_cells
from piezo_hysteresis.stage.simulated import SimulatedStage

PERIOD = 1e-4


def stage(voltage, seed=0, noise=5e-9, lag=3e-4):
    """A play operator, a lag and noise: 1.5 µm/V with a loop of a tenth of the stroke."""
    v = np.asarray(voltage)
    play = np.empty_like(v)
    state = v[0]
    for i, x in enumerate(v):
        state = min(max(state, x - 0.4), x + 0.4)
        play[i] = state
    y = np.empty_like(v)
    x = 1.2e-6 * v[0] + 0.3e-6 * play[0]
    for i in range(v.size):
        x += (1 - np.exp(-PERIOD / lag)) * (1.2e-6 * v[i] + 0.3e-6 * play[i] - x)
        y[i] = x
    return y + noise * np.random.default_rng(seed).normal(size=v.size)


def sine(frequency=5.0, duration=1.0):
    return 3.5 + 2.5 * np.sin(2 * np.pi * frequency * np.arange(round(duration / PERIOD)) * PERIOD)


def clean():
    drives = {
        "rest": np.zeros(3000),
        "step": np.repeat([0.0, 5.0], 2000),
        "sine_5hz": sine(5.0),
        "sine_200hz": sine(200.0, 0.3),
        "noise": 3.5 + np.random.default_rng(1).normal(size=4000) * 0.1,
        "staircase": np.repeat([0.0, 2.0, 4.0, 6.0, 4.0, 2.0, 0.0], 1000),
    }
    records = []
    for seed, (phase, drive) in enumerate(drives.items()):
        # the drive starts at the voltage at which the stage had settled
        records.append(Record(drive, stage(drive, seed), PERIOD, phase, start_time=2.0 * seed))
    return Experiment(tuple(records))


def kinds(*records):
    return {n.kind for n in inspect(Experiment(records))}


def found(kind, *records):
    notices = [n for n in inspect(Experiment(records)) if n.kind == kind]
    assert notices, kind
    return notices


def test_good_data_are_left_alone():
    assert inspect(clean()) == ()


@pytest.mark.parametrize("seed", range(3))
def test_the_simulated_stage_gives_good_data(seed):
    plant = SimulatedStage(seed=seed)
    time = np.arange(20_000) * 2e-5
    records = [
        plant.play([0.0] * 2000, phase="rest"),
        plant.play([0.0] * 500 + [3.0] * 3000 + [0.0] * 3000, phase="step"),
        plant.play(3.0 - 3.0 * np.cos(2 * np.pi * 50 * time), phase="sine_50hz"),
    ]
    assert not [n for n in inspect(Experiment(tuple(records))) if n.severe or n.kind == "not_at_rest"]


@pytest.mark.parametrize("factor", [1e3, 1e6, 1e9, 1e-6, 1e-9])
def test_a_displacement_in_another_unit_is_reported_with_the_power_of_ten(factor):
    wrong = [Record(r.voltage, r.displacement * factor, PERIOD, r.phase) for r in clean()]
    (notice,) = found("units", *wrong)
    assert notice.severe and "1e" in notice.message


def test_a_voltage_in_another_unit_is_reported():
    wrong = [Record(r.voltage * 1e3, r.displacement, PERIOD, r.phase) for r in clean()]
    assert found("units", *wrong)[0].severe
    wrong = [Record(r.voltage * 1e-6, r.displacement, PERIOD, r.phase) for r in clean()]
    assert found("units", *wrong)[0].severe


@pytest.mark.parametrize("power", [-6, -3, 3, 6])
def test_one_phase_in_another_unit_is_compared_with_the_others(power):
    records = list(clean().records)
    records[2] = Record(records[2].voltage, records[2].displacement * 10.0**power, PERIOD, "sine_5hz", 4.0)
    notices = found("scale", *records)
    assert [n.phase for n in notices] == ["sine_5hz"]
    assert f"1e{power:+d}" in notices[0].message
    assert notices[0].severe


@pytest.mark.parametrize(("channel", "severe"), [("voltage", True), ("displacement", True)])
def test_a_channel_that_never_changes_is_reported(channel, severe):
    drive = sine()
    still = Record(
        np.zeros(drive.size) if channel == "voltage" else drive,
        np.zeros(drive.size) if channel == "displacement" else stage(drive),
        PERIOD,
    )
    assert [n.severe for n in found("constant", still)] == [severe]


@pytest.mark.parametrize("share", [0.1, 0.2])
@pytest.mark.parametrize("top", [True, False])
def test_a_displacement_at_its_rail_is_clipped(share, top):
    drive = sine()
    y = stage(drive)
    rail = np.quantile(y, 1 - share if top else share)
    cut = np.minimum(y, rail) if top else np.maximum(y, rail)
    (notice,) = found("clipped", Record(drive, cut, PERIOD, "sine_5hz"))
    reported = int(notice.message.split(" samples")[0].split()[-1])
    assert reported == pytest.approx(np.count_nonzero(cut == rail), rel=0.01)
    assert notice.severe


@pytest.mark.parametrize(("cut", "severe"), [(0.015, False), (0.1, True)])
def test_a_cut_off_tenth_of_the_stroke_spoils_a_phase_of_which_it_is_little(cut, severe):
    """Growing sines reach the rail only at the end, in a fiftieth of their samples."""
    drive = sine() * np.linspace(0.05, 1.0, sine().size)
    y = stage(drive)
    rail = y.max() - cut * np.ptp(y)
    (notice,) = found("clipped", Record(drive, np.minimum(y, rail), PERIOD, "sine_5hz"))
    assert np.count_nonzero(y > rail) < 0.05 * y.size
    assert notice.severe is severe


def test_a_voltage_that_its_recorder_cuts_off_is_clipped():
    drive = sine()
    record = Record(np.minimum(drive, 5.5), stage(drive), PERIOD, "sine_5hz")
    assert "clipped" in kinds(record)


def test_a_saturated_drive_is_not_a_defect():
    drive = np.minimum(sine(), 5.5)
    assert "clipped" not in kinds(Record(drive, stage(drive), PERIOD, "x"))


@pytest.mark.parametrize("damping", [0.005, 0.02, 0.1])
@pytest.mark.parametrize("rise", [1e-4, 0.002, 0.01])
@pytest.mark.parametrize("resonance", [15.0, 25.0, 47.0, 180.0])
def test_a_stage_that_rings_on_the_flat_tops_of_a_trapezoid_is_not_clipped(damping, rise, resonance):
    t = np.arange(10_000) * 1e-4
    phase = t * 10.0 % 1.0
    drive = 9.0 * np.clip(np.minimum(phase, 1.0 - phase) / (10.0 * rise), 0.0, 1.0)
    pole = np.exp(2 * np.pi * resonance * 1e-4 * (-damping + 1j * np.sqrt(1 - damping**2)))
    mode = np.real(np.poly([pole, np.conj(pole)]))
    y = 2e-6 * lfilter([mode.sum()], mode, drive)
    assert "clipped" not in kinds(Record(drive, y, 1e-4, "steps"))


def test_a_stage_with_backlash_is_not_clipped():
    drive = sine()
    assert "clipped" not in kinds(Record(drive, stage(drive, noise=0.0, lag=1e-9) - 1.2e-6 * drive, PERIOD, "x"))


@pytest.mark.parametrize("delay", [1, 10, 60])
def test_a_stage_that_rests_until_a_step_arrives_is_not_stuck(delay):
    drive = np.repeat([0.0, 5.0, 2.0], 500)
    y = 1e-6 * np.repeat(drive[::500], 500)
    y = np.concatenate([y[:1].repeat(delay), y[:-delay]])
    assert not {"stuck", "clipped"} & kinds(Record(drive, y, PERIOD, "step"))


def test_a_sensor_that_hangs_is_stuck():
    drive = sine()
    y = stage(drive)
    y[4100:4400] = y[4100]
    assert "stuck" in kinds(Record(drive, y, PERIOD, "sine_5hz"))


def test_a_ring_down_contains_no_drop_outs():
    y = 1.665e-5 + 5e-9 * np.random.default_rng(1).normal(size=600)
    y[:4] = 1.7256e-5, 1.6750e-5, 1.6473e-5, 1.6803e-5
    assert "dropout" not in kinds(Record(3.5 + 1e-3 * np.arange(600), y, 1e-3, "hold"))
    time = 1e-4 * np.arange(4000)
    y = 1e-5 * (1.0 - np.exp(-100.0 * time) * np.cos(2.0 * np.pi * 1000.0 * time))
    assert "dropout" not in kinds(Record(5.0 + time, y, 1e-4, "x", initial_voltage=0.0))
    time = 1e-4 * np.arange(20000)
    for cycles in (0.3, 0.35, 0.4, 0.45):  # per sample: a step may be small between two large ones
        y = 1e-5 * (1.0 - np.exp(-500.0 * time) * np.cos(2.0 * np.pi * cycles * np.arange(time.size)))
        assert "dropout" not in kinds(Record(5.0 + time, y, 1e-4, "x", initial_voltage=0.0)), cycles


@pytest.mark.parametrize("length", [1, 7, 40])
def test_drop_outs_are_counted(length):
    drive = sine()
    y = stage(drive)
    for start in (1200, 5300, 8100):
        y[start : start + length] = -1e-6
    (notice,) = found("dropout", Record(drive, y, PERIOD, "sine_5hz"))
    assert "3 times" in notice.message
    assert f"{3 * length} samples" in notice.message


@pytest.mark.parametrize(("bits", "reported", "severe"), [(16, False, False), (8, True, False), (5, True, True)])
def test_coarse_quantisation_is_reported_with_its_step(bits, reported, severe):
    drive = sine()
    y = stage(drive)
    step = np.ptp(y) / 2**bits
    notices = [
        n
        for n in inspect(Experiment((Record(drive, np.round(y / step) * step, PERIOD, "x"),)))
        if n.kind == "quantisation"
    ]
    assert bool(notices) == reported
    assert any(n.severe for n in notices) == severe
    assert all(f"{step:.3g}" in n.message for n in notices)


def test_columns_shifted_against_each_other_are_reported():
    drive = sine()
    y = stage(drive)
    assert "leads" not in kinds(Record(drive, y, PERIOD, "sine_5hz"))
    early = Record(drive[:-300], y[300:], PERIOD, "sine_5hz")
    assert found("leads", early)[0].severe


def test_a_stage_that_moves_against_its_drive_is_reported():
    drive = sine()
    assert kinds(Record(drive, -stage(drive), PERIOD, "sine_5hz")) == {"polarity"}


@pytest.mark.parametrize(("title", "unit"), [("displacement_um", None), ("displacement", "um"), ("displacement", 1e-6)])
def test_the_notice_of_a_reversed_sensor_names_the_option_that_turns_it(title, unit):
    drive = sine()
    columns = {"time_s": PERIOD * np.arange(drive.size), "voltage_V": drive, title: -1e6 * stage(drive)}
    units = {} if unit is None else {"displacement": unit}
    (notice,) = (n for n in from_columns(columns, units=units).notices if n.kind == "polarity")
    assert "if the sensor is reversed, give `units` displacement=-" in notice.message
    turned = notice.message.split("displacement=")[1]
    assert turned == {None: "-", "um": "-um", 1e-6: "-1e-06"}[unit]
    read = from_columns(columns, units={"displacement": turned})
    assert "polarity" not in {n.kind for n in read.notices}
    assert read[0].displacement == pytest.approx(stage(drive))


@pytest.mark.parametrize("periods", [1, 3])
def test_a_stage_that_moves_against_a_few_loops_is_reported(periods):
    drive = 5.0 - 4.0 * np.cos(np.linspace(0.0, 2.0 * np.pi * periods, 4000))
    assert "polarity" in kinds(Record(drive, 5e-5 - stage(drive), PERIOD, "sine"))
    assert "polarity" not in kinds(Record(drive, stage(drive), PERIOD, "sine"))


def test_a_wrong_sample_period_shows_in_the_name_of_a_sine():
    drive = sine()
    (notice,) = found("sample_period", Record(drive, stage(drive), 10 * PERIOD, "sine_5hz"))
    assert "0.5 Hz" in notice.message


def test_phases_that_overlap_in_time_are_reported():
    drive = sine()
    record = Record(drive, stage(drive), PERIOD, "sine_5hz")
    later = Record(drive, stage(drive), PERIOD, "sine_5hz", start_time=0.4)
    assert "time_base" in kinds(record, later)


def test_a_start_that_is_not_settled_contradicts_rest():
    drive = np.repeat([0.0, 4.0], [2000, 8000]) + np.concatenate((np.zeros(4000), 0.5 * np.sin(np.arange(6000) * 0.01)))
    y = stage(drive, lag=5e-3)
    settled = Record(drive[1000:], y[1000:], PERIOD, "x")
    late = Record(drive[2000:], y[2000:], PERIOD, "x")
    assert "not_at_rest" not in kinds(settled)
    assert "not_at_rest" in kinds(late)
    assert "not_at_rest" not in kinds(Record(late.voltage, late.displacement, PERIOD, "x", initial_voltage=0.0))
    assert "not_at_rest" not in kinds(Record(late.voltage, late.displacement, PERIOD, "x", truncated=True))


@pytest.mark.parametrize("frequency", [10.0, 50.0, 100.0, 200.0, 400.0])
def test_a_fast_sine_begins_within_its_loop_only_where_it_was_running_before(frequency):
    time = 2e-5 * np.arange(int(12 / frequency / 2e-5))
    settled = SimulatedStage(seed=1).play(5.0 + 2.0 * np.sin(2 * np.pi * frequency * time), phase="sine")
    assert not is_within_its_loop(settled)
    cut = round(5.0 / frequency / 2e-5)
    late = Record(settled.voltage[cut:], settled.displacement[cut:], settled.sample_period, "sine")
    assert is_within_its_loop(late)


@given(
    level=st.sampled_from([0.0, -20.0, 7.5]),
    slope=st.floats(0.01, 3.0) | st.floats(-3.0, -0.01),
    factor=st.integers(1, 100),
)
def test_a_ramp_from_rest_is_recognised_from_its_first_samples(level, slope, factor):
    ramp = level + slope * np.arange(1, 401)
    slow = replace(Record(ramp, np.zeros(ramp.size), PERIOD).decimate(factor), initial_voltage=None)
    resting = Record(np.full(20, level), np.zeros(20), PERIOD, "rest")
    assert departures(Experiment((resting, slow))) == {1: level}
    for known in (replace(slow, continues=True), replace(slow, truncated=True), replace(slow, initial_voltage=1.0)):
        assert departures(Experiment((resting, known))) == {}
    elsewhere = replace(slow, voltage=slow.voltage + 5.0 * slope * factor)
    assert departures(Experiment((resting, elsewhere))) != {1: level}


def test_a_slow_ramp_from_rest_is_followed_from_its_first_sample(tmp_path):
    plant = SimulatedStage(seed=1)
    ramp = np.append(np.linspace(0.0, 5.0, 2000), np.full(8000, 5.0))
    slow = replace(plant.play(ramp, phase="staircase").decimate(500), initial_voltage=None)
    write(Experiment((plant.play(np.zeros(2000), phase="rest"), slow)), tmp_path / "run")
    experiment = read(tmp_path / "run")
    assert experiment.named("staircase")[0].settled_voltage == 0.0
    (reported,) = [n for n in experiment.notices if n.kind == "in_motion"]
    assert "staircase" in reported.message and "0 V" in reported.message


def test_records_that_begin_alike_at_different_displacements_are_reported():
    drive = sine()
    y = stage(drive)
    first, again = (Record(drive, y + zero, PERIOD, "x") for zero in (0.0, 0.02 * np.ptp(y)))
    assert "origins_differ" in kinds(first, again)
    assert "origins_differ" not in kinds(first, first)
    assert "origins_differ" not in kinds(first, replace(again, continues=True))
    elsewhere = Record(drive[400:], y[400:], PERIOD, "x")
    assert "origins_differ" not in kinds(first, elsewhere)


@pytest.mark.parametrize("kind", ["sine", "triangle"])
@pytest.mark.parametrize("shift", [0, 40, 120])
def test_a_late_channel_is_found_by_where_the_displacement_turns(kind, shift):
    drive = sine(5.0) if kind == "sine" else 7.0 * np.abs(np.mod(5.0 * PERIOD * np.arange(10_000) + 0.5, 1.0) * 2 - 1)
    y = stage(drive, lag=1e-9)
    record = Record(drive[shift:], y[: y.size - shift], PERIOD, f"{kind}_5hz")
    lag = lag_of(record)
    assert lag.time == pytest.approx((shift + 1) * PERIOD, abs=0.005 * lag.swing)
    assert ("late" in kinds(record)) == (shift * PERIOD > 3e-3)


def test_the_lag_of_a_stage_is_not_a_delayed_channel():
    for frequency in (1.0, 5.0, 50.0):
        drive = sine(frequency, 4 / frequency)
        assert not {"late", "leads"} & kinds(Record(drive, stage(drive), PERIOD, f"sine_{frequency:g}hz"))


def test_a_displacement_per_volt_that_no_stage_has_is_reported():
    drive = sine()
    y = stage(drive, noise=5e-10)
    assert "units" in kinds(Record(drive * 1e-3, y, PERIOD, "x")), "kilovolts taken for volts"
    assert "units" in kinds(Record(drive, y * 1e-3, PERIOD, "x")), "nanometres written as micrometres"


@pytest.mark.parametrize("start", [200, 900, 1150])
def test_a_record_that_begins_on_a_branch_of_its_loop_does_not_claim_rest(tmp_path, start):
    drive = sine()
    y = stage(drive)
    (settled, within) = (Record(drive[a:], y[a:], PERIOD, "sine_5hz") for a in (0, 2000 + start))
    for name, record in (("settled", settled), ("within", within)):
        write(Experiment((record,)), tmp_path / name)
    assert not read(tmp_path / "settled")[0].truncated
    experiment = read(tmp_path / "within")
    assert experiment[0].truncated
    assert any(n.kind == "truncated" for n in experiment.notices)
    assert not read(tmp_path / "within", initial_voltage=3.5)[0].truncated


def ringing(size=6000, hold=2000):
    """A step from 0 to 5 V with the first sample, a hold, a sine; a stage that follows late and rings."""
    time = 1e-4 * np.arange(size)
    drive = 5.0 + np.where(np.arange(size) < hold, 0.0, 4.0 * np.sin(2.0 * np.pi * 10.0 * (time - time[hold])))
    y = 3e-6 * drive - 1.5e-5 * np.exp(-50.0 * time) * np.cos(2.0 * np.pi * 600.0 * time)
    return drive, y + 2e-9 * np.random.default_rng(2).normal(size=size)


def test_a_step_before_the_first_sample_is_found_and_named(tmp_path):
    drive, y = ringing()
    path = tmp_path / "lab.csv"
    table = np.c_[1e-4 * np.arange(drive.size), drive, 1e6 * y]
    np.savetxt(path, table, delimiter=",", header="time_s,voltage_V,displacement_um", comments="")
    inferred, stated = read(path), read(path, initial_voltage=0.0)
    for experiment in (inferred, stated):
        assert [r.phase for r in experiment] == ["step", "sine_10hz"]
        assert experiment[0].settled_voltage == 0.0
    assert [n.kind for n in inferred.notices].count("step_before") == 1
    assert not any(n.kind == "step_before" for n in stated.notices)


def test_a_jump_from_an_unknown_level_is_reported():
    drive, y = ringing()
    assert "not_at_rest" in kinds(Record(drive, y, 1e-4, "x"))
    assert "not_at_rest" not in kinds(Record(drive[2000:], y[2000:], 1e-4, "x"))


def test_rows_before_the_selected_ones_determine_the_state(tmp_path):
    drive, y = ringing()
    path = tmp_path / "lab.csv"
    table = np.c_[1e-4 * np.arange(drive.size), drive, 1e6 * y]
    np.savetxt(path, table, delimiter=",", header="time_s,voltage_V,displacement_um", comments="")
    np.savetxt(tmp_path / "bare.csv", table[:, 1:], delimiter=",", header="voltage_V,displacement_um", comments="")
    for file, period in ((path, None), (tmp_path / "bare.csv", 1e-4)):
        lead, wanted = read(file, rows=(3000, 5000), rows_before=1 << 20, sample_period=period)
        assert (lead.phase, lead.size, lead.settled_voltage) == ("conditioning", 3000, 0.0)
        assert wanted.continues and not wanted.truncated and wanted.size == 2000
        assert wanted.start_time == pytest.approx(0.3)
        capped, _ = read(file, rows=(3000, 5000), rows_before=100, sample_period=period)
        assert capped.size == 100 and capped.truncated
        assert len(read(file, rows=(3000, 5000), sample_period=period)) == 1
        before = float(drive[2999])
        settled = read(file, rows=(3000, 5000), rows_before=1 << 20, initial_voltage=before, sample_period=period)
        assert len(settled) == 1 and settled[0].settled_voltage == pytest.approx(before)


@pytest.mark.parametrize("format", ["csv", "gcs_array"])
def test_rows_before_are_read_in_the_same_pass(tmp_path, monkeypatch, format):
    drive, y = ringing()
    head = "# DIM = 2\n# SAMPLE_TIME = 1e-4\n# NAME0 = Volt\n# NAME1 = Position\n# END_HEADER\n"
    head = head if format == "gcs_array" else "voltage_V displacement_um\n"
    np.savetxt(tmp_path / "lab.txt", np.c_[drive, 1e6 * y], header=head[:-1], comments="")
    passes = []
    monkeypatch.setattr(text_cells, "BLOCK_BYTES", 1 << 12)  # several blocks, some of them in both parts
    lines = text_cells._line_blocks
    monkeypatch.setattr(text_cells, "_line_blocks", lambda *given: passes.append(given) or lines(*given))
    lead, wanted = read(tmp_path / "lab.txt", format=format, rows=(3000, 5000), rows_before=100, sample_period=1e-4)
    assert len(passes) == 1
    np.testing.assert_allclose(lead.voltage, drive[2900:3000])
    np.testing.assert_allclose(wanted.voltage, drive[3000:5000])


def test_an_initial_voltage_belongs_to_the_first_row_of_the_file(tmp_path):
    """It was taken for that of the first chosen row, and the model began with a step that never was."""
    time = 1e-3 * np.arange(4000)
    table = np.c_[time, 5.0 + 4.0 * np.sin(6.28 * time), time]
    np.savetxt(tmp_path / "lab.csv", table, delimiter=",", header="time_s,voltage_V,displacement_um", comments="")
    found = read(tmp_path / "lab.csv", rows=(2100, 4000), rows_before=1 << 20, initial_voltage=0.0)
    lead, wanted = found
    assert (lead.size, lead.settled_voltage) == (2100, 0.0)
    assert wanted.continues and wanted.initial_voltage is None
    assert any("initial voltage of 0 V is that of the first row" in n.message for n in found.notices)


def test_two_periods_do_not_contradict_a_rounded_name():
    """Two periods of 16.7 Hz that fade in and out were said to be of 19 Hz, and `piezo diagnose` gave no verdict."""
    time = PERIOD * np.arange(1200)
    drive = 3.0 * np.sin(2.0 * np.pi * 16.67 * time) * np.minimum(1.0, np.minimum(time, time[::-1]) / 0.05)
    right = Record(drive, stage(drive), PERIOD, "sine_17hz")
    assert not any(n.severe for n in inspect(Experiment((right,))))
    many = sine(17.0, 2.0)
    (notice,) = found("sample_period", Record(many, stage(many), 1.5 * PERIOD, "sine_17hz"))
    assert notice.severe
