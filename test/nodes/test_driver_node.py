"""The driver as a process: nothing is lost untold, nothing leaves the limits, and its end leaves the stage safe."""

import signal

import numpy as np
import pytest
from rcl_interfaces.srv import SetParametersAtomically
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64
from std_srvs.srv import Trigger

from piezo_hysteresis.nodes import back_ends
from piezo_hysteresis.nodes.conversions import phase_from_text
from piezo_hysteresis.nodes.driver_node import DriverNode
from piezo_hysteresis.record import Experiment, Record
from piezo_hysteresis.recording import write

from .witness import Witness

pytestmark = pytest.mark.nodes

PERIOD = 2e-5
RAMP_RATE = 20.0
IDEAL = {"simulated__electronics__dac_bits": 0.0, "ramp_rate": RAMP_RATE}
"""Without a converter the voltages published are those applied, bit for bit."""


def test_every_sample_of_a_command_arrives_or_is_told_lost(lab):
    lab.driver(**IDEAL)
    samples, statuses, phases = lab.streaming(), lab.statuses(), lab.phases()
    wave = np.concatenate(([0.0], np.random.default_rng(1).uniform(0, 10, 50_000), [0.0]))
    lab.send(wave, "noise")
    lab.wait(lambda: lab.states(statuses, "noise") == ["accepted", "playing", "done"], "the end of the command")
    number, first = (lab.value(statuses, "noise", "done", key) for key in ("phase", "first_index"))
    lab.wait(lambda: samples.newest.index[-1] > first + wave.size, "the samples after it")
    assert (np.diff(samples.place()) > 0).all()
    assert samples.played(wave, first, number)
    assert [phase_from_text(p.data)[1] for p in phases][-2:] == ["noise", "hold"]


def test_stamps_and_times_are_one_clock(lab):
    lab.driver(**IDEAL)
    samples = lab.streaming()
    lab.wait(lambda: len(samples.blocks) > 100, "a second of blocks")
    blocks = samples.blocks[:100]
    start = np.array([b.stamp + round(b.time[0] * 1e9) for b in blocks])
    expected = np.array([int(b.index[0]) for b in blocks]) * round(PERIOD * 1e9)
    assert np.abs((start - start[0]) - (expected - expected[0])).max() <= 1
    assert all(b.sample_period == pytest.approx(PERIOD, rel=1e-9) for b in blocks)


def test_a_refused_command_plays_nothing(lab):
    lab.driver(**IDEAL, max_slew_rate=1e5)
    samples, statuses = lab.streaming(), lab.statuses()
    refused = {
        "too_high": ([0.0, 1.0, 10.1], PERIOD, 0.0, "expected 0 to 10 V"),
        "too_low": ([0.0, -0.1], PERIOD, 0.0, "expected 0 to 10 V"),
        "too_steep": ([0.0, 3.0, 0.0], PERIOD, 0.0, "V/s"),
        "far_start": ([5.0, 5.0], PERIOD, 0.0, "V/s"),
        "not_finite": ([0.0, np.nan, 0.0], PERIOD, 0.0, "finite"),
        "other_period": ([0.0, 0.1, 0.0], 2 * PERIOD, 0.0, "period"),
        "old": ([0.0, 0.1, 0.0], PERIOD, 3.0, "old"),
        "empty": ([], PERIOD, 0.0, "no points"),
    }
    for name, (wave, period, age, _) in refused.items():
        lab.send(wave, name, period, age=age)
    lab.wait(lambda: {s.name for s in statuses} >= set(refused), "all refusals")
    reasons = {s.name: s.message for s in statuses}
    for name, (_, _, _, reason) in refused.items():
        assert lab.states(statuses, name) == ["refused"]
        assert reason in reasons[name], reasons[name]
    blocks = len(samples.blocks)
    lab.wait(lambda: len(samples.blocks) > blocks + 10, "later blocks")
    assert not samples.voltage.any()
    assert not samples.phase.any()


def test_a_second_command_is_refused_and_the_first_played_whole(lab):
    lab.driver(**IDEAL)
    samples, statuses = lab.streaming(), lab.statuses()
    wave = np.linspace(0, 2, 20_000)
    lab.send(wave, "first")
    lab.send(np.zeros(10), "second")
    lab.wait(lambda: "done" in lab.states(statuses, "first"), "the first command")
    assert lab.states(statuses, "second") == ["refused"]
    lab.wait(lambda: samples.newest.phase[-1] == 2, "the hold after it")
    assert samples.played(wave, lab.value(statuses, "first", "playing", "first_index"), 1)


def test_set_voltage_ramps_and_holds(lab):
    lab.driver(**IDEAL)
    samples, statuses, live = lab.streaming(), lab.statuses(), lab.listen(JointState, "live")
    ask = lab.publisher(Float64, "set_voltage")
    ask.publish(Float64(data=4.0))
    lab.wait(lambda: samples.newest.voltage[-1] == 4.0, "the set-point")
    assert samples.steepest(PERIOD) <= RAMP_RATE * (1 + 1e-6)
    for wrong in (10.5, -0.5, float("nan")):
        ask.publish(Float64(data=wrong))
    lab.wait(lambda: lab.states(statuses, "set_voltage") == ["refused"] * 3, "three refusals")
    assert samples.voltage.max() == 4.0
    lab.wait(lambda: live and live[-1].position[0] == 4.0, "live values")
    assert list(live[-1].name) == ["voltage", "displacement"]


def test_hold_timeout_leads_to_the_safe_voltage(lab):
    lab.driver(**IDEAL, hold_timeout=0.3)
    samples = lab.streaming()
    lab.send(np.linspace(0, 1, 1000), "step")
    lab.wait(lambda: samples.newest.phase[-1] == 2 and samples.newest.voltage[-1] == 0.0, "the way back")
    held = samples.place()[samples.voltage == 1.0]
    assert held[-1] - held[0] == pytest.approx(0.3 / PERIOD, abs=2 + samples.lost)
    assert samples.steepest(PERIOD) <= 1 / (999 * PERIOD) * (1 + 1e-6)


def test_stop_ramps_a_playing_waveform_down(lab):
    lab.driver(**IDEAL)
    samples, statuses = lab.streaming(), lab.statuses()
    lab.send(np.concatenate((np.linspace(0, 3, 10_000), np.full(500_000, 3.0))), "long")
    lab.wait(lambda: samples.newest.voltage[-1] == 3.0, "the top")
    assert lab.call(Trigger, "driver_node/stop").success
    lab.wait(lambda: samples.newest.voltage[-1] == 0.0, "the safe voltage")
    assert lab.states(statuses, "long") == ["accepted", "playing", "stopped"]
    assert samples.steepest(PERIOD) <= RAMP_RATE * (1 + 1e-6)
    lab.send(np.zeros(10), "next")
    lab.wait(lambda: "done" in lab.states(statuses, "next"), "a later command")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM], ids=["SIGINT", "SIGTERM"])
def test_a_signal_ramps_to_the_safe_voltage(lab, number):
    driver = lab.driver(**IDEAL)
    samples = lab.streaming()
    lab.send(np.concatenate((np.linspace(0, 4, 20_000), np.full(500_000, 4.0))), "long")
    lab.wait(lambda: samples.newest.voltage[-1] == 4.0, "the top")
    driver.signal(number)
    assert driver.wait() == 0, driver.output
    lab.wait(lambda: samples.newest.voltage[-1] == 0.0, "the safe voltage")
    assert samples.steepest(PERIOD) <= RAMP_RATE * (1 + 1e-6)


def test_deactivate_ramps_down_and_activate_streams_again(lab):
    lab.driver(**IDEAL)
    samples = lab.streaming()
    lab.publisher(Float64, "set_voltage").publish(Float64(data=2.0))
    lab.wait(lambda: samples.newest.voltage[-1] == 2.0, "the set-point")
    assert lab.transition("deactivate")
    assert lab.state() == "inactive"
    lab.wait(lambda: samples.newest.voltage[-1] == 0.0, "the safe voltage")
    assert samples.steepest(PERIOD) <= RAMP_RATE * (1 + 1e-6)
    blocks = len(samples.blocks)
    assert lab.transition("activate")
    lab.wait(lambda: len(samples.blocks) > blocks + 5, "blocks again")


@pytest.mark.parametrize("same_machine", [True, False])
def test_a_second_driver_refuses_until_the_first_is_gone(lab, same_machine, tmp_path):
    first = lab.driver(**IDEAL)
    samples, told = lab.streaming(), lab.diagnostics()
    other = tmp_path / "other_machine"
    other.mkdir()
    environment = {} if same_machine else {"XDG_RUNTIME_DIR": str(other)}
    second = lab.driver("-r", "__node:=second", environment=environment, discovery_time=10.0, **IDEAL)
    lab.wait(lambda: any(s.name == "second: stage" and s.level == b"\x02" for a in told for s in a.status), "an error")
    assert ("is driven by process" if same_machine else "published by another driver") in second.output
    assert lab.state("second") == "unconfigured"
    first.signal(signal.SIGINT)
    assert first.wait() == 0
    lab.wait(lambda: lab.node.count_publishers("samples") == 0, "the end of the first")
    blocks = len(samples.blocks)
    assert lab.call(
        SetParametersAtomically, "second/set_parameters_atomically", _set(discovery_time=0.1)
    ).result.successful
    assert lab.transition("configure", "second")
    assert lab.transition("activate", "second")
    lab.wait(lambda: len(samples.blocks) > blocks, "blocks of the second")


def test_a_killed_driver_can_be_started_again_at_once(lab):
    first = lab.driver(**IDEAL)
    samples = lab.streaming()
    first.signal(signal.SIGKILL)
    first.wait()
    blocks = len(samples.blocks)
    lab.driver(**IDEAL)
    lab.wait(lambda: len(samples.blocks) > blocks + 5, "blocks of the second")


def test_further_signals_do_not_cut_the_ramp(lab):
    driver = lab.driver(**{**IDEAL, "ramp_rate": 4.0})
    samples = lab.streaming()
    lab.send(np.linspace(0, 4, 20_000), "up")
    lab.wait(lambda: samples.newest.voltage[-1] == 4.0, "the top")
    for number in (signal.SIGINT, signal.SIGINT, signal.SIGTERM):
        driver.signal(number)
        lab.wait(lambda top=samples.newest.voltage[-1]: samples.newest.voltage[-1] < top, "the way down")
    assert driver.wait() == 0
    lab.wait(lambda: samples.newest.voltage[-1] == 0.0, "the safe voltage")
    assert samples.steepest(PERIOD) <= 4 / (19_999 * PERIOD) * (1 + 1e-6)


def _set(**values):
    request = SetParametersAtomically.Request()
    request.parameters = [
        Parameter(name.replace("__", "."), value=value).to_parameter_msg() for name, value in values.items()
    ]
    return request


def test_a_failed_configure_tells_why_and_can_be_tried_again(lab):
    driver = lab.driver(stage="replay")
    told = lab.diagnostics()
    lab.wait(lambda: any(s.level == b"\x02" for a in told for s in a.status), "an error")
    assert "replay.experiment" in driver.output
    assert lab.state() == "unconfigured"
    assert lab.call(
        SetParametersAtomically, "driver_node/set_parameters_atomically", _set(stage="simulated")
    ).result.successful
    assert lab.transition("configure")
    answer = lab.call(SetParametersAtomically, "driver_node/set_parameters_atomically", _set(ramp_rate=1.0)).result
    assert not answer.successful
    assert "read at configure" in answer.reason
    answer = lab.call(
        SetParametersAtomically, "driver_node/set_parameters_atomically", _set(in_force__voltage_max=99.0)
    )
    assert not answer.result.successful
    assert lab.transition("activate")
    lab.streaming()


def test_a_failing_stage_is_made_safe_told_and_can_be_tried_again(lab, monkeypatch):
    """In the process of the test, since no real stage fails when asked to."""
    stages = [Witness(1e-3, 100.0, fails_at=5), Witness(1e-3, 100.0)]
    opened = iter(stages)
    monkeypatch.setitem(back_ends.BACK_ENDS, "simulated", back_ends.BackEnd((), lambda *_: next(opened), True))
    told = lab.diagnostics()
    node = lab.add(DriverNode, discovery_time=0.0, ramp_rate=50.0)
    node.begin()
    lab.wait(lambda: lab.state() == "unconfigured", "the end of the failed stage")
    assert (stages[0].made_safe, stages[0].closed) == (1, 1)
    lab.wait(lambda: any("link lost" in s.message for a in told for s in a.status), "the reason")
    assert lab.transition("configure")
    assert lab.transition("activate")
    lab.streaming()
    assert lab.transition("deactivate")
    assert stages[1].made_safe == 0


def test_two_axes_do_not_meet(lab):
    for axis in ("/stage_x", "/stage_y"):
        lab.driver(namespace=axis, **IDEAL)
    x, y = lab.streaming("/stage_x/samples"), lab.streaming("/stage_y/samples")
    lab.publisher(Float64, "/stage_y/set_voltage").publish(Float64(data=1.0))
    lab.wait(lambda: y.newest.voltage[-1] == 1.0, "the set-point of y")
    assert not x.voltage.any()


def test_a_recording_is_replayed_sample_by_sample(lab, tmp_path):
    rng = np.random.default_rng(2)
    records = [
        Record(rng.random(37), rng.random(37) * 1e-5, 5e-3, "rest"),
        Record(rng.random(64), rng.random(64) * 1e-5, 5e-3, "triangle", start_time=37 * 5e-3),
    ]
    write(Experiment(tuple(records)), tmp_path / "experiment")
    samples, phases = lab.samples(), lab.phases()
    lab.driver(stage="replay", replay__experiment=str(tmp_path / "experiment"), replay__subscribers=1)
    lab.wait(lambda: samples.blocks and samples.newest.phase[-1] == 3, "the end of the recording")
    assert samples.index[0] == 0
    assert samples.lost == 0
    for number, record in enumerate(records, 1):
        inside = samples.phase == number
        assert np.array_equal(samples.voltage[inside], record.voltage)
        assert np.array_equal(samples.displacement[inside], record.displacement)
    assert [p.data for p in phases][-3:] == ["1 rest", "2 triangle", "3 hold"]


def test_a_stage_with_memory_plays_blocks_and_tells_the_dead_time(lab):
    lab.driver(**IDEAL, simulated__memory=True, simulated__longest_block=10_000, simulated__dead_time=0.02)
    samples, statuses = lab.streaming(), lab.statuses()
    wave = np.sin(np.linspace(0, np.pi, 25_000)) * 5
    lab.send(wave, "sine")
    lab.wait(lambda: "done" in lab.states(statuses, "sine"), "the end of the command")
    lab.wait(lambda: samples.newest.phase[-1] == 2, "the hold after it")
    in_phase = samples.phase == 1
    assert np.array_equal(samples.voltage[in_phase], wave)
    played = [b for b in samples.blocks if b.phase[0] == 1]
    assert [b.size for b in played] == [10_000, 10_000, 5_000]
    assert all(b.follows_gap for b in played)
    gaps = [int(b.index[0]) - int(a.index[-1]) - 1 for a, b in zip(samples.blocks, samples.blocks[1:], strict=False)]
    assert all((gap > 0) == block.follows_gap for gap, block in zip(gaps, samples.blocks[1:], strict=True))
