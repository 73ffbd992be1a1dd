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

"""The GCS 2.0 back end keeps the promises of the stage protocol over a real socket."""

import math

import numpy as np
import pytest

from piezo_hysteresis.errors import StageError
from piezo_hysteresis.stage.gcs2.setup import Gcs2Setup
from piezo_hysteresis.stage.gcs2.stage import Gcs2Stage
from piezo_hysteresis.stage.simulated import SimulatedStage
from piezo_hysteresis.stage.stage import MemoryStage, Stage

SERVO_TIME = 50e-6
WAVE = 3.0 - 3.0 * np.cos(2 * np.pi * np.arange(1200) / 400)


def test_it_is_a_memory_stage_described_by_the_device(bench):
    stage = bench().stage
    promised = {name for part in (Stage, MemoryStage) for name in vars(part) if not name.startswith("_")}
    assert promised <= set(dir(stage))
    described = stage.description
    assert not described.streaming
    assert described.measured_voltage
    assert (described.voltage_min, described.voltage_max) == (0.0, 10.0)
    assert described.sample_period_min == described.sample_period_step == stage.sample_period == SERVO_TIME
    assert described.longest_block == 262144 // 8
    assert "E-727.EMULATED" in described.name and "axis 1" in described.name


def test_opening_moves_nothing(bench):
    b = bench(opened=False)
    observer = b.observer()
    observer.command("SVA 1 60")
    b.controller.heard.clear()
    b.stage = Gcs2Stage(b.setup())
    assert b.stage.voltage == pytest.approx(3.0, abs=2e-4)
    asked = {line.split()[0] for line in b.controller.heard if not line.endswith("?")}
    assert all(word.endswith("?") for word in asked), asked
    observer.connection.close()


def test_a_waveform_gives_the_result_of_the_simulated_stage(bench, play, ideal):
    got = play(bench(plant=ideal()).stage, WAVE)
    expected = SimulatedStage(ideal(), sample_period=SERVO_TIME).play(WAVE, initial_voltage=0.0)
    np.testing.assert_allclose(got.displacement, expected.displacement, rtol=1e-7, atol=1e-13)
    np.testing.assert_allclose(got.voltage, WAVE, atol=1e-7)


def test_a_multiple_of_the_servo_time_repeats_points_and_keeps_one_sample_each(bench, play, ideal):
    stage = bench(plant=ideal()).stage
    stage.configure(3 * SERVO_TIME)
    assert stage.sample_period == pytest.approx(150e-6)
    got = play(stage, WAVE)
    expected = SimulatedStage(ideal(), sample_period=SERVO_TIME).play(np.repeat(WAVE, 3), initial_voltage=0.0)
    np.testing.assert_allclose(got.displacement, expected.displacement[::3], rtol=1e-7, atol=1e-13)
    with pytest.raises(StageError, match="whole multiple"):
        stage.configure(70e-6)


def test_blocks_follow_each_other_from_the_voltage_in_force(bench, play):
    stage = bench().stage
    first = play(stage, np.linspace(0.0, 5.0, 300))
    assert stage.voltage == 5.0
    second = play(stage, np.full(100, 5.0))
    assert second.voltage[0] == pytest.approx(first.voltage[-1])
    assert stage.read() is second, "read again"


@pytest.mark.parametrize("size", [1, 9, 10, 11, 4097])
def test_chunks_of_any_size_transfer_every_point(bench, play, size):
    drive = 2.0 + np.sin(0.1 * np.arange(size))
    got = play(bench(points_per_command=10, rows_per_answer=1000).stage, drive)
    np.testing.assert_allclose(got.voltage, drive, atol=2e-4)


def test_slow_path_sets_and_reads_with_the_servo_off(bench, ideal):
    b = bench(plant=ideal())
    observer = b.observer()
    observer.command("SVO 1 1")
    b.stage.set_voltage(4.0)
    assert observer.whole("SVO? 1") == 0
    assert b.voltage == pytest.approx(4.0)
    for _ in range(300):
        reading = b.stage.read_displacement()
    assert reading == pytest.approx(SimulatedStage(ideal()).parameters.stroke(0.0, 4.0), rel=1e-5)
    heard = [line for line in b.controller.heard if line[:3] in ("SVO", "SVA")]
    assert heard[-3:] == ["SVO 1 0", "SVO? 1", "SVA 1 80"] or heard[-4:-1] == ["SVO 1 0", "SVO? 1", "SVA 1 80"]
    observer.connection.close()


def test_a_drive_outside_a_limit_is_not_sent(bench):
    b = bench()
    b.controller.heard.clear()
    for drive in ([10.1], [-0.1], [math.nan], []):
        with pytest.raises(StageError, match="expected"):
            b.stage.upload(np.array(drive))
    with pytest.raises(StageError, match="expected"):
        b.stage.set_voltage(11.0)
    assert b.controller.heard == []


def test_a_wave_table_is_not_overwritten_while_a_generator_that_was_left_running_plays_it(bench):
    """A controller that reads the table while it plays would go to the end of its range in one step."""
    b = bench(speed=1.0, opened=False)
    observer = b.observer()
    for line in ("WAV 1 X LIN 30000 100 0 30000 0 0", "WSL 1 1", "WGC 1 1", "WTR 1 1 0", "WGO 1 1"):
        observer.command(line)
    b.stage = Gcs2Stage(b.setup())
    carry_out, in_play = b.controller.carry_out, []

    def watched(line):
        if line.startswith(("WAV", "WCL")) and not line.startswith("WAV?"):
            in_play.append(b.controller._motion.is_playing)
        return carry_out(line)

    b.controller.carry_out = watched
    b.stage.restrict(b.stage.description, 1000.0)
    assert in_play == [False]
    assert 0.0 < b.stage.voltage < 5.0
    assert b.stage.voltage == pytest.approx(b.voltage, abs=1e-3), "it stays where it is"
    b.stage.safe()
    assert b.voltage == pytest.approx(0.0, abs=1e-6)
    observer.connection.close()


@pytest.mark.parametrize("use", ["arm", "set_voltage"])
def test_a_voltage_that_another_program_has_set_is_not_stepped_back(bench, use):
    b = bench(max_slew_rate=1e5)
    b.stage.restrict(b.stage.description, 1000.0)
    b.stage.upload(np.zeros(100))
    observer = b.observer()
    observer.command("SVA 1 60")
    b.controller.heard.clear()
    with pytest.raises(
        StageError, match=r"measured a drive of \S+ V, expected 0 V.*another program.*safe voltage, 0 V"
    ):
        b.stage.arm() if use == "arm" else b.stage.set_voltage(1.0)
    assert b.voltage == pytest.approx(0.0, abs=1e-6)
    first = next(line for line in b.controller.heard if line.startswith("WAV 1"))
    one_step = 1000.0 * SERVO_TIME * 20.0  # of the amplifier
    assert float(first.split()[6]) == pytest.approx(60.0, abs=1.01 * one_step), "it begins where the stage was"
    observer.connection.close()


def test_a_controller_that_plays_single_points_only_is_refused(bench):
    """Every point was a step to the goal."""
    with pytest.raises(StageError, match="1 wave points, expected two of each"):
        Gcs2Stage(bench(opened=False).setup(longest_wave=1))


def test_a_safe_voltage_outside_the_limits_is_refused(bench):
    with pytest.raises(StageError, match="safe_voltage"):
        Gcs2Stage(bench(opened=False).setup(safe_voltage=-300.0))


def test_out_of_order_is_refused(bench):
    stage = bench().stage
    for early in (stage.arm, stage.start, stage.read, lambda: stage.wait(0.0)):
        with pytest.raises(StageError, match="expected"):
            early()
    stage.upload(WAVE)
    with pytest.raises(StageError, match="arm"):
        stage.start()
    stage.arm()
    stage.configure(SERVO_TIME)
    with pytest.raises(StageError, match="arm"):
        stage.start()


def test_safe_stops_a_waveform_where_it_is(bench):
    b = bench(speed=1.0)
    b.stage.upload(np.linspace(0.0, 8.0, 30000))
    b.stage.arm()
    b.stage.start()
    with pytest.raises(StageError, match="still playing"):
        b.stage.wait(0.02)
    for busy in (b.stage.read, b.stage.start, b.stage.read_displacement, lambda: b.stage.set_voltage(1.0)):
        with pytest.raises(StageError, match="still playing"):
            busy()
    b.stage.safe()
    assert b.voltage == b.stage.voltage == 0.0
    with pytest.raises(StageError, match="nothing recorded"):
        b.stage.read()


def test_a_closed_stage_is_safe_and_refuses_work(bench):
    b = bench()
    b.stage.set_voltage(4.0)
    b.stage.close()
    b.stage.close()
    b.stage.safe()
    assert b.voltage == 0.0
    for work in (b.stage.read_displacement, lambda: b.stage.set_voltage(1.0), lambda: b.stage.configure(SERVO_TIME)):
        with pytest.raises(StageError, match="closed"):
            work()


def test_open_loop_commands_in_other_units(bench, play):
    b = bench(controller={"command_per_volt": 0.4}, command_per_volt=0.4)
    np.testing.assert_allclose(play(b.stage, WAVE).voltage, WAVE, atol=2e-4)
    b.stage.set_voltage(5.0)
    assert b.controller.heard.count("SVA 1 40") == 1


def test_wrong_units_are_seen_at_the_first_move(bench):
    b = bench(controller={"command_per_volt": 0.5}, settling_time=0.0)
    with pytest.raises(
        StageError, match=r"measured a drive of 3.9999\S* V, expected 2 V.*command_per_volt.*safe voltage"
    ):
        b.stage.set_voltage(2.0)
    assert b.voltage == 0.0


def test_an_error_of_an_earlier_user_is_ignored(bench):
    b = bench(opened=False)
    client = b.observer()
    client.connection.send("MOV 1 3\n*IDN?\n")
    client.connection.receive()  # once this is answered, the command before it has been refused
    client.connection.close()
    b.stage = Gcs2Stage(b.setup())
    b.stage.set_voltage(1.0)


def test_a_controller_without_a_required_command_is_refused_by_name(bench):
    b = bench(opened=False)
    for word in ("WGO", "DRR?"):
        del b.controller._commands[word]
    with pytest.raises(StageError, match=r"does not know DRR\? WGO"):
        Gcs2Stage(b.setup())
    with pytest.raises(StageError, match="has the axes 1, expected 'X'"):
        Gcs2Stage(bench(opened=False).setup(axis="X"))


@pytest.mark.parametrize(
    "wrong",
    [
        {"host": ""},
        {"port": 0},
        {"amplifier_gain": 0.0},
        {"points_per_command": 0},
        {"voltage_table": 2},
        {"max_slew_rate": 0.0},
        {"max_slew_rate": math.inf},
    ],
)
def test_a_setup_that_cannot_be_is_refused(wrong):
    with pytest.raises(StageError, match="expected"):
        Gcs2Setup(**{"host": "nowhere", "max_slew_rate": 1e9, **wrong})
