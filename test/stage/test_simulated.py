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

"""Both kinds of simulated stage keep the promises of the stage protocol."""

import math
from argparse import ArgumentParser
from dataclasses import replace

import numpy as np
import pytest

from piezo_hysteresis.cli.options.plant_option import add_plant_arguments, plant
from piezo_hysteresis.errors import StageError
from piezo_hysteresis.stage.opening import Opening
from piezo_hysteresis.stage.plant import Plant, PlantParameters
from piezo_hysteresis.stage.simulated import BACK_END, SimulatedMemoryStage, SimulatedStage
from piezo_hysteresis.stage.stage import MemoryStage, Stage, StreamingStage

TS = 20e-6
KINDS = pytest.mark.parametrize("kind", [SimulatedStage, SimulatedMemoryStage])


def promised(protocol):
    return {name for part in (Stage, protocol) for name in vars(part) if not name.startswith("_")}


def play_from_memory(stage, voltage):
    stage.upload(voltage)
    stage.arm()
    stage.start()
    stage.wait(1.0)
    return stage.read()


@pytest.mark.parametrize(("kind", "protocol"), [(SimulatedStage, StreamingStage), (SimulatedMemoryStage, MemoryStage)])
def test_each_kind_of_stage_declares_its_protocol(kind, protocol):
    stage = kind()
    assert promised(protocol) <= set(dir(stage))
    assert stage.description.streaming is (protocol is StreamingStage)
    assert stage.sample_period == TS


def test_a_driver_hides_the_same_effect_as_piezo(tmp_path):
    """For every effect of the catalogue, also on a stage with another range."""
    plant_file = tmp_path / "plant.yaml"
    plant_file.write_text("electronics.voltage_max: 7.0\n")
    parser = ArgumentParser()
    add_plant_arguments(parser)
    values = {row.name: row.value for row in BACK_END.rows} | {"plant_file": str(plant_file)}
    for seed in range(60):
        simulated, _ = plant(parser.parse_args(["--plant", str(plant_file), "--hidden", str(seed)]))
        driven = BACK_END.open(values | {"hidden_effect": seed}, Opening())
        assert driven.parameters == simulated, seed


def test_streaming_is_the_plant_sample_by_sample():
    stage, drive = SimulatedStage(seed=3), 5 + np.sin(0.01 * np.arange(900))
    got = [stage.exchange(block) for block in np.split(drive, [1, 300, 301])]
    expected = Plant(PlantParameters(), TS, seed=3).run(drive)
    np.testing.assert_array_equal(np.concatenate([g.displacement for g in got]), expected.displacement)
    np.testing.assert_array_equal(np.concatenate([g.voltage for g in got]), expected.voltage)
    assert stage.time == pytest.approx(900 * TS)


@pytest.mark.parametrize("steps", [1, 2, 7])
def test_the_slew_counts_from_the_command_and_not_from_the_converter(steps):
    """The converter rounds each voltage; the last one of a block made the next block too steep by half of a step."""
    stage = SimulatedStage()
    limits = replace(stage.description, max_slew_rate=2000.0)
    stage.restrict(limits, 50.0)
    drive = 2000.0 * TS * np.arange(1.0, 100.0)
    got = [stage.exchange(block) for block in np.split(drive, np.arange(steps, drive.size, steps))]
    assert np.max(np.abs(np.concatenate([g.voltage for g in got]) - drive)) < 2e-4
    with pytest.raises(StageError, match="steps by"):
        stage.exchange(drive[-1:] + 0.0401)


def test_memory_plays_the_uploaded_waveform_after_a_dead_time():
    stage, drive = SimulatedMemoryStage(seed=3, dead_time=0.01), 5 + np.sin(0.01 * np.arange(900))
    got = play_from_memory(stage, drive)
    lived = np.r_[np.zeros(500), drive]
    expected = Plant(PlantParameters(), TS, seed=3).run(lived)
    np.testing.assert_array_equal(got.displacement, expected.displacement[500:])
    assert stage.voltage == drive[-1]
    assert stage.read_voltage() == got.voltage[-1]
    again = play_from_memory(stage, drive)
    assert again.displacement[0] == pytest.approx(got.displacement[-1], abs=0.3e-6)
    assert stage.time == pytest.approx(0.01 + 0.018 + 0.01 + 0.018)


def test_the_plant_creeps_on_while_the_memory_is_loaded(ideal):
    """A step, then a second waveform at the same level: the longer the dead time the higher its start."""
    starts = []
    for dead_time in (0.01, 0.1, 1.0):
        stage = SimulatedMemoryStage(ideal(creep__gamma=0.02), sample_period=1e-4, dead_time=dead_time)
        stage.set_voltage(5.0)
        starts.append(play_from_memory(stage, np.full(10, 5.0)).displacement[0])
    np.testing.assert_allclose(np.diff(starts) / starts[1], 0.02, atol=1e-3)


def test_memory_refuses_commands_in_the_wrong_order():
    stage = SimulatedMemoryStage(longest_block=100)
    for out_of_order in (stage.arm, stage.start, stage.read, lambda: stage.wait(0.0)):
        with pytest.raises(StageError, match="expected"):
            out_of_order()
    with pytest.raises(StageError, match="at most 100"):
        stage.upload(np.zeros(101))
    stage.upload(np.zeros(100))
    with pytest.raises(StageError, match="arm"):
        stage.start()
    stage.arm()
    stage.start()
    with pytest.raises(StageError, match="arm"):
        stage.start()
    assert stage.read().displacement.size == 100


def test_a_waveform_takes_real_time_on_request():
    """At 1e-4 of real time 20 ms last 200 s: everything but safe() and close() has to wait."""
    stage = SimulatedMemoryStage(real_time_factor=1e-4)
    stage.upload(np.full(1000, 3.0))
    stage.arm()
    stage.start()
    with pytest.raises(StageError, match="still playing"):
        stage.wait(0.0)
    for busy in (stage.read, stage.start, stage.read_displacement, lambda: stage.upload(np.zeros(1))):
        with pytest.raises(StageError, match="still playing"):
            busy()
    armed = stage.time
    stage.safe()
    assert stage.voltage == 0.0
    assert stage.time < armed + 0.02, "stopped before its end"
    with pytest.raises(StageError, match="nothing recorded"):
        stage.read()


def test_a_real_time_memory_stage_gives_the_result_of_a_fast_one():
    drive = np.linspace(0.0, 5.0, 200)
    fast, paced = (SimulatedMemoryStage(seed=1, real_time_factor=f) for f in (math.inf, 1.0))
    np.testing.assert_array_equal(
        play_from_memory(fast, drive).displacement, play_from_memory(paced, drive).displacement
    )


@KINDS
def test_a_drive_that_breaks_a_limit_plays_nothing(kind):
    stage = kind()
    stage.set_voltage(2.0)
    play = stage.exchange if kind is SimulatedStage else stage.upload
    before = stage.time, stage.voltage
    for drive in ([2.0, 10.1], [2.0, -0.1], [2.0, math.nan], []):
        with pytest.raises(StageError, match="expected"):
            play(np.array(drive))
    with pytest.raises(StageError, match="expected"):
        stage.set_voltage(11.0)
    assert (stage.time, stage.voltage) == before


@KINDS
def test_slow_path_sets_and_reads(kind, ideal):
    stage = kind(ideal())
    stage.set_voltage(4.0)
    for _ in range(2000):
        reading = stage.read_displacement()
    assert reading == pytest.approx(stage.parameters.stroke(0.0, 4.0), rel=1e-6)
    stage.safe()
    assert stage.voltage == 0.0


@KINDS
def test_a_closed_stage_is_safe_and_refuses_work(kind):
    stage = kind()
    stage.set_voltage(4.0)
    stage.close()
    stage.close()
    assert stage.voltage == 0.0
    for work in (
        stage.read_displacement,
        lambda: stage.set_voltage(1.0),
        lambda: stage.configure(TS),
        lambda: stage.play([0.0]),
    ):
        with pytest.raises(StageError, match="closed"):
            work()


@KINDS
def test_another_sample_period_keeps_voltage_and_time(kind):
    stage = kind()
    stage.set_voltage(4.0)
    stage.configure(1e-3)
    assert stage.sample_period == 1e-3
    assert stage.voltage == pytest.approx(4.0, abs=2e-4)
    stage.read_displacement()
    assert stage.time == pytest.approx(1.02e-3)
    with pytest.raises(StageError, match="sample period"):
        stage.configure(0.1)


def test_a_stage_that_cannot_reach_zero_rests_at_its_nearest_voltage():
    stage = SimulatedStage.from_mapping({"electronics": {"voltage_min": 1.0}})
    assert stage.description.safe_voltage == 1.0
    assert stage.voltage == pytest.approx(1.0, abs=2e-4)


def test_phases_start_from_rest_or_continue(ideal):
    stage = SimulatedStage(ideal())
    first = stage.play(np.full(100, 6.0), "hold")
    assert np.ptp(first.displacement) < 1e-12
    assert first.settled_voltage == pytest.approx(6.0)
    step = stage.play(np.full(100, 6.0), "step", initial_voltage=1.0)
    assert step.settled_voltage == 1.0
    assert step.start_time == pytest.approx(0.002)
    assert step.displacement[-1] - step.displacement[0] > 10e-6
    more = stage.play(np.full(10, 6.0), "hold", continues=True)
    assert more.continues
    assert more.displacement[0] == pytest.approx(step.displacement[-1], rel=0.02)


def test_slow_phases_are_block_averages_of_the_fast_simulation():
    drive = np.repeat([1.0, 4.0, 2.0], 5000)
    fast = SimulatedStage(seed=1).play(drive)
    slow = SimulatedStage(seed=1).play(drive, average=50)
    np.testing.assert_array_equal(slow.displacement, fast.decimate(50).displacement)
    assert slow.sample_period == pytest.approx(1e-3)
    assert slow.size == 300


def test_channels_reach_the_record():
    stage = SimulatedStage.from_mapping(
        {"environment.other_amplitude": 1e-6, "environment.thermometer": 1}, seed=2, sample_period=1e-3
    )
    record = stage.play(np.zeros(10), average=2)
    assert record.channels["other_displacement"].size == record.channels["temperature"].size == 5
    acquired = stage.exchange(np.zeros(3))
    assert {name: values.size for name, values in acquired.channels.items()} == {
        "other_displacement": 3,
        "temperature": 3,
    }


def test_seed_makes_the_device():
    a, b, c = (SimulatedStage(seed=s) for s in (1, 1, 2))
    readings = [s.exchange(np.zeros(50)).displacement for s in (a, b, c)]
    np.testing.assert_array_equal(readings[0], readings[1])
    assert np.any(readings[0] != readings[2])
    assert a.description.name == b.description.name != c.description.name


@pytest.mark.parametrize("wrong", [{"longest_block": 0}, {"dead_time": -1.0}, {"real_time_factor": 0.0}])
def test_a_memory_that_makes_no_sense_is_refused(wrong):
    with pytest.raises(StageError, match="expected"):
        SimulatedMemoryStage(**wrong)
